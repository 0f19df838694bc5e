from __future__ import annotations

import numpy as np
import pytest
from flat_ground import FlatGround
from tolerances import HULL_BOX_PX, SURVEYED_BOX_PX, SURVEYED_SHARE

from standoff.core.camera import Camera
from standoff.core.homography import FloatArray
from standoff_sim.camera.flight import Still
from standoff_sim.clip.presets import plan_clip
from standoff_sim.clip.site_truth import SiteTruth
from standoff_sim.clip.studio import Studio
from standoff_sim.clip.truth import Sight, full_box_px
from standoff_sim.machines.excavator import make_excavator
from standoff_sim.movement.motion import Place, held
from standoff_sim.people.worker import make_worker
from standoff_sim.scene.light import random_light
from standoff_sim.scene.moment import scene_at
from standoff_sim.scene.occlusion import Outlines
from standoff_sim.scene.scene import Actor, Batch, Model, Scene, place
from standoff_sim.scene.site import build_site
from standoff_sim.solids.lumps import cut, lumps_of
from standoff_sim.solids.mesh import box, join, translation, tube

_SIDES = ("x1_px", "y1_px", "x2_px", "y2_px")
_CAMERA = Camera(
    1280, 720, np.array([[900.0, 0.0, 639.5], [0.0, 900.0, 359.5], [0.0, 0.0, 1.0]]), np.array([-0.1, 0.02, 0, 0, 0])
)


def _scene(*props: Batch, model: Model | None = None, at: tuple[float, float] = (0.0, 0.0)) -> Scene:
    """Somebody on level ground, seen from the south."""
    rng = np.random.default_rng(1)
    model = model or make_worker(rng)
    actor = Actor(1, model, held(Place(*at), 1.0))
    flight = Still.over(_CAMERA, np.zeros(2), altitude_m=20.0, pitch_deg=40.0, heading_deg=0.0)
    return Scene("test", 1, FlatGround(), props, (actor,), (), None, random_light(rng, "noon"), flight)


def _sight(scene: Scene) -> Sight:
    ((_, sight),) = Outlines(scene).sights(scene_at(scene, 0.0))
    return sight


def _wall(height_m: float) -> Batch:
    return place(box((3.0, 0.2, height_m), None), translation(0.0, -0.8, 0.0))


def test_who_stands_in_the_open_shows_as_a_whole_with_the_box_of_all_vertices() -> None:
    scene = _scene()
    sight, moment = _sight(scene), scene_at(scene, 0.0)
    expected_px = full_box_px(moment.bodies[0].batches, moment.view)
    assert sight.visible_share == 1.0
    np.testing.assert_allclose(sight.full_px, expected_px, atol=HULL_BOX_PX)
    np.testing.assert_array_equal(sight.box_px, sight.full_px)


def test_a_wall_hides_whoever_stands_behind_it_and_nobody_before_it() -> None:
    tall = _sight(_scene(_wall(4.0)))
    assert tall.visible_px == 0 and tall.visible_share == 0.0 and np.isnan(tall.box_px).all()
    assert _sight(_scene(_wall(4.0), at=(0.0, -2.0))).visible_share == 1.0


def test_a_low_wall_hides_the_legs_and_a_higher_one_more() -> None:
    shares = [_sight(_scene(_wall(height_m))).visible_share for height_m in (0.0001, 1.2, 1.5, 1.8)]
    assert shares == sorted(shares, reverse=True)
    assert shares[0] == 1.0 and 0.2 < shares[2] < shares[1] < 1.0
    half = _sight(_scene(_wall(1.5)))
    np.testing.assert_allclose(half.box_px[:2], half.full_px[:2], atol=SURVEYED_BOX_PX)
    assert half.box_px[3] < half.full_px[3] - 3.0


def test_bars_hide_nobody() -> None:
    bars = join([tube([(x, -0.8, 0.0), (x, -0.8, 3.0)], 0.02, None) for x in np.linspace(-1.0, 1.0, 30).tolist()])
    assert _sight(_scene(place(bars, np.eye(4)))).visible_share == 1.0


def test_beyond_the_edge_of_the_picture_the_box_ends_there_and_the_share_falls() -> None:
    excavator = make_excavator(np.random.default_rng(0))
    whole, cut_off = _sight(_scene(model=excavator)), _sight(_scene(model=excavator, at=(19.5, 0.0)))
    assert whole.visible_share > 0.99
    assert 0.1 < cut_off.visible_share < 0.95
    assert cut_off.box_px[2] == 1279.5 < cut_off.full_px[2]


def test_lumps_are_small_and_their_box_is_that_of_the_whole() -> None:
    excavator = make_excavator(np.random.default_rng(0))
    parts = excavator.parts({})
    lumps = lumps_of(parts)
    every_m = np.concatenate([b.mesh.vertices_m @ p[:3, :3].T + p[:3, 3] for b in parts for p in b.poses])
    np.testing.assert_allclose(lumps.points_m.min(axis=0), every_m.min(axis=0), atol=1e-5)
    np.testing.assert_allclose(lumps.points_m.max(axis=0), every_m.max(axis=0), atol=1e-5)
    sizes_m = np.maximum.reduceat(lumps.points_m, lumps.starts) - np.minimum.reduceat(lumps.points_m, lumps.starts)
    assert sizes_m.max() < 3.0
    assert len(lumps.starts) > 20


def test_some_lumps_of_many_are_the_same_lumps() -> None:
    lumps = cut(box((6.0, 3.0, 2.0), None))
    kept = np.arange(len(lumps.starts)) % 2 == 0
    chosen = lumps.chosen(kept)
    for mine, theirs in enumerate(np.flatnonzero(kept).tolist()):
        own = chosen.points_m[chosen.starts[mine] :][: chosen.counts[mine]]
        np.testing.assert_array_equal(own, lumps.points_m[lumps.starts[theirs] :][: lumps.counts[theirs]])


@pytest.mark.live
def test_of_whom_one_pixel_shows_the_box_has_a_left_and_a_right() -> None:
    # One row of a worker's feet shows here, and ends above the middle of the pixel in which it is drawn.
    site = build_site(plan_clip("ordinary", seed=3002, frames=15, fps=5.0, width_px=1280, height_px=720))
    seen = [row for row in SiteTruth(site).at(4, 0.8).entities if row["visible_px"]]
    boxes_px = np.array([[row[side] for side in _SIDES] for row in seen])
    assert min(row["visible_px"] for row in seen) == 1
    assert (boxes_px[:, :2] < boxes_px[:, 2:]).all()


@pytest.mark.live
@pytest.mark.usefixtures("opengl")
def test_a_true_frame_says_what_the_rendered_one_shows() -> None:
    site = build_site(plan_clip("virtual", seed=5, width_px=1280, height_px=720))
    with Studio(site) as studio:
        shot = studio.shoot(0, 0.5, clean=True)
    true = SiteTruth(site).at(0, 0.5)
    np.testing.assert_equal(true.pairs, shot.pairs)
    truth = {row["entity_id"]: row for row in true.entities}
    checked = 0
    for row in (row for row in shot.entities if row["entity_id"] <= 1000):
        other = truth[row["entity_id"]]
        differing = {name for name in row if row[name] != other[name] and row[name] == row[name]}
        assert differing <= {*_SIDES, *(f"full_{side}" for side in _SIDES), "visible_px", "visible_share"} | _FEET
        assert other["visible_share"] == pytest.approx(row["visible_share"], abs=SURVEYED_SHARE)
        _assert_same_boxes(row, other)
        checked += row["visible_share"] > 0.9
    assert checked >= 3


_FEET = {"foot_x_px", "foot_y_px"}  # the same to the last digits but one: they are projected together


def _assert_same_boxes(row: dict[str, float], other: dict[str, float]) -> None:
    full_px, other_full_px, box_px, other_px = (_boxes(r, start) for start in ("full_", "") for r in (row, other))
    np.testing.assert_allclose(other_full_px, full_px, atol=HULL_BOX_PX)
    if row["visible_share"] > 0.9:
        np.testing.assert_allclose(other_px, box_px, atol=SURVEYED_BOX_PX)


def _boxes(row: dict[str, float], start: str) -> FloatArray:
    return np.array([row[f"{start}{side}"] for side in _SIDES])
