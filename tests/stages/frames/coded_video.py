"""Small videos in which every picture carries its own index as a code of black and white fields."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path

import av
import cv2
import numpy as np
from av.video.reformatter import VideoReformatter

from standoff.core.types import ImageArray

_BITS = 12
_COLUMNS = 6


def coded_picture(index: int, width_px: int = 96, height_px: int = 64, *, seed: int = 0) -> ImageArray:
    """Draw `index` in the upper half; smooth random colours below."""
    noise = np.random.default_rng(seed).integers(0, 255, (4, 6, 3), dtype=np.uint8)
    picture: ImageArray = cv2.resize(noise, (width_px, height_px), interpolation=cv2.INTER_LINEAR)
    for bit in range(_BITS):
        row, column = divmod(bit, _COLUMNS)
        top, bottom = row * height_px // 4, (row + 1) * height_px // 4
        left, right = column * width_px // _COLUMNS, (column + 1) * width_px // _COLUMNS
        picture[top:bottom, left:right] = 235 if index >> bit & 1 else 20
    return picture


def index_in(picture: ImageArray) -> int:
    """Read the index back."""
    height_px, width_px = picture.shape[:2]
    rows, columns = np.divmod(np.arange(_BITS), _COLUMNS)
    y = ((rows + 0.5) * height_px / 4).astype(int)
    x = ((columns + 0.5) * width_px / _COLUMNS).astype(int)
    return int((picture[y, x].mean(axis=1) > 128) @ (1 << np.arange(_BITS)))


@dataclass(frozen=True)
class Recipe:
    """How to encode: 10 frames a second unless `times_ms` says otherwise.

    `display` is (a, b, c, d) of a display matrix: a stored (p, q) is shown at (a p + c q, b p + d q).
    """

    codec: str = "libx264"
    pixel_format: str = "yuv420p"
    size_px: tuple[int, int] = (96, 64)
    times_ms: Sequence[int] | None = None
    rotation_deg: int = 0
    display: tuple[int, int, int, int] | None = None
    pixel_aspect: Fraction | None = None
    color_range: int = 0
    options: Mapping[str, str] = field(default_factory=lambda: {"g": "12", "bf": "2"})
    muxer_options: Mapping[str, str] = field(default_factory=dict)
    metadata: Mapping[str, str] = field(default_factory=dict)
    first_index: int = 0
    seed: int = 0


def write_video(path: Path, count: int, recipe: Recipe | None = None, *, picture: ImageArray | None = None) -> Path:
    """Encode `count` coded pictures, or the same one again and again."""
    recipe = recipe or Recipe()
    width_px, height_px = recipe.size_px
    with av.open(str(path), "w", options=dict(recipe.muxer_options)) as container:
        container.metadata.update(recipe.metadata)
        stream = container.add_stream(recipe.codec, rate=10, options=dict(recipe.options))
        stream.width, stream.height, stream.pix_fmt = width_px, height_px, recipe.pixel_format
        if recipe.times_ms is not None:
            stream.codec_context.time_base = Fraction(1, 1000)
        stream.codec_context.color_range = recipe.color_range
        if recipe.pixel_aspect is not None:
            stream.codec_context.sample_aspect_ratio = recipe.pixel_aspect
        reformatter = VideoReformatter()
        if recipe.rotation_deg:
            stream.set_display_rotation(recipe.rotation_deg)
        if recipe.display is not None:
            a, b, c, d = recipe.display
            stream.set_display_matrix([a << 16, b << 16, 0, c << 16, d << 16, 0, 0, 0, 1 << 30])
        for i in range(count):
            coded = coded_picture(recipe.first_index + i, width_px, height_px, seed=recipe.seed)
            frame = reformatter.reformat(
                av.VideoFrame.from_ndarray(coded if picture is None else picture, format="bgr24"),
                format=recipe.pixel_format,
                dst_color_range=recipe.color_range,
            )
            frame.pts = recipe.first_index + i if recipe.times_ms is None else recipe.times_ms[i]
            frame.time_base = Fraction(1, 10) if recipe.times_ms is None else Fraction(1, 1000)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return path
