from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from standoff.core.errors import DataError
from standoff_sim.composites.backgrounds import Background
from standoff_sim.composites.framing import Framed, frame

_SIZE_PX = (320, 180)
_MARK_PX = np.array([[560.0, 300.0, 660.0, 340.0]])


def _background(path: Path, pitch_deg: float = 90.0, px_per_m: float | None = 20.0) -> Background:
    return Background(path, "flight", pitch_deg, px_per_m, ("noon",), 30.0, _MARK_PX, np.array([5]), np.empty((0, 4)))


@pytest.fixture(scope="module")
def photo(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A grey photograph with a red rectangle where the mark is."""
    image = np.full((675, 1200, 3), 120, np.uint8)
    left, top, right, bottom = np.rint(_MARK_PX[0]).astype(int).tolist()
    image[top : bottom + 1, left : right + 1] = (0, 0, 255)
    path = tmp_path_factory.mktemp("photo") / "p.png"
    cv2.imwrite(str(path), image)
    return path


def _red_box(framed: Framed) -> np.ndarray[tuple[int], np.dtype[np.float64]] | None:
    rows, columns = np.nonzero(framed.image[..., 2].astype(int) - framed.image[..., 0] > 120)
    if not len(rows):
        return None
    return np.array([columns.min() - 0.5, rows.min() - 0.5, columns.max() + 0.5, rows.max() + 0.5])


@pytest.mark.parametrize("pitch_deg", [90.0, 50.0])
def test_a_mark_stays_on_what_it_marks(photo: Path, pitch_deg: float) -> None:
    seen = 0
    for seed in range(40):
        framed = frame(np.random.default_rng(seed), _background(photo, pitch_deg), _SIZE_PX)
        red = _red_box(framed)
        for box in framed.xyxy_px:
            assert red is not None
            np.testing.assert_allclose(box, red, atol=1.5 + 0.6 * framed.zoom)
            seen += 1
    assert seen >= 8


def test_the_same_generator_gives_the_same_picture(photo: Path) -> None:
    first, second = (frame(np.random.default_rng(7), _background(photo), _SIZE_PX) for _ in range(2))
    assert (first.image == second.image).all() and first.zoom == second.zoom
    assert (first.view.position_m == second.view.position_m).all()


@pytest.mark.parametrize("px_per_m", [8.0, 20.0, None])
def test_the_ground_has_the_photographs_scale_within_its_error(photo: Path, px_per_m: float | None) -> None:
    for seed in range(10):
        framed = frame(np.random.default_rng(seed), _background(photo, px_per_m=px_per_m), _SIZE_PX)
        camera = framed.view.camera
        middle_px = np.array([[camera.width_px - 1, camera.height_px - 1]]) / 2
        away_m = float(np.linalg.norm(np.append(framed.view.to_plane(middle_px)[0], 0.0) - framed.view.position_m))
        scale = camera.matrix[0, 0] / away_m / framed.zoom
        low, high = (px_per_m / 1.26, px_per_m * 1.26) if px_per_m else (1200 * 0.006 / 1.26, 1200 * 0.02 * 1.26)
        assert low <= scale <= high


def test_shadows_turn_with_the_photograph(photo: Path) -> None:
    found = {frame(np.random.default_rng(seed), _background(photo), _SIZE_PX).shadow_deg for seed in range(12)}
    assert found == {30.0, -30.0}


def test_a_file_that_is_no_picture_is_refused(tmp_path: Path) -> None:
    (tmp_path / "p.jpg").write_text("not a picture")
    with pytest.raises(DataError, match=r"a picture in .*p\.jpg"):
        frame(np.random.default_rng(0), _background(tmp_path / "p.jpg"), _SIZE_PX)
