"""Printed markers as a drone's camera sees them, drawn exactly, with everything that makes them hard to find.

Each pixel is the mean of many samples in linear light, each looked up in the marker itself; then the lens, the motion,
the sensor, the camera's sharpening and H.264 have their turn.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from io import BytesIO

import av
import cv2
import numpy as np
import numpy.typing as npt

from standoff.core import homography
from standoff.core.homography import BoolArray, FloatArray
from standoff.core.types import ImageArray

_SAMPLES = 6
_SHEET_MODULES = 1.25
_UNIT = np.array([[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]])
_WHITE, _BLACK = 0.75, 0.04

_TILE_LEAST_PX, _TILE_SIDES, _TILE_ROOM_PX = 128, 2.2, 24


@dataclass(frozen=True, slots=True)
class Hardship:
    """What stands between a marker and its picture.

    Attributes:
        name: For tables.
        blur_px: Standard deviation of lens and demosaicing.
        motion_px: Length of the smear during one exposure.
        exposure: White paper in the sun is 1; above it clips.
        noise: Standard deviation in grey levels of 255.
        sharpening: Share of the detail that the camera adds again.
        crf: H.264's constant rate factor; None for no compression.
    """

    name: str
    blur_px: float = 0.6
    motion_px: float = 0.0
    exposure: float = 0.9
    noise: float = 2.0
    sharpening: float = 0.4
    crf: int | None = 23


HARDSHIPS = (
    Hardship("good", crf=18),
    Hardship("usual"),
    Hardship("strong compression", crf=32),
    Hardship("dusk", exposure=0.12, noise=7.0),
    Hardship("glare", exposure=2.2),
    Hardship("soft lens", blur_px=1.2),
    Hardship("motion", motion_px=3.0),
)


def draw_marker(light: FloatArray, pattern: BoolArray, corners_px: FloatArray) -> None:
    """Lay a sheet with a marker on a picture in linear light.

    Args:
        light: (H, W) 0..1, changed in place.
        pattern: (n, n) of `marker_pattern`.
        corners_px: (4, 2) lower left, lower right, upper right, upper left.
    """
    modules = len(pattern)
    unit_to_image = homography.fit(_UNIT, corners_px)
    to_unit = np.linalg.inv(unit_to_image)
    wide = _SHEET_MODULES / modules
    sheet = homography.apply(unit_to_image, np.array([[x, y] for x in (-wide, 1 + wide) for y in (-wide, 1 + wide)]))[0]
    low = np.maximum(np.floor(sheet.min(axis=0)).astype(int), 0)
    high = np.minimum(np.ceil(sheet.max(axis=0)).astype(int) + 1, light.shape[::-1])
    within = (np.arange(_SAMPLES) + 0.5) / _SAMPLES - 0.5
    xs = (np.arange(low[0], high[0])[:, None] + within).ravel()
    ys = (np.arange(low[1], high[1])[:, None] + within).ravel()
    grid = np.stack(np.meshgrid(xs, ys), axis=-1)
    homogeneous = np.concatenate([grid, np.ones((*grid.shape[:2], 1))], axis=-1) @ to_unit.T
    u, v = np.moveaxis(homogeneous[..., :2] / homogeneous[..., 2:], -1, 0)
    on_sheet = (np.abs(u - 0.5) < 0.5 + wide) & (np.abs(v - 0.5) < 0.5 + wide)
    bordered = np.pad(pattern, 2, constant_values=True)
    row, column = (np.clip(np.floor(one * modules).astype(int) + 2, 0, modules + 3) for one in (v, u))
    value = np.where(bordered[row, column], _WHITE, _BLACK)
    rows, columns = slice(low[1], high[1]), slice(low[0], high[0])
    under = np.repeat(np.repeat(light[rows, columns], _SAMPLES, axis=0), _SAMPLES, axis=1)
    fine = np.where(on_sheet, value, under)
    shape = (high[1] - low[1], _SAMPLES, high[0] - low[0], _SAMPLES)
    light[rows, columns] = fine.reshape(shape).mean(axis=(1, 3))


def random_corners(rng: np.random.Generator, side_px: float, *, steepest_deg: float = 50.0) -> FloatArray:
    """Draw a marker's corners around the origin, seen from a long way off (4 % perspective).

    Args:
        rng: Decides on the direction.
        side_px: Square root of the area in the picture.
        steepest_deg: Largest angle between the line of sight and the marker's normal.
    """
    turn = rng.uniform(0.0, 2.0 * np.pi)
    tilt = np.deg2rad(rng.uniform(0.0, steepest_deg))
    flat = (_UNIT - 0.5) @ np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    depth = 1.0 - 0.04 * np.sin(tilt) * flat[:, 1]
    seen = flat * [1.0, np.cos(tilt)] / depth[:, None]
    return np.asarray(seen * side_px / np.sqrt(np.cos(tilt)))


def random_ground(rng: np.random.Generator, shape: tuple[int, int]) -> FloatArray:
    """Draw ground with clods, tracks and stones of all sizes, (H, W) linear light."""
    ground = np.full(shape, float(rng.uniform(0.12, 0.3)))
    for sigma_px, strength in ((1.0, 0.25), (3.0, 0.2), (10.0, 0.2)):
        grain = cv2.GaussianBlur(rng.standard_normal(shape), (0, 0), sigma_px)
        ground *= np.exp(strength * grain / grain.std())
    return np.asarray(np.clip(ground, 0.02, 0.7))


def through_camera(light: FloatArray, hardship: Hardship, rng: np.random.Generator) -> ImageArray:
    """Return what the camera makes of a picture in linear light, (H, W) uint8, before compression."""
    light = cv2.GaussianBlur(light, (0, 0), hardship.blur_px)
    if hardship.motion_px > 0:
        light = _smeared(light, hardship.motion_px, rng.uniform(0.0, np.pi))
    linear = np.clip(light * hardship.exposure, 0.0, 1.0)
    levels = 255.0 * np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    levels += cv2.GaussianBlur(rng.standard_normal(light.shape), (0, 0), 0.5) * hardship.noise * 1.9
    levels += hardship.sharpening * (levels - cv2.GaussianBlur(levels, (0, 0), 1.0))
    picture: ImageArray = np.rint(np.clip(levels, 0.0, 255.0)).astype(np.uint8)
    return picture


def _smeared(light: FloatArray, length_px: float, angle: float) -> FloatArray:
    steps = np.linspace(-0.5, 0.5, 4 * int(np.ceil(length_px)) + 1) * length_px
    size = light.shape[::-1]
    moved = [
        cv2.warpAffine(light, np.array([[1.0, 0.0, s * np.cos(angle)], [0.0, 1.0, s * np.sin(angle)]]), size,
                       borderMode=cv2.BORDER_REFLECT)
        for s in steps
    ]  # fmt: skip
    return np.asarray(np.mean(moved, axis=0))


def through_h264(pictures: list[ImageArray], crf: int) -> list[ImageArray]:
    """Code grey pictures as a film and read them again."""
    height_px, width_px = pictures[0].shape
    file = BytesIO()
    with av.open(file, "w", format="mp4") as coded:
        stream = coded.add_stream("libx264", rate=Fraction(30), options={"crf": str(crf), "preset": "veryfast"})
        stream.width, stream.height, stream.pix_fmt, stream.thread_count = width_px, height_px, "yuv420p", 1
        for picture in pictures:
            planes = np.full((height_px * 3 // 2, width_px), 128, np.uint8)
            planes[:height_px] = picture
            coded.mux(stream.encode(av.VideoFrame.from_ndarray(planes, format="yuv420p")))
        coded.mux(stream.encode())
    file.seek(0)
    with av.open(file) as film:
        return [frame.to_ndarray(format="gray") for frame in film.decode(video=0)]


def marker_film(
    patterns: list[BoolArray], side_px: float, hardship: Hardship, rng: np.random.Generator, frames: int = 4
) -> tuple[ImageArray, npt.NDArray[np.float64]]:
    """Return the last picture of a short film with many markers on it, all drifting together.

    Args:
        patterns: One for each marker; they are laid out in a square.
        side_px: Of each marker, as in `random_corners`.
        hardship: What they suffer.
        rng: Decides on the rest.
        frames: Of the film; later ones are coded from the ones before.

    Returns:
        (H, W) uint8, and (N, 4, 2) true corners.
    """
    across = int(np.ceil(np.sqrt(len(patterns))))
    # A sheet turned by 45 degrees and seen at a slant needs twice its side, and some room to drift.
    tile_px = 2 * round(max(_TILE_LEAST_PX, _TILE_SIDES * side_px + _TILE_ROOM_PX) / 2)
    middles = np.array([[i % across + 0.5, i // across + 0.5] for i in range(len(patterns))]) * tile_px
    start = np.stack([random_corners(rng, side_px) for _ in patterns]) + middles[:, None]
    start += rng.uniform(-8.0, 8.0, (len(patterns), 1, 2))
    drift = rng.uniform(-2.5, 2.5, 2)
    ground = random_ground(rng, (across * tile_px, across * tile_px))
    pictures = []
    for index in range(frames if hardship.crf is not None else 1):
        moved = index * drift
        light = cv2.warpAffine(ground, np.array([[1.0, 0.0, moved[0]], [0.0, 1.0, moved[1]]]), ground.shape[::-1],
                               borderMode=cv2.BORDER_REFLECT)  # fmt: skip
        corners = start + moved
        for pattern, one in zip(patterns, corners, strict=True):
            draw_marker(light, pattern, one)
        pictures.append(through_camera(light, hardship, rng))
    if hardship.crf is not None:
        pictures = through_h264(pictures, hardship.crf)
    return pictures[-1], corners
