"""References of any convex outline: found by laying them over the edges from everywhere."""

from __future__ import annotations

import numpy as np
import pytest
from drawn_ground import frame
from drawn_solid import box_around, distance_and_sigma, drawn, lens, motion_between, random_state, top_px
from laws import few
from tolerances import GEOMETRY_REL, POLYGON_LENGTH_REL, SOLID_PX

from standoff.core.camera import CameraPrior
from standoff.core.homography import FloatArray
from standoff.core.pose import View, roll_and_pitch
from standoff.core.types import Detections, GroundMap, ImageArray, NoCameraMotion, NoGroundMap
from standoff.stages.ground import FusedGround, GivenPlace, Reference, ReferenceParams, ReferenceShape
from standoff.stages.ground.solid import SolidState, sample_edges
from standoff.stages.ground.solid_choice import Found
from standoff.stages.ground.solid_poses import Poses, poses_in_box, to_pinhole
from standoff.stages.ground.solid_search import HeightPrior, search_solid

TRIANGLE = ReferenceShape.from_corners([[0.0, 0.0], [3.2, 0.0], [1.0, 2.6]])
PENTAGON = ReferenceShape.from_corners([[0.0, 0.0], [2.4, 0.0], [3.2, 1.4], [1.6, 3.0], [0.0, 2.2]])
HEXAGON = ReferenceShape.regular(6, 1.5)
DODECAGON = ReferenceShape.regular(12, 0.8)
CAMERA = lens(k1=-0.04)
PAIRS_PX = np.array([[150.0, 300.0], [480.0, 120.0], [100.0, 200.0], [540.0, 200.0], [320.0, 100.0], [320.0, 340.0]])
STILL = NoCameraMotion("not estimated")


def _lengths_m(view: View) -> FloatArray:
    ends = view.to_plane(PAIRS_PX).reshape(-1, 2, 2)
    return np.asarray(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1))


def _off_rel(found: Found, state: SolidState) -> float:
    """Return by how much lengths on the ground around the reference are off, the worst of some."""
    return float(np.abs(_lengths_m(found.fit.state.view) / _lengths_m(state.view) - 1.0).max())


def _scene(shape: ReferenceShape, height_m: float, seed: int, noise: float = 4.0) -> tuple[SolidState, ImageArray]:
    rng = np.random.default_rng([seed, len(shape.corners_m)])
    state = random_state(rng, shape, CAMERA, height_m)
    sun_m = (float(rng.uniform(-0.6, 0.6)), float(rng.uniform(-0.6, 0.6)))
    return state, drawn(shape, state, seed=seed, noise=noise, sun_m=sun_m)


def _crooked_box(shape: ReferenceShape, state: SolidState, seed: int) -> FloatArray:
    """Return a box whose sides are each off by up to a tenth of its size."""
    box = box_around(shape, state)
    return np.asarray(box + np.random.default_rng([seed, 3]).uniform(-0.1, 0.1, 4) * np.tile(box[2:] - box[:2], 2))


def _searched(
    shape: ReferenceShape, height: HeightPrior, height_m: float, seed: int
) -> tuple[Found | NoGroundMap, SolidState]:
    state, picture = _scene(shape, height_m, seed)
    box = _crooked_box(shape, state, seed)
    return search_solid(picture, box, shape, CameraPrior.calibrated(CAMERA), height), state


@pytest.mark.parametrize(
    ("shape", "height_m"),
    few([(HEXAGON, 0.5), (PENTAGON, 0.0), (DODECAGON, 0.4)]),
    ids=["hexagon", "flat pentagon", "dodecagon"],
)
def test_a_polygon_of_known_height_is_found_in_a_crooked_box(shape: ReferenceShape, height_m: float) -> None:
    for seed in range(2):
        found, state = _searched(shape, HeightPrior.known(height_m), height_m, seed)
        assert isinstance(found, Found), f"seed {seed}: {found.reason}"
        assert _off_rel(found, state) < POLYGON_LENGTH_REL, f"seed {seed}"


@pytest.mark.parametrize("shape", [PENTAGON, HEXAGON], ids=["pentagon", "hexagon"])
def test_a_height_that_nobody_measured_follows_from_the_base(shape: ReferenceShape) -> None:
    for seed in range(2):
        found, state = _searched(shape, HeightPrior.unknown(), 0.6, seed)
        assert isinstance(found, Found), f"seed {seed}: {found.reason}"
        sigma_m = float(np.sqrt(np.linalg.inv(found.belief().information)[-1, -1]))
        assert abs(found.fit.state.height_m - state.height_m) < 3.5 * sigma_m, f"seed {seed}"
        assert _off_rel(found, state) < 2.0 * POLYGON_LENGTH_REL, f"seed {seed}"


def test_a_triangle_is_found_or_nothing_is_said() -> None:
    """Three sides have none to spare: beside a hard shadow the triangle could often lie in two ways."""
    seen = 0
    for seed in range(5):
        height_m = 0.4 * (seed % 3)
        found, state = _searched(TRIANGLE, HeightPrior.known(height_m), height_m, seed)
        if isinstance(found, Found):
            seen += 1
            assert _off_rel(found, state) < POLYGON_LENGTH_REL, f"seed {seed}"
    assert seen >= 3


@pytest.mark.parametrize(
    ("drawn_shape", "told"),
    few(
        [
            (HEXAGON, PENTAGON),
            (ReferenceShape.square(2.6), TRIANGLE),
            (PENTAGON, HEXAGON),
            (ReferenceShape.square(2.6), PENTAGON),
            (ReferenceShape.regular(8, 1.2), HEXAGON),
        ],
        quick=2,
    ),
)
def test_a_solid_of_another_shape_gives_no_map(drawn_shape: ReferenceShape, told: ReferenceShape) -> None:
    state, picture = _scene(drawn_shape, 0.4, seed=len(told.corners_m))
    box = _crooked_box(drawn_shape, state, seed=1)
    found = search_solid(picture, box, told, CameraPrior.calibrated(CAMERA), HeightPrior.known(0.4))
    assert isinstance(found, NoGroundMap)


def test_sides_too_short_to_have_an_edge_are_not_held_against_a_polygon() -> None:
    small = ReferenceShape.regular(12, 0.25)
    tried = 0
    for seed in range(3):
        found, state = _searched(small, HeightPrior.known(0.2), 0.2, seed)
        if (sample_edges(small, state).length_px[:12] > 0).all():
            continue
        tried += 1
        assert isinstance(found, Found), f"seed {seed}: {found.reason}"
        assert _off_rel(found, state) < 3.0 * POLYGON_LENGTH_REL, f"seed {seed}"
    assert tried


def test_a_hexagon_is_followed_and_its_distances_are_right_within_their_errors() -> None:
    start, _ = _scene(HEXAGON, 0.4, 5)
    states = [
        SolidState(start.view.changed(np.array([0.01, 0.02, -0.015, 0.3, -0.1, 0.05, 0.0, 0.0]) * k / 5.0), 0.4)
        for k in range(4)
    ]
    place = GivenPlace(box_around(HEXAGON, states[0]), first_corner_px=top_px(HEXAGON, states[0])[4])
    params = ReferenceParams(size_sigma=0.0)
    ground = FusedGround([Reference(HEXAGON, 0.4, place, params)], camera=CameraPrior.calibrated(CAMERA))
    for k, state in enumerate(states):
        motion = motion_between(states[0].view, state.view, 0.0) if k else STILL
        result = ground.update(frame(drawn(HEXAGON, state, seed=k), k / 5.0), Detections.empty(), motion)
        assert isinstance(result, GroundMap), result.reason
        length_m, sigma_m = distance_and_sigma(result, PAIRS_PX[:2])
        assert abs(length_m - _lengths_m(state.view)[0]) < 3.0 * sigma_m
        # The hint names the corner that is the first from then on.
        assert np.linalg.norm(result.anchors_px[0] - top_px(HEXAGON, state)[4]) < SOLID_PX


def test_roll_and_pitch_are_those_that_a_gimbal_is_told() -> None:
    rng = np.random.default_rng(3)
    for _ in range(20):
        heading, pitch, roll = rng.uniform(-180, 180), rng.uniform(5, 80), rng.uniform(-20, 20)
        view = View.aimed(CAMERA, np.zeros(3), heading_deg=heading, pitch_deg=pitch, roll_deg=roll)
        found_roll, found_pitch = roll_and_pitch(view.site_to_camera)
        assert np.sign(found_roll) == np.sign(roll)
        down = np.arcsin(-view.site_to_camera[2, 2])
        assert float(found_pitch) == pytest.approx(float(down), rel=1e3 * GEOMETRY_REL)


@pytest.mark.parametrize("shape", [TRIANGLE, PENTAGON, HEXAGON], ids=["triangle", "pentagon", "hexagon"])
def test_among_the_poses_in_a_box_one_is_near_to_any_level_camera(shape: ReferenceShape) -> None:
    pinhole = lens()
    corners, shares = np.tile(shape.corners_m, (2, 1)), np.repeat([1.0, 0.0], len(shape.corners_m))
    for seed in range(10):
        state = random_state(np.random.default_rng(seed), shape, pinhole, 0.5)
        box = _crooked_box(shape, state, seed)
        poses = poses_in_box(box, shape, pinhole, (0.5,))
        true = Poses(state.view.site_to_camera[None], state.view.position_m[None], np.array([0.5]))
        expected = to_pinhole(true.in_camera(corners, shares), pinhole)[0].reshape(2, -1, 2)
        seen = to_pinhole(poses.in_camera(corners, shares), pinhole).reshape(len(poses), 2, -1, 2)
        ways = [np.roll(expected, -turn, axis=1) for turn in shape.turns_onto_itself()]
        apart = min(float(np.linalg.norm(seen - way, axis=-1).max(axis=(1, 2)).min()) for way in ways)
        # A fifth of the box, by which the box itself may be off; from there the edges pull.
        assert apart < 0.2 * float((box[2:] - box[:2]).max())
