"""Pictures that convert their pixels when asked: decoded ones (PyAV) and ready arrays (numpy)."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from threading import Lock

import av
import cv2
import numpy as np
from av.video.reformatter import VideoReformatter

from standoff.core.types import ImageArray, Luma
from standoff.files.orientation import UPRIGHT, Orientation
from standoff.stages.frames.pixel_shape import square_size_px

_EIGHT_BIT_LUMA_FIRST = frozenset(
    ["gray", "nv12", "nv21", "nv16"]
    + [f"yuv{j}{layout}p" for j in ("", "j") for layout in ("410", "411", "420", "422", "440", "444")]
)
_EIGHT_BIT_420 = frozenset(["yuv420p", "yuvj420p", "nv12"])
_FULL_RANGE = 2  # AVCOL_RANGE_JPEG
_LIMITED_TO_FULL = np.clip(np.rint((np.arange(256) - 16) * (255 / 219)), 0, 255).astype(np.uint8)
_LIMITED_TO_FULL.setflags(write=False)


def _read_only(image: ImageArray) -> ImageArray:
    image.setflags(write=False)
    return image


def _gray_of(bgr: ImageArray) -> ImageArray:
    gray: ImageArray = cv2.cvtColor(bgr, cv2.COLOR_BGR2GRAY)
    return gray


def halved(gray: ImageArray, times: int) -> ImageArray:
    """Return (H, W) averaged over two by two pixels so many times; an odd last row or column is dropped each time."""
    for _ in range(times):
        even = gray[: gray.shape[0] // 2 * 2, : gray.shape[1] // 2 * 2]
        gray = cv2.resize(even, (even.shape[1] // 2, even.shape[0] // 2), interpolation=cv2.INTER_AREA)
    return gray


class Scaler:
    """Scale and convert decoded frames of one stream, keeping swscale's tables and threads from frame to frame.

    Making them anew for each frame costs as much as the work itself. One frame at a time: it may be shared
    between threads.
    """

    def __init__(self) -> None:
        self._lock = Lock()
        self._reformatters: dict[tuple[int, int, str], VideoReformatter] = {}

    def bgr(self, frame: av.VideoFrame, width_px: int, height_px: int) -> ImageArray:
        """Return (height_px, width_px, 3) uint8, blue first.

        Shrinking averages over areas, so that nothing aliases; enlarging interpolates linearly. Shrunk by less
        than half, 4:2:0 stays 4:2:0 until it has its size: a third quicker, and colour is as fine as in the video.
        """
        shrinks = width_px * height_px < frame.width * frame.height
        mildly = 2 * width_px >= frame.width and 2 * height_px >= frame.height
        with self._lock:
            if shrinks and mildly and frame.format.name in _EIGHT_BIT_420:
                frame = self._reformatted(frame, width_px, height_px, frame.format.name)
            scaled = self._reformatted(frame, width_px, height_px, "bgr24")
        # As it lies in the frame, rows perhaps padded: to_ndarray() would copy it.
        plane = scaled.planes[0]
        rows = np.frombuffer(plane, np.uint8).reshape(height_px, plane.line_size)
        return rows[:, : 3 * width_px].reshape(height_px, width_px, 3)

    def _reformatted(self, frame: av.VideoFrame, width_px: int, height_px: int, pixel_format: str) -> av.VideoFrame:
        shrinks = width_px * height_px < frame.width * frame.height
        reformatter = self._reformatters.setdefault((width_px, height_px, pixel_format), VideoReformatter())
        return reformatter.reformat(
            frame,
            width=width_px,
            height=height_px,
            format=pixel_format,
            interpolation="AREA" if shrinks else "BILINEAR",
            threads=cv2.getNumThreads(),
        )


class AvPicture:
    """A decoded video frame, upright and with square pixels; valid for as long as it is kept, whatever comes next.

    Args:
        frame: The decoded `av.VideoFrame`, never changed.
        orientation: What makes it upright.
        scaler: Shared by all pictures of a stream, to be quick.
        pixel_aspect: Width of a stored pixel in its heights; None: square.
    """

    __slots__ = ("_bgr", "_frame", "_gray", "_orientation", "_scaler", "_square_px")

    def __init__(
        self,
        frame: av.VideoFrame,
        orientation: Orientation = UPRIGHT,
        scaler: Scaler | None = None,
        pixel_aspect: Fraction | None = None,
    ) -> None:
        self._frame = frame
        self._orientation = orientation
        self._scaler = scaler or Scaler()
        self._square_px = square_size_px((frame.width, frame.height), pixel_aspect)
        self._bgr: ImageArray | None = None
        self._gray: ImageArray | None = None

    @property
    def width_px(self) -> int:
        """Width once upright."""
        return self._orientation.size_px(self._square_px)[0]

    @property
    def height_px(self) -> int:
        """Height once upright."""
        return self._orientation.size_px(self._square_px)[1]

    def bgr(self) -> ImageArray:
        """Return (H, W, 3) uint8, blue first, read-only; converted once and kept."""
        if self._bgr is None:
            pixels = self._scaler.bgr(self._frame, *self._square_px)
            self._bgr = _read_only(self._orientation.upright(pixels))
        return self._bgr

    def resized_bgr(self, width_px: int, height_px: int) -> ImageArray:
        """Return (height_px, width_px, 3) uint8, blue first, scaled before it is converted.

        Shrinking averages over areas, so that nothing aliases; enlarging interpolates linearly. At the
        picture's own size it equals `bgr()`.
        """
        if (width_px, height_px) == (self.width_px, self.height_px):
            return self.bgr().copy()
        stored_px = self._orientation.size_px((width_px, height_px))
        return self._orientation.upright(self._scaler.bgr(self._frame, *stored_px))

    def gray(self) -> ImageArray:
        """Return (H, W) uint8 luma, 0 black to 255 white, read-only; made once and kept.

        Eight-bit YUV: the coded luma itself, stretched from 16..235 where the video says (or does not
        deny) that it uses only those. It follows the video's own colour matrix, so that saturated
        colours differ a little from OpenCV's gray, which is always BT.601. Other formats, and pixels that are
        not square: from `bgr()`.
        """
        if self._gray is None:
            coded = self._coded_luma()
            gray = _gray_of(self.bgr()) if coded is None else self._orientation.upright(coded[:, :])
            self._gray = _read_only(gray)
        return self._gray

    def luma(self) -> Luma:
        """Return what `gray` shows, of which only the parts that are asked for are made."""
        coded = self._coded_luma() if self._gray is None and self._orientation.is_upright else None
        return self.gray() if coded is None else coded

    def halved_gray(self, times: int) -> ImageArray:
        """Return `gray` averaged over two by two pixels so many times.

        Averaged before it is stretched, where there is a coded luma: that is a fraction of the work, and rounds
        differently by a level here and there.
        """
        coded = self._coded_luma() if self._orientation.is_upright else None
        return halved(self.gray(), times) if coded is None else coded.halved(times)

    def _coded_luma(self) -> _CodedLuma | None:
        """Return the luma plane as it lies in the file; None where there is none, or not of the picture's size."""
        frame, plane = self._frame, self._frame.planes[0]
        if self._square_px != (frame.width, frame.height):
            return None
        if frame.format.name not in _EIGHT_BIT_LUMA_FIRST or plane.line_size < 0:
            return None
        rows = np.frombuffer(plane, np.uint8)[: plane.line_size * frame.height].reshape(frame.height, plane.line_size)
        is_full = frame.color_range == _FULL_RANGE or frame.format.name.startswith(("yuvj", "gray"))
        return _CodedLuma(rows[:, : frame.width], is_full)


@dataclass(frozen=True, slots=True)
class _CodedLuma:
    """A decoder's luma, black 0 and white 255 in every copy of a part of it.

    Attributes:
        coded: (H, W) the decoder's own memory.
        is_full: Whether black is 0 and white 255 there, too; else 16 and 235.
    """

    coded: ImageArray
    is_full: bool

    @property
    def shape(self) -> tuple[int, ...]:
        return self.coded.shape

    def __getitem__(self, part: tuple[slice, slice]) -> ImageArray:
        return self._stretched(self.coded[part])

    def halved(self, times: int) -> ImageArray:
        return self._stretched(halved(self.coded, times))

    def _stretched(self, coded: ImageArray) -> ImageArray:
        stretched: ImageArray = coded.copy() if self.is_full else cv2.LUT(coded, _LIMITED_TO_FULL)
        return stretched


class ArrayPicture:
    """A picture that is already an array; copied, so that its maker may go on using it.

    Args:
        image: (H, W, 3) uint8, blue first.

    >>> picture = ArrayPicture(np.zeros((4, 6, 3), np.uint8))
    >>> picture.width_px, picture.gray().shape, picture.resized_bgr(3, 2).shape
    (6, (4, 6), (2, 3, 3))
    """

    __slots__ = ("_bgr", "_gray")

    def __init__(self, image: ImageArray) -> None:
        if image.ndim != 3 or image.shape[2] != 3 or image.dtype != np.uint8 or image.size == 0:
            raise ValueError(f"a picture must be (H, W, 3) uint8 BGR, not {image.shape} {image.dtype}")
        self._bgr = _read_only(np.array(image, order="C"))
        self._gray: ImageArray | None = None

    @property
    def width_px(self) -> int:
        """Width."""
        return int(self._bgr.shape[1])

    @property
    def height_px(self) -> int:
        """Height."""
        return int(self._bgr.shape[0])

    def bgr(self) -> ImageArray:
        """Return (H, W, 3) uint8, blue first, read-only."""
        return self._bgr

    def resized_bgr(self, width_px: int, height_px: int) -> ImageArray:
        """Return (height_px, width_px, 3) uint8, blue first."""
        shrinks = width_px * height_px < self.width_px * self.height_px
        resized: ImageArray = cv2.resize(
            self._bgr, (width_px, height_px), interpolation=cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR
        )
        return resized

    def gray(self) -> ImageArray:
        """Return (H, W) uint8 luma (BT.601), read-only; converted once and kept."""
        if self._gray is None:
            self._gray = _read_only(_gray_of(self._bgr))
        return self._gray

    def luma(self) -> Luma:
        """Return `gray`."""
        return self.gray()

    def halved_gray(self, times: int) -> ImageArray:
        """Return `gray` averaged over two by two pixels so many times."""
        return halved(self.gray(), times)
