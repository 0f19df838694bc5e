from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import pytest
from tolerances import GROUND_THROUGH_LENS_M, SURVEY_COVERAGE, SURVEY_SIGMA_REL

from standoff.core import homography
from standoff.core.camera import Camera
from standoff.core.errors import GroundError
from standoff.core.homography import FloatArray
from standoff.core.types import Detections, Frame, GroundMap, ImageArray, Luma, NoCameraMotion, NoGroundMap
from standoff.stages.frames.pictures import halved
from standoff.stages.ground.surveyed_ground import SurveyedGround

STILL = NoCameraMotion("not estimated")

_SIZE = (1280, 720)
_MATRIX = np.array([[1000.0, 0, 640.0], [0, 1000.0, 360.0], [0, 0, 1]])
LENS = Camera(1280, 720, _MATRIX, np.array([-0.25, 0.06, 0.001, -0.0005, 0.01]))
_PLAIN_LENS = Camera(1280, 720, _MATRIX, np.zeros(5))
_POINTS_M = np.array([[-6.0, 14], [6, 14], [8, 32], [-9, 30], [0, 20], [3, 26], [-4, 24], [5, 18]])
_PAIR_M = np.array([[-2.0, 17.0], [4.0, 27.0]])


@dataclass(frozen=True)
class _Blank:
    """A picture that only has a size."""

    width_px: int
    height_px: int

    def bgr(self) -> ImageArray:
        return np.zeros((self.height_px, self.width_px, 3), np.uint8)

    def resized_bgr(self, width_px: int, height_px: int) -> ImageArray:
        return np.zeros((height_px, width_px, 3), np.uint8)

    def gray(self) -> ImageArray:
        return np.zeros((self.height_px, self.width_px), np.uint8)

    def luma(self) -> Luma:
        return self.gray()

    def halved_gray(self, times: int) -> ImageArray:
        return halved(self.gray(), times)


def blank_frame(width_px: int, height_px: int, index: int = 0) -> Frame:
    return Frame("test", index, index / 10.0, _Blank(width_px, height_px))


def seen(points_m: FloatArray, camera: Camera) -> FloatArray:
    """The points as OpenCV photographs them from 12 m up, 60 degrees off the vertical, looking north."""
    tilt = np.radians(60.0)
    rotation = np.array([[1, 0, 0], [0, -np.cos(tilt), -np.sin(tilt)], [0, np.sin(tilt), -np.cos(tilt)]])
    shift = -rotation @ np.array([0.0, 0.0, 12.0])
    space = np.column_stack([points_m, np.zeros(len(points_m))])
    projected = cv2.projectPoints(space, cv2.Rodrigues(rotation)[0], shift, camera.matrix, camera.distortion)[0]
    return np.asarray(projected[:, 0], dtype=np.float64)


def updated(ground: SurveyedGround, width_px: int = _SIZE[0], height_px: int = _SIZE[1]) -> GroundMap:
    result = ground.update(blank_frame(width_px, height_px), Detections.empty(), STILL)
    assert isinstance(result, GroundMap)
    return result


def refusal(*arguments: Any, **keywords: Any) -> str:
    with pytest.raises(GroundError) as caught:
        SurveyedGround(*arguments, **keywords)
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("count", [4, 5, 8])
@pytest.mark.parametrize("camera", [_PLAIN_LENS, LENS], ids=["pinhole", "lens"])
def test_exact_points_give_the_exact_map(count: int, camera: Camera) -> None:
    points_m = _POINTS_M[:count]
    ground = SurveyedGround(seen(points_m, camera), points_m, _SIZE, camera=camera)
    elsewhere_m = np.array([[1.0, 15.0], [-7.0, 29.0], [2.0, 40.0]])
    mapped, valid = updated(ground).to_ground(seen(elsewhere_m, camera))
    assert valid.all()
    np.testing.assert_allclose(mapped, elsewhere_m, atol=10 * GROUND_THROUGH_LENS_M)
    assert ground.describe()["rms_m"] < GROUND_THROUGH_LENS_M
    assert ground.describe()["warnings"] == []


def test_forgetting_the_lens_shows_in_the_residuals() -> None:
    with_lens = SurveyedGround(seen(_POINTS_M, LENS), _POINTS_M, _SIZE, camera=LENS)
    without = SurveyedGround(seen(_POINTS_M, LENS), _POINTS_M, _SIZE)
    assert without.describe()["rms_px"] > 100 * with_lens.describe()["rms_px"]
    assert without.describe()["lens_distortion_removed"] is False


def test_the_fit_has_the_least_reprojection_error() -> None:
    rng = np.random.default_rng(3)
    noisy_px = seen(_POINTS_M, _PLAIN_LENS) + rng.normal(0, 2.0, (8, 2))
    fit = SurveyedGround(noisy_px, _POINTS_M, _SIZE).fit
    ours = (fit.residuals_px**2).sum()
    # The reference: OpenCV's own Levenberg-Marquardt on the same distances, in float32.
    opencv = cv2.findHomography(_POINTS_M, noisy_px, 0)[0]
    assert ours <= ((homography.apply(opencv, _POINTS_M)[0] - noisy_px) ** 2).sum() * (1 + 1e-6)
    back = homography.invert(fit.image_to_ground)
    for entry in range(9):
        for sign in (-1.0, 1.0):
            nudged = back.ravel().copy()
            nudged[entry] *= 1.0 + sign * 1e-5
            changed = homography.apply(nudged.reshape(3, 3), _POINTS_M)[0]
            assert ((changed - noisy_px) ** 2).sum() >= ours


def test_the_residuals_are_those_of_the_map() -> None:
    rng = np.random.default_rng(4)
    noisy_px = seen(_POINTS_M, _PLAIN_LENS) + rng.normal(0, 1.0, (8, 2))
    ground = SurveyedGround(noisy_px, _POINTS_M, _SIZE)
    current = updated(ground)
    np.testing.assert_allclose(ground.fit.residuals_m, current.to_ground(noisy_px)[0] - _POINTS_M, atol=1e-9)
    np.testing.assert_allclose(ground.fit.residuals_px, noisy_px - current.to_image(_POINTS_M)[0], atol=1e-6)
    rows = ground.describe()["points"]
    assert [row["residual_px"] for row in rows] == pytest.approx(np.linalg.norm(ground.fit.residuals_px, axis=1))
    assert ground.describe()["rms_m"] == pytest.approx(np.sqrt((ground.fit.residuals_m**2).sum(axis=1).mean()))
    assert json.loads(json.dumps(ground.describe())) == ground.describe()


def distance_and_sigma(current: GroundMap, pair_px: FloatArray) -> tuple[float, float]:
    ends_m = current.to_ground(pair_px)[0]
    distance_m = float(np.linalg.norm(ends_m[1] - ends_m[0]))
    by_entries = homography.parameter_jacobian(current.image_to_ground, current.undistorted(pair_px))
    slope = (ends_m[1] - ends_m[0]) / distance_m @ (by_entries[1] - by_entries[0])
    return distance_m, float(np.sqrt(slope @ current.covariance[:9, :9] @ slope))


@pytest.mark.live
@pytest.mark.parametrize("count", [4, 8])
def test_the_stated_click_accuracy_carries_to_the_distances(count: int) -> None:
    rng, sigma_px, points_m = np.random.default_rng(count), 0.5, _POINTS_M[:count]
    exact_px, pair_px = seen(points_m, _PLAIN_LENS), seen(_PAIR_M, _PLAIN_LENS)
    exact = SurveyedGround(exact_px, points_m, _SIZE, point_sigma_px=sigma_px)
    _, sigma_m = distance_and_sigma(updated(exact), pair_px)
    trials = [SurveyedGround(exact_px + rng.normal(0, sigma_px, (count, 2)), points_m, _SIZE) for _ in range(400)]
    distances = [distance_and_sigma(updated(trial), pair_px)[0] for trial in trials]
    assert sigma_m == pytest.approx(np.std(distances), rel=SURVEY_SIGMA_REL)


@pytest.mark.live
def test_worse_clicks_than_stated_are_seen_from_the_scatter() -> None:
    rng, sigma_px = np.random.default_rng(7), 3.0
    exact_px, pair_px = seen(_POINTS_M, _PLAIN_LENS), seen(_PAIR_M, _PLAIN_LENS)
    truth_m = np.hypot(6.0, 10.0)
    covered = 0
    for _ in range(300):
        ground = SurveyedGround(exact_px + rng.normal(0, sigma_px, (8, 2)), _POINTS_M, _SIZE)
        distance_m, sigma_m = distance_and_sigma(updated(ground), pair_px)
        covered += abs(distance_m - truth_m) < 1.96 * sigma_m
    assert covered / 300 > SURVEY_COVERAGE


def test_the_covariance_never_claims_more_than_the_stated_accuracy() -> None:
    exact_px = seen(_POINTS_M, _PLAIN_LENS)
    fine, coarse = (SurveyedGround(exact_px, _POINTS_M, _SIZE, point_sigma_px=sigma).fit for sigma in (0.5, 2.0))
    assert [fine.sigma_px, coarse.sigma_px] == pytest.approx([0.5, 2.0])
    np.testing.assert_allclose(coarse.covariance, 16.0 * fine.covariance, rtol=1e-6)


def test_map_coordinates_far_from_the_origin_change_no_distance_and_no_error() -> None:
    far_m = np.array([458_000.0, 5_950_000.0])
    rng = np.random.default_rng(11)
    noisy_px = seen(_POINTS_M, _PLAIN_LENS) + rng.normal(0, 1.0, (8, 2))
    pair_px = seen(_PAIR_M, _PLAIN_LENS)
    near = distance_and_sigma(updated(SurveyedGround(noisy_px, _POINTS_M, _SIZE)), pair_px)
    far = distance_and_sigma(updated(SurveyedGround(noisy_px, _POINTS_M + far_m, _SIZE)), pair_px)
    assert far == pytest.approx(near, rel=1e-4)


@pytest.mark.parametrize("wrong", range(8))
def test_the_worst_point_is_named(wrong: int) -> None:
    moved_px = seen(_POINTS_M, _PLAIN_LENS)
    moved_px[wrong] += np.array([40.0, -30.0]) * (1 if moved_px[wrong, 0] < 600 else -1)
    ground = SurveyedGround(moved_px, _POINTS_M, _SIZE, names=tuple("abcdefgh"))
    (warning,) = ground.describe()["warnings"]
    assert warning.endswith(f"most likely wrong: {'abcdefgh'[wrong]!r}")


def test_mirrored_metres_get_a_warning() -> None:
    ground = SurveyedGround(seen(_POINTS_M, _PLAIN_LENS), _POINTS_M * [1, -1], _SIZE)
    assert "mirrored" in ground.describe()["warnings"][0]


def test_the_scale_is_metres_per_pixel_at_the_middle_of_the_points() -> None:
    points_px = np.array([[100.0, 100.0], [500.0, 100.0], [500.0, 300.0], [100.0, 300.0]])
    ground = SurveyedGround(points_px, points_px * [0.02, -0.02], _SIZE)
    assert updated(ground).scale_m_per_px == pytest.approx(0.02)


def test_every_frame_gets_the_same_map() -> None:
    ground = SurveyedGround(seen(_POINTS_M, LENS), _POINTS_M, _SIZE, camera=LENS)
    maps = [ground.update(blank_frame(*_SIZE, index), Detections.empty(), STILL) for index in range(3)]
    assert all(one is maps[0] for one in maps)
    np.testing.assert_array_equal(updated(ground).anchors_px, seen(_POINTS_M, LENS))
    assert updated(ground).method == "surveyed"
    assert updated(ground).age_s == 0.0


@pytest.mark.parametrize("factor", [0.5, 3.0])
def test_a_frame_of_another_size_gets_the_map_scaled_to_it(factor: float) -> None:
    area_px = [[100, 300], [1200, 300], [1200, 700], [100, 700]]
    ground = SurveyedGround(seen(_POINTS_M, LENS), _POINTS_M, _SIZE, camera=LENS, area_px=area_px)
    pair_px = seen(_PAIR_M, LENS)
    resized_px = (pair_px + 0.5) * factor - 0.5
    surveyed, scaled = updated(ground), updated(ground, int(_SIZE[0] * factor), int(_SIZE[1] * factor))
    np.testing.assert_allclose(scaled.to_ground(resized_px)[0], surveyed.to_ground(pair_px)[0], atol=1e-7)
    expected, found = distance_and_sigma(surveyed, pair_px), distance_and_sigma(scaled, resized_px)
    assert found == pytest.approx(expected, rel=1e-6)
    assert scaled.scale_m_per_px == pytest.approx(surveyed.scale_m_per_px / factor)
    np.testing.assert_allclose(scaled.valid_px, (surveyed.valid_px + 0.5) * factor - 0.5)
    assert updated(ground) is surveyed


def test_a_frame_of_another_shape_has_no_map() -> None:
    ground = SurveyedGround(seen(_POINTS_M, LENS), _POINTS_M, _SIZE)
    result = ground.update(blank_frame(1280, 960), Detections.empty(), STILL)
    assert isinstance(result, NoGroundMap)
    assert result.reason == "picture size differs from the survey"


def test_the_camera_may_be_calibrated_at_another_size() -> None:
    double = LENS.scaled_to(2560, 1440)
    points_px = seen(_POINTS_M, LENS)
    one, other = (SurveyedGround(points_px, _POINTS_M, _SIZE, camera=camera) for camera in (LENS, double))
    np.testing.assert_allclose(one.fit.image_to_ground, other.fit.image_to_ground, rtol=1e-9)


def test_the_trusted_area_bends_with_the_lens() -> None:
    area_px = np.array([[10.0, 300.0], [1270.0, 300.0], [1270.0, 710.0], [10.0, 710.0]])
    plain = updated(SurveyedGround(seen(_POINTS_M, _PLAIN_LENS), _POINTS_M, _SIZE, area_px=area_px))
    np.testing.assert_array_equal(plain.valid_px, area_px)
    bent = updated(SurveyedGround(seen(_POINTS_M, LENS), _POINTS_M, _SIZE, camera=LENS, area_px=area_px))
    assert len(bent.valid_px) > len(area_px)
    outline_px = LENS.distort(bent.valid_px)
    on_side = np.abs(outline_px[:, :, None] - [[[10.0, 1270.0], [300.0, 710.0]]]).min(axis=(1, 2))
    assert on_side.max() < 1e-6


_SQUARE_PX = [[100, 100], [500, 100], [500, 400], [100, 400]]
_SQUARE_M = [[0, 3], [4, 3], [4, 0], [0, 0]]


@pytest.mark.parametrize(
    ("points_px", "points_m", "message"),
    [
        (_SQUARE_PX[:3], _SQUARE_M[:3], "expected four or more points, each with px and m, found 3"),
        ([], [], "found 0"),
        (_SQUARE_PX, _SQUARE_M[:3], "found 4 px and 3 m"),
        ([[100, 100], [500, 100], [500, float("nan")], [100, 400]], _SQUARE_M, "finite points_px"),
        (_SQUARE_PX, [[0, 3], [4, float("inf")], [4, 0], [0, 0]], "finite points_m"),
        ([[1, 2, 3]] * 4, _SQUARE_M, "points_px of shape (N, 2)"),
        (["a", "b", "c", "d"], _SQUARE_M, "each with px and m"),
        ([[100, 100], [100, 100], [500, 400], [100, 400]], _SQUARE_M, "'point 1' and 'point 2' at the same place"),
        (_SQUARE_PX, [[0, 3], [4, 3], [4, 0], [4, 0]], "'point 3' and 'point 4' at the same place"),
        (
            [[100, 100], [300, 100], [500, 100], [100, 400]],
            _SQUARE_M,
            "'point 2', 'point 3' on one line (px)",
        ),
        (_SQUARE_PX, [[0, 0], [1, 1], [2, 2.001], [5, 0]], "'point 1', 'point 2', 'point 3' on one line (m)"),
        ([[100, 100], [200, 200], [300, 300], [400, 400]], _SQUARE_M, "on one line (px)"),
        (_SQUARE_PX, [[0, 3], [4, 3], [0, 0], [4, 0]], "beyond the horizon"),
        ([[100, 100], [1500, 100], [500, 400], [100, 400]], _SQUARE_M, "'point 2' at 1500, 100"),
    ],
)
def test_points_that_define_no_map_are_refused_in_one_line(points_px: Any, points_m: Any, message: str) -> None:
    assert message in refusal(points_px, points_m, _SIZE)


def test_five_points_of_which_four_are_on_a_line_are_refused() -> None:
    on_line = [[100 + 90 * i, 120 + 30 * i] for i in range(4)]
    assert "on one line (px)" in refusal([*on_line, [600, 600]], [[0, 0], [1, 0], [2, 0.5], [3, 0], [2, 3]], _SIZE)


def test_other_wrong_arguments_are_refused_in_one_line() -> None:
    assert "positive point_sigma_px" in refusal(_SQUARE_PX, _SQUARE_M, _SIZE, point_sigma_px=0.0)
    assert "one name a point" in refusal(_SQUARE_PX, _SQUARE_M, _SIZE, names=("a",))
    assert "area_px" in refusal(_SQUARE_PX, _SQUARE_M, _SIZE, area_px=[[1, 2], [3, 4]])
    assert "aspect ratio" in refusal(_SQUARE_PX, _SQUARE_M, (640, 480), camera=LENS)
    blind = Camera(1280, 720, LENS.matrix, np.array([-3.0, 0, 0, 0, 0]))
    assert "distortion has no inverse" in refusal(_SQUARE_PX, _SQUARE_M, _SIZE, camera=blind)
