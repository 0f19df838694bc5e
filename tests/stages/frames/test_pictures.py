from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import av
import cv2
import numpy as np
import pytest
from av.video.reformatter import VideoReformatter
from hypothesis import given
from hypothesis import strategies as st
from laws import examples
from stages.frames.coded_video import Recipe, coded_picture, write_video
from tolerances import GRAY_LEVELS, RESIZED_LEVELS, SWSCALE_LEVELS

from standoff.core.types import ImageArray, Picture
from standoff.files.orientation import Orientation
from standoff.stages.frames import ArrayPicture, AvPicture, Scaler, frame_from_array, open_source
from standoff.stages.frames.pictures import halved

FORMATS = ["yuv420p", "yuvj420p", "yuv422p", "yuv444p", "nv12", "gray", "rgb24", "bgr24", "yuv420p10le", "rgba"]
LIMITED, FULL = 1, 2


def smooth(width_px: int, height_px: int, *, seed: int = 0) -> ImageArray:
    """Slow, unsaturated colours: chroma subsampling and gamut clipping lose next to nothing."""
    rng = np.random.default_rng(seed)
    gray = cv2.resize(rng.uniform(30, 220, (3, 4)).astype(np.float32), (width_px, height_px))
    tint = cv2.resize(rng.uniform(-12, 12, (2, 2, 3)).astype(np.float32), (width_px, height_px))
    shaded: ImageArray = np.clip(gray[..., None] + tint, 0, 255).astype(np.uint8)
    return shaded


def decoded(image: ImageArray, pixel_format: str, color_range: int = 0) -> av.VideoFrame:
    frame = av.VideoFrame.from_ndarray(image, format="bgr24")
    converted: av.VideoFrame = VideoReformatter().reformat(frame, format=pixel_format, dst_color_range=color_range)
    return converted


@pytest.mark.parametrize("pixel_format", FORMATS)
@pytest.mark.parametrize("size", [(96, 64), (97, 65), (130, 82)])
@pytest.mark.parametrize("exif", [1, 2, 5, 6, 7, 8])
def test_resizing_to_the_own_size_is_the_picture_itself(pixel_format: str, size: tuple[int, int], exif: int) -> None:
    picture = AvPicture(decoded(smooth(*size), pixel_format), Orientation.of_exif(exif))
    assert picture.bgr().shape == (picture.height_px, picture.width_px, 3)
    assert np.array_equal(picture.resized_bgr(picture.width_px, picture.height_px), picture.bgr())


@pytest.mark.parametrize(
    ("pixel_format", "color_range"),
    [(name, 0) for name in FORMATS]
    + [(name, color_range) for name in ("yuv420p", "yuv422p", "yuv444p", "nv12") for color_range in (LIMITED, FULL)],
)
@pytest.mark.parametrize("size", [(96, 64), (97, 65)])
def test_gray_is_close_to_opencvs_gray_and_upright(pixel_format: str, size: tuple[int, int], color_range: int) -> None:
    for exif in (1, 3, 5, 8):
        picture = AvPicture(decoded(smooth(*size, seed=exif), pixel_format, color_range), Orientation.of_exif(exif))
        expected = cv2.cvtColor(picture.bgr(), cv2.COLOR_BGR2GRAY).astype(int)
        assert picture.gray().shape == expected.shape
        assert np.abs(picture.gray() - expected).max() <= GRAY_LEVELS


@pytest.mark.parametrize("pixel_format", ["yuv420p", "yuvj420p", "gray", "bgr24"])
@pytest.mark.parametrize("exif", [1, 3, 5, 8])
@pytest.mark.parametrize("color_range", [LIMITED, FULL])
def test_parts_of_the_luma_are_parts_of_the_gray_picture(pixel_format: str, exif: int, color_range: int) -> None:
    picture = AvPicture(decoded(smooth(97, 65), pixel_format, color_range), Orientation.of_exif(exif))
    luma = picture.luma()
    part = luma[3:40, 5:50]
    assert luma.shape == picture.gray().shape
    np.testing.assert_array_equal(part, picture.gray()[3:40, 5:50])


@pytest.mark.parametrize("pixel_format", ["yuv420p", "yuvj420p", "gray", "bgr24"])
@pytest.mark.parametrize("exif", [1, 3, 5, 8])
@pytest.mark.parametrize("times", [0, 1, 2])
def test_halved_gray_is_gray_halved(pixel_format: str, exif: int, times: int) -> None:
    picture = AvPicture(decoded(smooth(98, 67), pixel_format), Orientation.of_exif(exif))
    expected = halved(picture.gray(), times).astype(int)
    width_px, height_px = picture.width_px >> times, picture.height_px >> times
    assert picture.halved_gray(times).shape == expected.shape == (height_px, width_px)
    # Stretching after rounding instead of before it: half a level each, times 255 / 219.
    assert np.abs(picture.halved_gray(times) - expected).max() <= 1 + (times > 0)
    plain = ArrayPicture(smooth(98, 67))
    np.testing.assert_array_equal(plain.halved_gray(times), halved(plain.gray(), times))
    np.testing.assert_array_equal(plain.luma()[:, :], plain.gray())


@pytest.mark.parametrize("color_range", [LIMITED, FULL])
def test_black_and_white_are_0_and_255_in_either_range(tmp_path: Path, color_range: int) -> None:
    recipe = Recipe(color_range=color_range, options={"qp": "0"})
    (frame,) = open_source(write_video(tmp_path / "v.mp4", 1, recipe, picture=np.zeros((64, 96, 3), np.uint8)))
    (white,) = open_source(write_video(tmp_path / "w.mp4", 1, recipe, picture=np.full((64, 96, 3), 255, np.uint8)))
    for picture, level in ((frame.picture, 0), (white.picture, 255)):
        assert np.abs(picture.gray().astype(int) - level).max() <= 1
        for image in (picture.bgr(), picture.resized_bgr(48, 32)):
            assert np.abs(image.astype(int) - level).max() <= SWSCALE_LEVELS


@given(
    width_px=st.integers(16, 82),  # smaller in both directions: OpenCV averages areas only then
    height_px=st.integers(16, 60),
    exif=st.integers(1, 8),
    pixel_format=st.sampled_from(["yuv420p", "yuv444p", "bgr24", "yuv420p10le"]),
    seed=st.integers(0, 99),
)
@examples(60)
def test_resizing_is_close_to_resizing_the_full_picture(
    width_px: int, height_px: int, exif: int, pixel_format: str, seed: int
) -> None:
    picture = AvPicture(decoded(smooth(130, 82, seed=seed), pixel_format), Orientation.of_exif(exif))
    resized = picture.resized_bgr(width_px, height_px)
    assert resized.shape == (height_px, width_px, 3)
    expected = cv2.resize(picture.bgr(), (width_px, height_px), interpolation=cv2.INTER_AREA)
    assert np.abs(resized.astype(int) - expected).mean() <= RESIZED_LEVELS


def test_shrinking_does_not_alias() -> None:
    stripes = np.zeros((120, 160, 3), np.uint8)
    stripes[:, ::2] = 255
    for picture in (AvPicture(decoded(stripes, "yuv444p")), ArrayPicture(stripes)):
        assert picture.resized_bgr(40, 30).std() < 1


def test_a_shared_scaler_remembers_nothing_of_the_picture_before() -> None:
    frames = [
        decoded(smooth(*size, seed=seed), pixel_format, color_range)
        for seed, size in enumerate([(96, 64), (97, 65), (130, 82)])
        for pixel_format, color_range in (("yuv420p", LIMITED), ("yuv420p", FULL), ("rgb24", 0), ("yuv420p10le", 0))
    ]
    scaler = Scaler()
    for frame in frames + frames[::-1]:
        shared, alone = AvPicture(frame, scaler=scaler), AvPicture(frame)
        assert np.array_equal(shared.bgr(), alone.bgr())
        assert np.array_equal(shared.resized_bgr(48, 32), alone.resized_bgr(48, 32))


def test_a_resized_picture_belongs_to_who_asked_for_it() -> None:
    for pixel_format in ("bgr24", "yuv420p"):
        picture = AvPicture(decoded(smooth(96, 64), pixel_format))
        kept = picture.bgr().copy()
        for size in ((96, 64), (48, 32)):
            picture.resized_bgr(*size)[:] = 0
        assert np.array_equal(picture.bgr(), kept)


@pytest.mark.parametrize("kind", ["decoded", "array"])
def test_pixels_are_converted_once_and_cannot_be_written(kind: str) -> None:
    image = smooth(96, 64)
    picture: Picture = ArrayPicture(image) if kind == "array" else AvPicture(decoded(image, "yuv420p"))
    assert picture.bgr() is picture.bgr()
    assert picture.gray() is picture.gray()
    for pixels in (picture.bgr(), picture.gray()):
        with pytest.raises(ValueError, match="read-only"):
            pixels[0, 0] = 0


def test_an_array_is_copied_and_keeps_its_place_in_time() -> None:
    image = coded_picture(5)
    frame = frame_from_array(image, index=5, time_s=0.5, stream_id="camera")
    kept = image.copy()
    image[:] = 0
    assert np.array_equal(frame.image, kept)
    assert (frame.stream_id, frame.index, frame.time_s, frame.size_px) == ("camera", 5, 0.5, (96, 64))
    assert np.array_equal(frame.picture.resized_bgr(48, 32), cv2.resize(kept, (48, 32), interpolation=cv2.INTER_AREA))


@pytest.mark.parametrize(
    "image",
    [np.zeros((4, 6), np.uint8), np.zeros((4, 6, 3)), np.zeros((0, 6, 3), np.uint8), np.zeros((4, 6, 4), np.uint8)],
)
def test_arrays_of_another_kind_are_refused(image: ImageArray) -> None:
    with pytest.raises(ValueError, match=r"must be \(H, W, 3\) uint8 BGR"):
        frame_from_array(image)


@pytest.mark.parametrize("pixel_format", ["yuv420p", "bgr24"])
@pytest.mark.parametrize("exif", [1, 5, 6])
@pytest.mark.parametrize(("aspect", "wide_px"), [(Fraction(4, 3), 128), (Fraction(8, 9), 85), (Fraction(1), 96)])
def test_pixels_that_are_not_square_are_stretched_sideways_as_opencv_stretches_them(
    pixel_format: str, exif: int, aspect: Fraction, wide_px: int
) -> None:
    frame, orientation = decoded(smooth(96, 64), pixel_format), Orientation.of_exif(exif)
    picture = AvPicture(frame, orientation, pixel_aspect=aspect)
    assert (picture.width_px, picture.height_px) == orientation.size_px((wide_px, 64))
    stored = AvPicture(frame).bgr()
    expected = orientation.upright(cv2.resize(stored, (wide_px, 64), interpolation=cv2.INTER_AREA))
    assert np.abs(picture.bgr().astype(int) - expected).mean() <= RESIZED_LEVELS
    gray = cv2.cvtColor(expected, cv2.COLOR_BGR2GRAY).astype(int)
    for found in (picture.gray(), picture.luma()[:, :], picture.halved_gray(0)):
        assert np.abs(found - gray).mean() <= RESIZED_LEVELS
    half = picture.resized_bgr(picture.width_px // 2, picture.height_px // 2)
    shrunk = cv2.resize(expected, half.shape[1::-1], interpolation=cv2.INTER_AREA)
    assert np.abs(half.astype(int) - shrunk).mean() <= RESIZED_LEVELS
