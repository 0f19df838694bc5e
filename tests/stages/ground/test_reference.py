from __future__ import annotations

import json

import numpy as np
import pytest
from drawn_ground import box_around, frame, lens, picture, view
from tolerances import REFERENCE_GROUND_REL

from standoff.core import homography
from standoff.core.camera import Camera
from standoff.core.classes import CLASS_BY_NAME
from standoff.core.errors import GroundError
from standoff.core.homography import FloatArray
from standoff.core.types import Detections, GroundMap, ImageArray, NoCameraMotion, NoGroundMap
from standoff.stages.ground import ReferenceGround, ReferenceParams, ReferenceShape
from standoff.stages.ground.params import ReferenceMethod
from standoff.stages.ground.reference import AMBIGUOUS, IMPLAUSIBLE, LOST
from standoff.stages.ground.reference_box import NOT_SEEN, NOT_YET, GivenPlace

METHODS: tuple[ReferenceMethod, ...] = ("paper", "paper+tls", "oriented")
FOOTING = ReferenceShape.square(2.89)
QUADRILATERAL = ReferenceShape.from_sides((4.4, 2.6, 2.6, 3.0), diagonal_m=4.4)
STILL = NoCameraMotion("not estimated")
NOTHING = Detections.empty()
LENS = lens()
WIDE = lens(300.0, (-0.18, 0.04, 0.001, -0.001, 0.0))


def detected(box: FloatArray, score: float = 0.9, name: str = "reference") -> Detections:
    return Detections(box[None], np.array([score]), np.array([CLASS_BY_NAME[name].id]))


def seen(
    shape: ReferenceShape, tilt_deg: float = 35.0, yaw_deg: float = 20.0, camera: Camera = LENS, away_m: float = 12.0
) -> tuple[ImageArray, FloatArray, FloatArray]:
    target_x, target_y = shape.corners_m.mean(axis=0).tolist()
    ground_to_image = view(camera, (target_x + 0.5, target_y + 0.3), away_m, tilt_deg, yaw_deg)
    return (
        picture(ground_to_image, shape.corners_m, camera),
        ground_to_image,
        box_around(ground_to_image, shape.corners_m, camera),
    )


def mapped(ground: GroundMap | NoGroundMap) -> GroundMap:
    assert isinstance(ground, GroundMap), ground.reason
    return ground


def reason(ground: GroundMap | NoGroundMap) -> str:
    assert isinstance(ground, NoGroundMap)
    return ground.reason


def length_errors(ground: GroundMap, ground_to_image: FloatArray, shape: ReferenceShape) -> FloatArray:
    """Return the relative errors of the distances between points on and around the reference."""
    centre = shape.corners_m.mean(axis=0)
    points = centre + 1.5 * (shape.corners_m - centre)
    points_px, _ = homography.apply(ground_to_image, points)
    if ground.camera is not None:
        points_px = ground.camera.distort(points_px)
    measured, valid = ground.to_ground(points_px)
    assert valid.all()
    true = np.linalg.norm(points - np.roll(points, 1, axis=0), axis=1)
    errors: FloatArray = np.linalg.norm(measured - np.roll(measured, 1, axis=0), axis=1) / true - 1.0
    return errors


@pytest.mark.parametrize("yaw_deg", [0.0, 50.0, 130.0, 260.0])
@pytest.mark.parametrize("shape", [FOOTING, QUADRILATERAL])
def test_metres_are_recovered_around_the_reference(shape: ReferenceShape, yaw_deg: float) -> None:
    gray, ground_to_image, box = seen(shape, yaw_deg=yaw_deg)
    ground = mapped(
        ReferenceGround(shape, place=GivenPlace(box_xyxy_px=box), camera=LENS).update(frame(gray), NOTHING, STILL)
    )
    assert np.abs(length_errors(ground, ground_to_image, shape)).max() < REFERENCE_GROUND_REL
    assert ground.method == "reference:oriented"


@pytest.mark.parametrize("method", METHODS)
def test_every_method_maps_the_footing_of_the_paper(method: ReferenceMethod) -> None:
    gray, ground_to_image, box = seen(FOOTING)
    ground = mapped(
        ReferenceGround(FOOTING, ReferenceParams(method=method), place=GivenPlace(box_xyxy_px=box)).update(
            frame(gray), NOTHING, STILL
        )
    )
    limit = REFERENCE_GROUND_REL * (10.0 if method == "paper" else 2.0)
    assert np.abs(length_errors(ground, ground_to_image, FOOTING)).max() < limit
    np.testing.assert_allclose(ground.to_ground(ground.anchors_px)[0], FOOTING.corners_m, atol=1e-6)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("corners", [3, 5])
def test_methods_of_four_lines_refuse_other_shapes_and_say_what_to_use(method: ReferenceMethod, corners: int) -> None:
    with pytest.raises(GroundError) as caught:
        ReferenceGround(ReferenceShape.regular(corners, 1.5), ReferenceParams(method=method))
    said = str(caught.value)
    assert f"four corners for the method {method}, found one of {corners}. Use the method fused" in said
    assert "\n" not in said


def test_corners_of_an_uneven_shape_get_their_own_coordinates() -> None:
    gray, ground_to_image, box = seen(QUADRILATERAL, yaw_deg=200.0)
    ground = mapped(
        ReferenceGround(QUADRILATERAL, place=GivenPlace(box_xyxy_px=box), camera=LENS).update(
            frame(gray), NOTHING, STILL
        )
    )
    found, _ = ground.to_ground(homography.apply(ground_to_image, QUADRILATERAL.corners_m)[0])
    np.testing.assert_allclose(found, QUADRILATERAL.corners_m, atol=0.02)


def test_the_distortion_of_a_wide_lens_is_removed() -> None:
    shape = ReferenceShape.square(6.0)
    gray, ground_to_image, box = seen(shape, camera=WIDE)
    with_camera = mapped(
        ReferenceGround(shape, place=GivenPlace(box_xyxy_px=box), camera=WIDE).update(frame(gray), NOTHING, STILL)
    )
    assert np.abs(length_errors(with_camera, ground_to_image, shape)).max() < REFERENCE_GROUND_REL
    true_px = WIDE.distort(homography.apply(ground_to_image, shape.corners_m)[0])
    off = np.linalg.norm(with_camera.anchors_px[:, None] - true_px[None], axis=2).min(axis=1)
    assert off.max() < 0.3


@pytest.mark.live
def test_stated_errors_of_the_map_are_of_the_size_of_the_real_ones() -> None:
    squares = []
    for yaw_deg in np.arange(0.0, 360.0, 24.0):
        gray, ground_to_image, box = seen(QUADRILATERAL, yaw_deg=float(yaw_deg))
        stage = ReferenceGround(QUADRILATERAL, place=GivenPlace(box_xyxy_px=box), camera=LENS)
        ground = mapped(stage.update(frame(gray), NOTHING, STILL))
        point_px = homography.apply(ground_to_image, np.array([[7.0, 5.0]]))[0]
        jacobian = homography.parameter_jacobian(ground.image_to_ground, point_px)[0]
        sigma = np.sqrt(np.trace(jacobian @ ground.covariance[:9, :9] @ jacobian.T))
        squares.append(float(((ground.to_ground(point_px)[0] - [7.0, 5.0]) ** 2).sum()) / sigma**2)
    assert 0.05 < np.sqrt(np.mean(squares)) < 2.0


def flight(count: int, yaw_step_deg: float) -> list[tuple[ImageArray, FloatArray]]:
    frames = []
    for k in range(count):
        ground_to_image = view(
            LENS, (1.5 + 0.08 * k, 1.4 - 0.05 * k), 12.0 + 0.05 * k, 30.0 + 0.5 * k, yaw_step_deg * k
        )
        frames.append((picture(ground_to_image, FOOTING.corners_m, LENS), ground_to_image))
    return frames


@pytest.mark.live
def test_the_site_frame_stays_while_the_drone_turns_around_and_only_the_first_box_is_given() -> None:
    frames = flight(25, 5.0)
    stage = ReferenceGround(
        FOOTING, place=GivenPlace(box_xyxy_px=box_around(frames[0][1], FOOTING.corners_m, LENS)), camera=LENS
    )
    first = None
    post = np.array([[4.0, 3.0]])
    for k, (gray, ground_to_image) in enumerate(frames):
        ground = mapped(stage.update(frame(gray, k / 30.0), NOTHING, STILL))
        found = ground.to_ground(homography.apply(ground_to_image, post)[0])[0]
        first = found if first is None else first
        np.testing.assert_allclose(found, first, atol=0.08)


def test_the_same_frames_give_the_same_maps() -> None:
    frames = flight(4, 5.0)
    box = box_around(frames[0][1], FOOTING.corners_m, LENS)
    runs = []
    for _ in range(2):
        stage = ReferenceGround(FOOTING, ReferenceParams(method="paper"), place=GivenPlace(box_xyxy_px=box))
        runs.append([mapped(stage.update(frame(gray, k / 30), NOTHING, STILL)) for k, (gray, _) in enumerate(frames)])
    for one, two in zip(*runs, strict=True):
        np.testing.assert_array_equal(one.image_to_ground, two.image_to_ground)
        np.testing.assert_array_equal(one.covariance, two.covariance)


def test_a_hidden_reference_is_lost_then_found_again_in_the_same_site_frame() -> None:
    gray, ground_to_image, box = seen(FOOTING)
    stage = ReferenceGround(FOOTING, place=GivenPlace(box_xyxy_px=box))
    before = mapped(stage.update(frame(gray, 0.0), NOTHING, STILL))
    hidden = np.random.default_rng(1).integers(60, 130, gray.shape).astype(np.uint8)
    assert reason(stage.update(frame(hidden, 0.1), NOTHING, STILL)) == LOST
    assert reason(stage.update(frame(hidden, 0.2), NOTHING, STILL)) == LOST
    after = mapped(stage.update(frame(gray, 0.3), NOTHING, STILL))
    point = homography.apply(ground_to_image, np.array([[3.0, 0.5]]))[0]
    np.testing.assert_allclose(after.to_ground(point)[0], before.to_ground(point)[0], atol=0.02)


def test_without_a_given_box_the_detector_says_where_and_following_bridges_its_rests() -> None:
    gray, _, box = seen(FOOTING)
    stage = ReferenceGround(FOOTING)
    assert reason(stage.update(frame(gray, 0.0), NOTHING, STILL)) == NOT_SEEN
    assert reason(stage.update(frame(gray, 0.1), detected(box, score=0.1), STILL)) == NOT_SEEN
    assert reason(stage.update(frame(gray, 0.2), detected(box, name="vehicle"), STILL)) == NOT_SEEN
    first = mapped(stage.update(frame(gray, 0.3), detected(box), STILL))
    rested = mapped(stage.update(frame(gray, 0.4), NOTHING, STILL))
    again = mapped(stage.update(frame(gray, 0.5), detected(box), STILL))
    for other in (rested, again):
        np.testing.assert_allclose(other.anchors_px, first.anchors_px, atol=0.3)


def test_a_second_reference_elsewhere_does_not_take_over() -> None:
    gray, _, box = seen(FOOTING, away_m=16.0)
    stage = ReferenceGround(FOOTING)
    first = mapped(stage.update(frame(gray, 0.0), detected(box), STILL))
    far = np.array([5.0, 5.0, 65.0, 65.0])
    both = Detections(np.stack([far, box]), np.array([0.99, 0.5]), np.full(2, CLASS_BY_NAME["reference"].id))
    second = mapped(stage.update(frame(gray, 0.1), both, STILL))
    np.testing.assert_allclose(second.anchors_px, first.anchors_px, atol=0.3)


def test_after_a_long_absence_the_site_frame_is_the_one_nearest_to_the_last_known() -> None:
    before, after = seen(FOOTING, yaw_deg=20.0), seen(FOOTING, yaw_deg=50.0)
    stage = ReferenceGround(FOOTING, camera=LENS)
    post = np.array([[4.0, 3.0]])
    first = mapped(stage.update(frame(before[0], 0.0), detected(before[2]), STILL))
    expected = first.to_ground(homography.apply(before[1], post)[0])[0]
    for time_s in (3.0, 6.0):
        flat = np.full_like(before[0], 90)
        assert reason(stage.update(frame(flat, time_s), NOTHING, STILL)) == LOST
    ground = mapped(stage.update(frame(after[0], 9.0), detected(after[2]), STILL))
    found = ground.to_ground(homography.apply(after[1], post)[0])[0]
    np.testing.assert_allclose(found, expected, atol=0.08)


def test_an_undetected_outline_keeps_being_followed_under_its_detections() -> None:
    gray, ground_to_image, box = seen(QUADRILATERAL)
    stage = ReferenceGround(QUADRILATERAL, camera=LENS)
    mapped(stage.update(frame(gray, 0.0), detected(box), STILL))
    left, top, right, bottom = box.astype(int)
    covered = gray.copy()
    covered[top : (top + bottom) // 2, left - 12 : right + 12] = 90
    for k in range(1, 4):
        assert not stage.update(frame(covered, k / 10), detected(box), STILL)
    ground = mapped(stage.update(frame(gray, 0.5), detected(box), STILL))
    found = ground.to_ground(homography.apply(ground_to_image, QUADRILATERAL.corners_m)[0])[0]
    np.testing.assert_allclose(found, QUADRILATERAL.corners_m, atol=0.02)


def test_a_hint_is_a_place_in_the_picture_as_the_lens_shows_it() -> None:
    shape = ReferenceShape.square(6.0)
    gray, ground_to_image, box = seen(shape, camera=WIDE)
    corners_px = WIDE.distort(homography.apply(ground_to_image, shape.corners_m)[0])
    for corner in range(4):
        stage = ReferenceGround(
            shape, place=GivenPlace(box_xyxy_px=box, first_corner_px=corners_px[corner]), camera=WIDE
        )
        ground = mapped(stage.update(frame(gray), NOTHING, STILL))
        np.testing.assert_allclose(ground.anchors_px[0], corners_px[corner], atol=0.3)


def test_a_shape_whose_corners_cannot_be_told_apart_is_not_guessed_at() -> None:
    shape = ReferenceShape.rectangle(2.8, 2.9)
    gray, ground_to_image, box = seen(shape)
    assert shape.turns_onto_itself() == (0, 2)
    assert (
        reason(ReferenceGround(shape, place=GivenPlace(box_xyxy_px=box)).update(frame(gray), NOTHING, STILL))
        == AMBIGUOUS
    )
    for corner in range(4):
        hint = homography.apply(ground_to_image, shape.corners_m)[0][corner] + 4.0
        stage = ReferenceGround(shape, place=GivenPlace(box_xyxy_px=box, first_corner_px=hint))
        for time_s in (0.0, 0.1):
            ground = mapped(stage.update(frame(gray, time_s), NOTHING, STILL))
            at = homography.apply(homography.invert(ground.image_to_ground), shape.corners_m[:1])[0][0]
            assert np.linalg.norm(at - hint) < 10.0


def test_an_outline_that_is_not_the_shape_is_refused() -> None:
    gray, _, box = seen(FOOTING)
    plank = ReferenceShape.rectangle(1.0, 4.0)
    for method in METHODS:
        stage = ReferenceGround(plank, ReferenceParams(method=method), place=GivenPlace(box_xyxy_px=box), camera=LENS)
        ground = stage.update(frame(gray), NOTHING, STILL)
        assert not ground
        if method != "oriented":  # which passes over what it cannot be, and finds nothing else
            assert reason(ground) == IMPLAUSIBLE


def test_a_box_is_used_at_its_time() -> None:
    gray, _, box = seen(FOOTING)
    stage = ReferenceGround(FOOTING, place=GivenPlace(box_xyxy_px=box, box_time_s=1.0))
    assert reason(stage.update(frame(gray, 0.0), NOTHING, STILL)) == NOT_YET
    assert stage.update(frame(gray, 1.0), NOTHING, STILL)
    late = ReferenceGround(FOOTING, place=GivenPlace(box_xyxy_px=box, box_time_s=1.0))
    with pytest.raises(GroundError, match="a frame at 1 s"):
        late.update(frame(gray, 3.0), NOTHING, STILL)


@pytest.mark.parametrize(
    ("box", "found"),
    [
        ([1.0, 2.0, 3.0], "[1.0, 2.0, 3.0]"),
        ([10.0, 10.0, 5.0, 20.0], "does not exceed"),
        ([10.0, 10.0, float("nan"), 20.0], "nan"),
    ],
)
def test_a_box_that_is_none_is_refused_at_once(box: list[float], found: str) -> None:
    with pytest.raises(GroundError) as caught:
        ReferenceGround(FOOTING, place=GivenPlace(box_xyxy_px=box))
    assert found in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_box_or_camera_that_does_not_fit_the_pictures_is_refused() -> None:
    gray, _, box = seen(FOOTING)
    with pytest.raises(GroundError, match="480x360"):
        ReferenceGround(FOOTING, place=GivenPlace(box_xyxy_px=box + 1000.0)).update(frame(gray), NOTHING, STILL)
    square_camera = Camera(400, 400, LENS.matrix, LENS.distortion)
    with pytest.raises(GroundError, match="400x400"):
        ReferenceGround(FOOTING, place=GivenPlace(box_xyxy_px=box), camera=square_camera).update(
            frame(gray), NOTHING, STILL
        )


def test_a_hint_goes_with_the_first_detection_too() -> None:
    shape = ReferenceShape.rectangle(2.8, 2.9)
    gray, ground_to_image, box = seen(shape)
    corners_px = homography.apply(ground_to_image, shape.corners_m)[0]
    for corner in range(4):
        stage = ReferenceGround(shape, place=GivenPlace(first_corner_px=corners_px[corner]))
        assert reason(stage.update(frame(gray), NOTHING, STILL)) == NOT_SEEN
        ground = mapped(stage.update(frame(gray, 0.1), detected(box), STILL))
        np.testing.assert_allclose(ground.anchors_px[0], corners_px[corner], atol=0.5)


def test_a_hint_lies_in_its_box() -> None:
    with pytest.raises(GroundError, match="first_corner_px x, y"):
        ReferenceGround(FOOTING, place=GivenPlace(first_corner_px=(5.0, float("nan"))))
    for bad in ((500.0, 5.0), (float("nan"), 5.0), (1.0, 2.0, 3.0)):
        with pytest.raises(GroundError, match="first_corner_px x, y"):
            ReferenceGround(FOOTING, place=GivenPlace(box_xyxy_px=(0.0, 0.0, 50.0, 50.0), first_corner_px=bad))


def test_eq_6_scale_is_metres_per_pixel_of_the_reference() -> None:
    gray, _, box = seen(FOOTING, tilt_deg=0.0, yaw_deg=0.0)
    ground = mapped(ReferenceGround(FOOTING, place=GivenPlace(box_xyxy_px=box)).update(frame(gray), NOTHING, STILL))
    # Straight down from 12 m with a focal length of 420 px: 35 px a metre.
    np.testing.assert_allclose(ground.scale_m_per_px, 1 / 35.0, rtol=REFERENCE_GROUND_REL)


def test_the_description_is_plain_and_says_what_was_configured() -> None:
    stage = ReferenceGround(
        FOOTING, ReferenceParams(method="paper"), place=GivenPlace(box_xyxy_px=(1, 2, 30, 40), first_corner_px=(2, 3))
    )
    record = json.loads(json.dumps(stage.describe()))
    assert record["params"]["method"] == "paper"
    assert record["box_xyxy_px"] == [1, 2, 30, 40]
    assert ReferenceGround(FOOTING).describe()["box_xyxy_px"] is None
