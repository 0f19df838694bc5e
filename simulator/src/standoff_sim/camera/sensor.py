"""What a drone's camera does to a clean picture: soft lens, noise, denoising, sharpening; and its video file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from types import MappingProxyType
from typing import Self

import cv2
import numpy as np
import numpy.typing as npt
from scipy.ndimage import gaussian_filter

from standoff.core.homography import FloatArray
from standoff.core.types import ImageArray
from standoff.drawing.encoder import VideoFile
from standoff.files.place import partial_path
from standoff_sim.clip.presets import Condition
from standoff_sim.movement.band_noise import BandNoise

_TILE_PX = 1024
_TILE_UNIT = 28  # noise of one standard deviation in the tile
_LEVEL_UNIT = 64  # a grey level in the table of standard deviations
_TILE_SEED = 20_011
_LUMA_GRAIN_PX, _CHROMA_GRAIN_PX = 0.55, 2.6
_CHROMA_SHARE = 0.45
_READ_ELECTRONS = 2.0
_STEEPEST = 5.0  # of the tone curve: cameras flatten the darks, where sRGB has 12.9
_SMEAR, _MIDDLE_LEVEL = 2.0, 110
_PRESET = "veryfast"

_ISO: Mapping[Condition, float] = MappingProxyType(
    {"noon": 100.0, "afternoon": 100.0, "low_sun": 200.0, "hazy": 130.0, "overcast": 250.0, "dusk": 3200.0}
)

Int16Array = npt.NDArray[np.int16]


@dataclass(frozen=True, slots=True, eq=False)
class Sensor:
    """A camera's habits.

    Attributes:
        iso: Gain, 100 without.
        full_well: Electrons that make white at ISO 100, per pixel of the picture.
        softness_px: Standard deviation of the lens's and the demosaicing's blur.
        smear_levels: Detail below this is taken for noise and smoothed away.
        sharpening: Share of the detail that is added again: 0 none, 1 strong halos.
        halo_px: Standard deviation of the blur that detail is measured against.
        jpeg_quality: Of a coding round trip; None for none.
        drift_ev: Wander of the automatic exposure, in stops.
    """

    iso: float
    full_well: float
    softness_px: float
    smear_levels: float
    sharpening: float
    halo_px: float
    jpeg_quality: int | None
    drift_ev: BandNoise

    @classmethod
    def of(cls, condition: Condition) -> Self:
        """Return the usual camera of a kind of light."""
        return cls._set(condition, 1.0, np.random.default_rng(_TILE_SEED))

    @classmethod
    def draw(cls, rng: np.random.Generator, condition: Condition) -> Self:
        """Draw a camera of any quality for a kind of light."""
        return cls._set(condition, float(np.exp(rng.normal(0.0, 0.5))), rng)

    @classmethod
    def _set(cls, condition: Condition, factor: float, rng: np.random.Generator) -> Self:
        iso = float(np.clip(_ISO[condition] * factor, 100.0, 12_800.0))
        gain = float(np.log2(iso / 100.0))
        camera = cls(
            iso=iso,
            full_well=18_000.0 / factor,
            softness_px=float(np.clip(0.45 * factor**0.5, 0.3, 0.8)),
            smear_levels=0.0,
            sharpening=float(np.clip(0.6 * factor**0.7 * 0.9**gain, 0.2, 1.1)),
            halo_px=1.0 + 0.1 * gain,
            jpeg_quality=None,
            drift_ev=BandNoise.draw(rng, (0.05, 0.3), 0.05),
        )
        # a denoiser is set by the noise that it has to expect
        return replace(camera, smear_levels=float(_SMEAR * camera.noise_levels()[_MIDDLE_LEVEL]))

    def exposure_at(self, time_s: float) -> float:
        """Return the factor on light by which the automatic exposure is off at a moment."""
        return float(2.0 ** self.drift_ev.at(time_s))

    def noise_levels(self) -> FloatArray:
        """Return (256,) standard deviations of the noise in grey levels, by the level it is added to."""
        encoded = np.arange(256) / 255.0
        linear = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
        slope = np.where(linear <= 0.0031308, 12.92, 1.055 / 2.4 * np.maximum(linear, 0.0031308) ** (1 / 2.4 - 1))
        white = self.full_well * 100.0 / self.iso
        linear_deviation = np.sqrt(linear / white + (_READ_ELECTRONS / white) ** 2)
        deviation: FloatArray = linear_deviation * np.minimum(slope, _STEEPEST) * 255.0
        return deviation

    def expose(self, image: ImageArray, rng: np.random.Generator) -> ImageArray:
        """Take a picture.

        Args:
            image: (H, W, 3) uint8 BGR as a perfect camera would give it.
            rng: Decides on the noise.

        Returns:
            (H, W, 3) uint8 BGR.
        """
        soft = cv2.GaussianBlur(image, (3, 3), self.softness_px)
        noisy = _with_noise(soft, self._noise_table(), rng)
        developed = self._developed(noisy)
        if self.jpeg_quality is None:
            return developed
        return _through_jpeg(developed, self.jpeg_quality)

    def _noise_table(self) -> Int16Array:
        table: Int16Array = np.rint(np.minimum(self.noise_levels(), 40.0) * _LEVEL_UNIT).astype(np.int16)
        return table

    def _developed(self, noisy: ImageArray) -> ImageArray:
        """Smooth away faint detail, strengthen what is left of it, as cameras do."""
        blurred = cv2.GaussianBlur(noisy, (5, 5), self.halo_px)
        detail = cv2.addWeighted(noisy, 1.0, blurred, -1.0, 128.0)
        levels = np.arange(256) - 128.0
        # a smooth threshold: nothing of what is far below it, all of what is far above
        kept = levels * (1.0 - 0.85 * np.exp(-((levels / max(self.smear_levels, 1e-6)) ** 2)))
        table = np.rint(kept * (1.0 + self.sharpening)).astype(np.int16)
        developed: ImageArray = cv2.add(cv2.LUT(detail, table), blurred, dtype=cv2.CV_8U)
        return developed


@lru_cache(maxsize=1)
def _noise_tile() -> Int16Array:
    """Return (n, n, 3) noise, fine in brightness and blotchy in colour, that continues across its own edges."""
    rng = np.random.default_rng(_TILE_SEED)
    luma = _unit(gaussian_filter(rng.standard_normal((_TILE_PX, _TILE_PX), np.float32), _LUMA_GRAIN_PX, mode="wrap"))
    channels = []
    for _ in range(3):
        white = rng.standard_normal((_TILE_PX, _TILE_PX), np.float32)
        chroma = _unit(gaussian_filter(white, _CHROMA_GRAIN_PX, mode="wrap"))
        channels.append(_unit(luma + _CHROMA_SHARE * chroma))
    tile = np.rint(np.stack(channels, axis=-1) * _TILE_UNIT).astype(np.int16)
    tile.setflags(write=False)
    return tile


def _unit(noise: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    scaled: npt.NDArray[np.float32] = noise / noise.std()
    return scaled


def _with_noise(image: ImageArray, table: Int16Array, rng: np.random.Generator) -> ImageArray:
    """Add noise block by block, each a part of the tile, which begins at a random place in every picture."""
    noisy = np.empty_like(image)
    height, width = image.shape[:2]
    top, left = rng.integers(0, _TILE_PX, 2).tolist()
    tile = _noise_tile()
    for y in range(-top, height, _TILE_PX):
        for x in range(-left, width, _TILE_PX):
            rows, columns = slice(max(y, 0), min(y + _TILE_PX, height)), slice(max(x, 0), min(x + _TILE_PX, width))
            grain = tile[rows.start - y : rows.stop - y, columns.start - x : columns.stop - x]
            part = image[rows, columns]
            noise = cv2.multiply(cv2.LUT(part, table), grain, scale=1.0 / (_LEVEL_UNIT * _TILE_UNIT))
            noisy[rows, columns] = cv2.add(part, noise, dtype=cv2.CV_8U)
    return noisy


def _through_jpeg(image: ImageArray, quality: int) -> ImageArray:
    _, coded = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])
    decoded: ImageArray = np.asarray(cv2.imdecode(coded, cv2.IMREAD_COLOR), dtype=np.uint8)
    return decoded


def drone_bit_rate_bps(size_px: tuple[int, int]) -> int:
    """Return the bit rate of drones' H.264 at 30 frames a second: about 16 Mbit/s at 1080p, 55 Mbit/s at 2160p.

    >>> drone_bit_rate_bps((1920, 1080)) // 1_000_000
    16
    """
    return int(16e6 * (size_px[0] * size_px[1] / (1920 * 1080)) ** 0.9)


class VideoWriter:
    """Write `video.mp4` as a drone would: H.264 at its bit rate, every frame at its own time.

    A context manager. The file has its name only once it is whole; after an error, or killed, there is none.

    Args:
        path: The file.
        size_px: (width, height), both even.
        bit_rate_bps: Mean; None for `drone_bit_rate_bps`.

    Raises:
        MissingDependency: No encoder for MP4.
    """

    def __init__(self, path: Path, size_px: tuple[int, int], *, bit_rate_bps: int | None = None) -> None:
        self._path, self._partial = path, partial_path(path)
        rate_bps = drone_bit_rate_bps(size_px) if bit_rate_bps is None else bit_rate_bps
        self._file = VideoFile(self._partial, size_px, preset=_PRESET, bit_rate_bps=rate_bps, bt709=True)
        self._open = True

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is None:
            self.close()
        else:
            self.abort()

    def write(self, image: ImageArray, time_s: float) -> None:
        """Encode a picture, (H, W, 3) uint8 BGR, to be shown at a time from the start of the file."""
        self._file.write(image, time_s)

    def close(self) -> None:
        """Finish the file and give it its name."""
        if self._open:
            self._open = False
            self._file.close()
            self._partial.replace(self._path)

    def abort(self) -> None:
        """Remove what was written."""
        if self._open:
            self._open = False
            self._file.discard()
