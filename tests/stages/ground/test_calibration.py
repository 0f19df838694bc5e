from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image
from tolerances import BOARD_CORNER_PX, CALIBRATED_FOCAL_REL, GEOMETRY_REL, SOLVED_TWICE_REL

from standoff.core.camera import Camera
from standoff.core.errors import GroundError, SourceError
from standoff.core.types import ImageArray
from standoff.stages.ground.boards import BoardView, find_corners, read_boards
from standoff.stages.ground.calibration import calibrate, calibrate_views
from standoff.stages.ground.camera_file import load_camera, save_camera

_CAMERA = Camera(
    800, 600, np.array([[900.0, 0, 410.0], [0, 905.0, 290.0], [0, 0, 1]]), np.array([-0.2, 0.05, 0.001, -0.001, 0.0])
)
_TILTS = [(0.3, 0.0), (-0.3, 0.1), (0.0, 0.4), (0.1, -0.4), (0.35, 0.3), (-0.2, -0.3)]


def photographed(
    name: str,
    tilt_x: float,
    tilt_y: float,
    square_m: float = 0.03,
    camera: Camera = _CAMERA,
    away_m: float = 0.8,
    aside: tuple[float, float] = (0.025, -0.0125),
) -> BoardView:
    """A 7x5 board as OpenCV projects it, its centre some way before the camera, and aside by a share of that way."""
    grid = np.stack(np.meshgrid(np.arange(7.0), np.arange(5.0)), axis=-1) * square_m
    space = np.concatenate([grid - grid.mean(axis=(0, 1)), np.zeros((5, 7, 1))], axis=-1).reshape(-1, 3)
    turn, shift = np.array([tilt_x, tilt_y, 0.1]), np.array([aside[0], aside[1], 1.0]) * away_m
    corners = cv2.projectPoints(space, turn, shift, camera.matrix, camera.distortion)[0]
    return BoardView(name, (800, 600), corners.reshape(5, 7, 2))


def drawn_board(columns: int, rows: int, square_px: int = 40, margin_px: int = 60) -> ImageArray:
    """A board seen from straight above; its first inner corner is at margin + square - 1/2."""
    squares = (np.indices((rows + 1, columns + 1)).sum(axis=0) % 2 * 255).astype(np.uint8)
    board: ImageArray = np.kron(squares, np.ones((square_px, square_px), np.uint8))
    return np.pad(board, margin_px, constant_values=255)


def test_exact_corners_give_the_exact_camera() -> None:
    views = [photographed(f"{i}.png", *tilt) for i, tilt in enumerate(_TILTS)]
    result = calibrate_views(views, square_m=0.03)
    np.testing.assert_allclose(result.camera.matrix, _CAMERA.matrix, rtol=CALIBRATED_FOCAL_REL)
    points_px = np.array([[200.0, 150.0], [600.0, 450.0], [400.0, 300.0]])
    np.testing.assert_allclose(result.camera.undistort(points_px), _CAMERA.undistort(points_px), atol=0.05)
    assert result.rms_px < 1e-3
    assert result.views_used == tuple(f"{i}.png" for i in range(len(_TILTS)))
    assert result.per_view_rms_px.shape == (len(_TILTS),)


def test_the_square_sets_no_pixel() -> None:
    views = [photographed(f"{i}.png", *tilt) for i, tilt in enumerate(_TILTS)]
    small, large = (calibrate_views(views, square_m=side).camera for side in (0.01, 1.0))
    np.testing.assert_allclose(small.matrix, large.matrix, rtol=CALIBRATED_FOCAL_REL)


def test_the_shared_photographs_give_the_shared_camera(shared_data: Path) -> None:
    result = calibrate(shared_data / "checkerboards", (9, 6), 0.025)
    known = load_camera(shared_data / "checkerboards" / "left_intrinsics.yml")
    assert len(result.views_used) == 13
    assert result.views_failed == ()
    # The known camera explains its own corners to 0.39 px (one of its views to 1.18), so it is no better than that.
    assert result.rms_px < 0.2
    assert result.per_view_rms_px.max() < 0.3
    assert result.camera.matrix[0, 0] == pytest.approx(known.matrix[0, 0], rel=0.01)
    assert abs(result.camera.matrix[:2, 2] - known.matrix[:2, 2]).max() < 3.0
    where_corners_are_px = np.array([[150.0, 100.0], [500.0, 100.0], [500.0, 380.0], [150.0, 380.0], [320.0, 240.0]])
    rays = [(c.undistort(where_corners_are_px) - c.matrix[:2, 2]) / c.matrix[0, 0] for c in (known, result.camera)]
    assert np.degrees(np.abs(rays[0] - rays[1]).max()) < 0.5


def test_corners_of_a_drawn_board_are_found_where_they_were_drawn() -> None:
    corners_px = find_corners(drawn_board(7, 5), (7, 5))
    x, y = np.meshgrid(60 + 40 * np.arange(1, 8) - 0.5, 60 + 40 * np.arange(1, 6) - 0.5)
    drawn_px = np.stack([x, y], axis=-1)
    error_px = min(np.abs(corners_px - drawn_px).max(), np.abs(corners_px[::-1, ::-1] - drawn_px).max())
    assert error_px < BOARD_CORNER_PX


def test_a_picture_without_the_board_is_told_apart(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "a.png"), drawn_board(7, 5))
    cv2.imwrite(str(tmp_path / "b.png"), np.full((300, 400), 128, np.uint8))
    (tmp_path / "notes.txt").write_text("not a picture")
    with_board, without = read_boards(tmp_path, (7, 5))
    assert (with_board.name, with_board.found, with_board.image_size_px) == ("a.png", True, (440, 360))
    assert (without.name, without.found, without.corners_px.shape) == ("b.png", False, (0, 0, 2))


def test_failed_views_are_listed() -> None:
    views = [photographed(f"{i}.png", *tilt) for i, tilt in enumerate(_TILTS)]
    views.insert(2, BoardView("blurred.png", (800, 600), np.zeros((0, 0, 2))))
    result = calibrate_views(views, square_m=0.03)
    assert result.views_failed == ("blurred.png",)
    assert "blurred.png" not in result.views_used


def test_the_camera_file_can_carry_how_good_the_calibration_is(tmp_path: Path) -> None:
    views = [photographed(f"{i}.png", *tilt) for i, tilt in enumerate(_TILTS)]
    result = calibrate_views(views, square_m=0.03)
    save_camera(result.camera, tmp_path / "camera.yaml", calibration=result.to_dict())
    assert (tmp_path / "camera.yaml").read_text().count(".png") == len(_TILTS)
    np.testing.assert_array_equal(load_camera(tmp_path / "camera.yaml").matrix, result.camera.matrix)


def ground_error(views: list[BoardView], square_m: float = 0.03) -> str:
    with pytest.raises(GroundError) as caught:
        calibrate_views(views, square_m)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_views_that_do_not_determine_the_camera_are_refused_in_one_line() -> None:
    good = [photographed(f"{i}.png", *tilt) for i, tilt in enumerate(_TILTS)]
    missing = BoardView("missing.png", (800, 600), np.zeros((0, 0, 2)))
    assert "found it in 2 of 3" in ground_error([*good[:2], missing])
    assert "found it in 0 of 2" in ground_error([missing, missing])
    others = [BoardView(f"turned {i}.png", (600, 800), good[0].corners_px) for i in range(2)]
    assert "600x800 (turned 0.png)" in ground_error([*good[:3], *others])
    assert "positive side" in ground_error(good, square_m=0.0)
    assert "0.025 mm, likely in metres" in ground_error(good, square_m=0.025e-3)
    assert "25000 mm, likely in micrometres" in ground_error(good, square_m=25.0)


def test_photographs_of_another_size_are_left_out_by_name() -> None:
    good = [photographed(f"{i}.png", *tilt) for i, tilt in enumerate(_TILTS)]
    odd = BoardView("odd.png", (801, 601), good[0].corners_px)
    result = calibrate_views([odd, *good])
    np.testing.assert_allclose(result.camera.matrix, calibrate_views(good).camera.matrix, rtol=GEOMETRY_REL)
    assert (result.views_of_other_size, len(result.views_used)) == (("odd.png",), len(good))
    assert any("odd.png (801x601)" in warning for warning in result.warnings)
    assert not any("left out" in warning for warning in calibrate_views(good).warnings)


def test_corners_in_a_wrong_order_are_refused_whatever_the_lens_would_be() -> None:
    for seed in range(3):
        rng = np.random.default_rng(seed)
        views = []
        for i, tilt in enumerate(_TILTS):
            corners_px = photographed(f"{i}.png", *tilt).corners_px
            row, column = rng.integers(0, 2), rng.integers(0, 4)
            # As where a pattern of 4 x 4 is looked for and some part of the board is found, some way round.
            part = corners_px[row : row + 4, column : column + 4]
            mixed = part[rng.permutation(4)] if i % 2 else part
            views.append(BoardView(f"{i}.png", (800, 600), mixed))
        assert "check the pattern" in ground_error(views).lower()


@pytest.mark.parametrize(
    ("matrix", "found"),
    [
        ([[900.0, 0, 400], [0, 1800.0, 300], [0, 0, 1]], "fx 900, fy 1800"),
        ([[900.0, 0, 700], [0, 900.0, 300], [0, 0, 1]], "it at 700, 300"),
    ],
)
def test_a_camera_that_nobody_builds_is_refused(matrix: list[list[float]], found: str) -> None:
    unlikely = Camera(800, 600, np.array(matrix), np.zeros(5))
    views = [photographed(f"{i}.png", *tilt, camera=unlikely) for i, tilt in enumerate(_TILTS)]
    assert found in ground_error(views)


def test_a_fisheye_is_told_by_the_corners_that_no_usual_lens_explains() -> None:
    matrix, distortion = np.array([[260.0, 0, 400], [0, 260.0, 300], [0, 0, 1]]), np.array([-0.02, 0.01, -0.004, 0.001])
    rng, views = np.random.default_rng(0), []
    grid = np.stack(np.meshgrid(np.arange(7.0) - 3.0, np.arange(5.0) - 2.0, [0.0]), axis=-1).reshape(-1, 1, 3) * 0.03
    for i in range(24):
        angle, off = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(0.0, 1.1)
        shift = 0.35 * np.array([np.sin(off) * np.cos(angle), np.sin(off) * np.sin(angle), np.cos(off)])
        seen = cv2.fisheye.projectPoints(grid, rng.uniform(-0.4, 0.4, 3), shift, matrix, distortion)[0]
        views.append(BoardView(f"{i}.png", (800, 600), seen.reshape(5, 7, 2) + rng.normal(0.0, 0.1, (5, 7, 2))))
    assert "as a fisheye" in ground_error(views)


def test_what_the_boards_do_not_cover_is_said() -> None:
    views = [photographed(f"{i}.png", *tilt, away_m=2.5) for i, tilt in enumerate(_TILTS)]
    assert any(
        "of the picture: the distortion beyond is a guess" in warning for warning in calibrate_views(views).warnings
    )


def test_photographs_are_taken_as_the_sensor_has_them(tmp_path: Path) -> None:
    picture = Image.fromarray(drawn_board(7, 5))
    turned = Image.Exif()
    turned[0x0112] = 6
    picture.save(tmp_path / "held upright.jpg", exif=turned, quality=95)
    picture.save(tmp_path / "held level.jpg", quality=95)
    level, upright = read_boards(tmp_path, (7, 5))
    assert level.image_size_px == upright.image_size_px == (440, 360)
    np.testing.assert_array_equal(level.corners_px, upright.corners_px)


def turned_over(view: BoardView, *, mirrored: bool) -> BoardView:
    """The same photograph, mirrored or upside down, as the finder would find the board in it."""
    width_px, height_px = view.image_size_px
    corners_px = view.corners_px * ([-1.0, 1.0] if mirrored else -1.0)
    corners_px = corners_px + ([width_px - 1, 0] if mirrored else [width_px - 1, height_px - 1])
    return replace(view, corners_px=corners_px[:, ::-1] if mirrored else corners_px[::-1, ::-1])


def noisy(views: list[BoardView], sigma_px: float, seed: int = 0) -> list[BoardView]:
    rng = np.random.default_rng(seed)
    return [replace(v, corners_px=v.corners_px + rng.normal(0.0, sigma_px, v.corners_px.shape)) for v in views]


def many(camera: Camera = _CAMERA, count: int = 12, seed: int = 0) -> list[BoardView]:
    """Photographs in which the boards lie all over the picture."""
    rng, views = np.random.default_rng(seed), []
    reach = 0.3 * np.array([800.0, 600.0]) / np.diag(camera.matrix)[:2]
    for i in range(count):
        corner = np.array([(-1.0) ** i, (-1.0) ** (i // 2)]) * rng.uniform(0.3, 1.0, 2) * reach
        aside = float(corner[0]), float(corner[1])
        tilt_x, tilt_y = rng.uniform(-0.5, 0.5, 2).tolist()
        views.append(
            photographed(f"{i:02}.png", tilt_x, tilt_y, camera=camera, away_m=5e-4 * camera.matrix[0, 0], aside=aside)
        )
    return views


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("sigma_px", [0.05, 0.3])
def test_photographs_of_one_camera_agree_on_it(seed: int, sigma_px: float) -> None:
    wide = Camera(
        800, 600, np.array([[500.0, 0, 430.0], [0, 500.0, 280.0], [0, 0, 1]]), np.array([-0.3, 0.1, 0, 0, -0.02])
    )
    for camera in (_CAMERA, wide):
        result = calibrate_views(noisy(many(camera, seed=seed), sigma_px, seed), square_m=0.03)
        assert result.camera.matrix[0, 0] == pytest.approx(camera.matrix[0, 0], rel=0.02)
        assert not result.views_repeated


@pytest.mark.parametrize(
    ("factor", "zoomed"), [(1.1, {0, 2, 4, 6, 8}), (1.25, {0, 2, 4, 6, 8}), (2.0, {0, 2, 4}), (1.25, {4})]
)
def test_two_zooms_in_one_set_are_refused_and_the_photographs_named(factor: float, zoomed: set[int]) -> None:
    to_middle = np.array([[1.0, 0, -399.5], [0, 1.0, -299.5], [0, 0, 1.0]])
    zoom = np.linalg.inv(to_middle) @ np.diag([factor, factor, 1.0]) @ to_middle
    other = Camera(800, 600, zoom @ _CAMERA.matrix, _CAMERA.distortion)
    views = [one if i in zoomed else two for i, (one, two) in enumerate(zip(many(other), many(), strict=True))]
    message = ground_error(noisy(views, 0.1))
    # Two zooms far apart leave so much that nothing explains them.
    if "root mean square" not in message:
        longer = message.split("focal length, likely, in ")[1].split(" than in ")[0]
        assert longer == ", ".join(f"{i:02}.png" for i in sorted(zoomed))
    assert factor == 2.0 or "root mean square" not in message


@pytest.mark.parametrize("mirrored", [True, False])
def test_mirrored_photographs_and_those_upside_down_are_named(mirrored: bool) -> None:
    lens = Camera(800, 600, np.array([[900.0, 0, 425.0], [0, 900.0, 285.0], [0, 0, 1]]), _CAMERA.distortion)
    views = noisy(many(lens), 0.1)
    views[::3] = [turned_over(view, mirrored=mirrored) for view in views[::3]]
    message = ground_error(views)
    assert ("mirrored" if mirrored else "upside down") in message
    assert " 00.png, 03.png, 06.png, 09.png, or all others" in message


def test_a_photograph_counts_once_however_often_it_is_there() -> None:
    views = noisy(many(count=5), 0.1)
    copies = [replace(view, name=f"copy of {view.name}") for view in views]
    turned = [replace(v, name=f"again {v.name}", corners_px=v.corners_px[::-1, ::-1] + 0.1) for v in views[:2]]
    once, often = calibrate_views(views, 0.03), calibrate_views([*views, *copies, *turned], 0.03)
    np.testing.assert_allclose(once.camera.matrix, often.camera.matrix, rtol=SOLVED_TWICE_REL)
    assert often.focal_sigma_px == pytest.approx(once.focal_sigma_px, rel=SOLVED_TWICE_REL)
    assert often.views_repeated == tuple(view.name for view in [*copies, *turned])
    assert any("copy of 00.png" in warning for warning in often.warnings)
    assert "found 2, and copies of them" in ground_error([*views[:2], *copies[:2]])


def test_stretched_photographs_are_refused() -> None:
    stretched = [replace(v, image_size_px=(800, 804), corners_px=v.corners_px * [1.0, 1.34]) for v in many()]
    assert "square pixels" in ground_error(stretched)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("tilt", [(0.0, 0.0), (0.3, 0.0)])
def test_views_that_are_all_alike_are_refused(seed: int, tilt: tuple[float, float]) -> None:
    rng, view = np.random.default_rng(seed), photographed("same.png", *tilt)
    alike = [BoardView("same.png", (800, 600), view.corners_px + rng.normal(0, 0.1, (5, 7, 2))) for _ in range(4)]
    assert "tilted to different sides" in ground_error(alike)


def test_photographs_that_cannot_be_read_are_refused_in_one_line(tmp_path: Path) -> None:
    with pytest.raises(SourceError, match="which is not there"):
        calibrate(tmp_path / "missing")
    with pytest.raises(SourceError, match="found none in"):
        calibrate(tmp_path)
    with pytest.raises(SourceError, match="found none"):
        calibrate([])
    with pytest.raises(SourceError, match="at least 3x3"):
        calibrate(tmp_path, (2, 6))
    (tmp_path / "broken.jpg").write_bytes(b"\xff\xd8\xff\xe0 not a picture")
    with pytest.raises(SourceError, match=r"broken\.jpg, which cannot be decoded"):
        calibrate(tmp_path)
    (tmp_path / "broken.jpg").write_bytes(b"")
    with pytest.raises(SourceError, match="cannot be decoded"):
        calibrate(tmp_path)
    with pytest.raises(SourceError, match="which is a file"):
        calibrate(tmp_path / "broken.jpg")
    with pytest.raises(SourceError, match="No such file"):
        calibrate([tmp_path / "gone.png"])
