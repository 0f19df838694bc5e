from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import ExifTags, Image, ImageOps
from stages.frames.coded_video import coded_picture, index_in
from tolerances import RESIZED_LEVELS

from standoff.core.errors import FrameSizeChanged, SourceError
from standoff.stages.frames import open_source


def fill(folder: Path, count: int, suffix: str = ".png") -> Path:
    folder.mkdir(exist_ok=True)
    for index in range(count):
        cv2.imwrite(str(folder / f"shot{index}{suffix}"), coded_picture(index))
    return folder


def write_turned(path: Path, orientation: int | None) -> Path:
    """Write a smooth picture and what its EXIF data say of how it lies."""
    exif = Image.Exif()
    if orientation is not None:
        exif[ExifTags.Base.Orientation] = orientation
    smooth = cv2.GaussianBlur(coded_picture(1, 130, 82), (0, 0), 5)
    Image.fromarray(smooth[:, :, ::-1]).save(path, exif=exif)
    return path


@pytest.mark.parametrize("suffix", [".png", ".jpg", ".JPEG", ".bmp", ".tif", ".webp"])
def test_images_come_in_natural_order_with_a_stated_rate(tmp_path: Path, suffix: str) -> None:
    with open_source(fill(tmp_path / "site", 12, suffix), fps=4.0) as source:
        frames = list(source)
    assert [index_in(frame.image) for frame in frames] == list(range(12))
    assert [frame.time_s for frame in frames] == [index / 4 for index in range(12)]
    assert source.frame_count == 12
    assert {(frame.stream_id, frame.captured_at) for frame in frames} == {("site", None)}


@pytest.mark.parametrize(
    ("start_s", "stop_s", "every", "expected"),
    [(0.0, None, 5, [0, 5, 10]), (0.3, None, 1, list(range(3, 12))), (0.25, 0.9, 2, [3, 5, 7]), (1.1, None, 9, [11])],
)
def test_a_part_keeps_its_indices(
    tmp_path: Path, start_s: float, stop_s: float | None, every: int, expected: list[int]
) -> None:
    with open_source(fill(tmp_path / "site", 12), fps=10, start_s=start_s, stop_s=stop_s, every=every) as source:
        frames = list(source)
    assert [frame.index for frame in frames] == [index_in(frame.image) for frame in frames] == expected
    assert source.frame_count == len(expected)
    assert source.describe()["kind"] == "image folder"
    assert source.describe()["every"] == every


def test_what_file_managers_leave_behind_is_overlooked(tmp_path: Path) -> None:
    folder = fill(tmp_path / "site", 3)
    for name in (".DS_Store", "._shot1.png", "Thumbs.db", "desktop.ini"):
        (folder / name).write_text("not a picture")
    assert len(list(open_source(folder, fps=1))) == 3


def test_a_name_with_a_percent_sign_is_no_pattern(tmp_path: Path) -> None:
    folder = fill(tmp_path / "site%d", 2)
    (folder / "shot1.png").rename(folder / "shot%03d.png")
    assert sorted(index_in(frame.image) for frame in open_source(folder, fps=1)) == [0, 1]


@pytest.mark.parametrize("orientation", range(1, 9))
def test_orientation_in_exif_data_is_followed_as_opencv_follows_it(tmp_path: Path, orientation: int) -> None:
    path = write_turned(tmp_path / "turned.jpg", orientation)
    (frame,) = open_source(tmp_path, fps=1)
    expected = cv2.imread(str(path))
    assert expected is not None
    assert frame.image.shape == expected.shape
    assert np.abs(frame.image.astype(int) - expected).mean() <= RESIZED_LEVELS


@pytest.mark.parametrize("suffix", [".png", ".webp", ".tif", ".jpg"])
@pytest.mark.parametrize("orientation", [None, 1, 2, 3, 4, 5, 6, 7, 8, 9])
def test_in_every_format_orientation_is_followed_as_pillow_follows_it(
    tmp_path: Path, suffix: str, orientation: int | None
) -> None:
    path = write_turned(tmp_path / f"turned{suffix}", orientation)
    with Image.open(path) as stored:
        expected = np.asarray(ImageOps.exif_transpose(stored).convert("RGB"))[:, :, ::-1].astype(int)
    (frame,) = open_source(tmp_path, fps=1)
    (alone,) = open_source(path)
    for image in (frame.image, alone.image):
        assert image.shape == expected.shape
        assert np.abs(image - expected).mean() <= RESIZED_LEVELS


@pytest.mark.live
def test_photographs_of_a_drone_read_as_opencv_reads_them(shared_data: Path, tmp_path: Path) -> None:
    path = sorted((shared_data / "drone_photos").glob("*.JPG"))[0]
    (tmp_path / path.name).symlink_to(path)
    (frame,) = open_source(tmp_path, fps=1)
    expected = cv2.imread(str(path))
    assert expected is not None
    assert frame.image.shape == expected.shape
    assert np.abs(frame.image.astype(int) - expected).mean() <= RESIZED_LEVELS


# --- bad input ---


def test_a_folder_needs_a_frame_rate(tmp_path: Path) -> None:
    with pytest.raises(SourceError, match=r"a folder has no clock.*--fps"):
        open_source(fill(tmp_path / "site", 2)).describe()


def test_strangers_are_named(tmp_path: Path) -> None:
    folder = fill(tmp_path / "site", 2)
    for name in ("a.txt", "b.csv", "c.mp4", "d.zip"):
        (folder / name).write_text("x")
    with pytest.raises(SourceError, match=r"found a\.txt, b\.csv, c\.mp4 and 1 more") as caught:
        open_source(folder, fps=1).describe()
    assert "\n" not in str(caught.value)


def test_a_folder_inside_is_a_stranger_even_if_named_like_an_image(tmp_path: Path) -> None:
    folder = fill(tmp_path / "site", 2)
    (folder / "more.png").mkdir()
    with pytest.raises(SourceError, match=r"found more\.png"):
        open_source(folder, fps=1).describe()


def test_an_empty_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SourceError, match="expected images in"):
        open_source(tmp_path, fps=1).describe()


@pytest.mark.parametrize("suffix", [".png", ".jpg", ".bmp", ".tif", ".webp"])
@pytest.mark.parametrize("damage", ["cut", "text", "empty"])
def test_a_corrupt_picture_is_named_before_anything_is_read(tmp_path: Path, suffix: str, damage: str) -> None:
    folder = fill(tmp_path / "site", 3, suffix)
    path = folder / f"shot1{suffix}"
    content = path.read_bytes()
    path.write_bytes({"cut": content[: len(content) // 2], "text": b"not a picture\n" * 20, "empty": b""}[damage])
    with pytest.raises(SourceError, match=f"found shot1{suffix}: "):
        open_source(folder, fps=1).describe()


def test_all_pictures_of_another_size_are_named_before_anything_is_read(tmp_path: Path) -> None:
    folder = fill(tmp_path / "site", 8)
    for index in (2, 3, 5, 6, 7):
        cv2.imwrite(str(folder / f"shot{index}.png"), coded_picture(index, 120, 80))
    found = r"120x80 at shot2\.png, 120x80 at shot3\.png, 120x80 at shot5\.png and 2 more"
    with pytest.raises(FrameSizeChanged, match=found):
        open_source(folder, fps=1).describe()


def test_a_bad_picture_outside_the_part_that_is_wanted_does_no_harm(tmp_path: Path) -> None:
    folder = fill(tmp_path / "site", 8)
    (folder / "shot5.png").write_bytes(b"")
    with open_source(folder, fps=1, stop_s=5) as source:
        assert [frame.index for frame in source] == [0, 1, 2, 3, 4]
    with open_source(folder, fps=1, start_s=6) as source:
        assert [frame.index for frame in source] == [6, 7]
    with open_source(folder, fps=1, every=2) as source:
        assert [frame.index for frame in source] == [0, 2, 4, 6]
    with pytest.raises(SourceError, match=r"shot5\.png: it is empty"):
        open_source(folder, fps=1, start_s=4).describe()


def test_a_start_beyond_the_last_picture_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SourceError, match=r"it lasts about 3\.0 s"):
        open_source(fill(tmp_path / "site", 3), fps=1, start_s=3).describe()
