"""What a folder's pictures say of their camera together, and where they disagree."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from standoff.core.camera import CameraPrior
from standoff.stages.frames.drone_cameras import DroneCamera
from standoff.stages.frames.photograph import Photograph, read_photograph
from standoff.stages.frames.prior import calibrated_prior, drone_prior, told_prior

_SAMPLED = 50
_PROBLEMS_NAMED = 3


@dataclass(frozen=True, slots=True)
class Album:
    """Some of a folder's pictures, evenly spread.

    Attributes:
        photographs: At least one.
    """

    photographs: tuple[Photograph, ...]

    @property
    def drone(self) -> DroneCamera | None:
        """The camera, if all pictures are of the same and it is known."""
        drones = {photograph.drone for photograph in self.photographs}
        return drones.pop() if len(drones) == 1 else None

    def camera_prior(self, size_px: tuple[int, int]) -> CameraPrior:
        """Return what the pictures say of their camera.

        Args:
            size_px: (width, height) of the pictures, upright.
        """
        if any(photograph.digitally_zoomed for photograph in self.photographs):
            return CameraPrior.unknown(*size_px)
        calibrated_px = [photograph.calibrated_focal_px for photograph in self.photographs]
        if math.isfinite(sum(calibrated_px)) and max(calibrated_px) < 1.001 * min(calibrated_px):
            return calibrated_prior(size_px, calibrated_px[0], self.drone, "XMP")
        told = [photograph.focal_mm_35 for photograph in self.photographs if math.isfinite(photograph.focal_mm_35)]
        if told:
            return told_prior(size_px, told, self.drone, "EXIF", film=False)
        if self.drone is not None:
            return drone_prior(size_px, self.drone, film=False)
        return CameraPrior.unknown(*size_px)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What does not fit together, or is not used."""
        problems = [problem for photograph in self.photographs for problem in photograph.problems]
        more = len(problems) - _PROBLEMS_NAMED
        found = problems[:_PROBLEMS_NAMED] + ([f"and {more} more such problems in EXIF data"] if more > 0 else [])
        told = sorted({p.focal_mm_35 for p in self.photographs if math.isfinite(p.focal_mm_35)})
        if len(told) > 1:
            found.append(f"the pictures' focal lengths differ: {told[0]:g} to {told[-1]:g} mm")
        models = sorted({photograph.model for photograph in self.photographs})
        if len(models) > 1:
            found.append(f"the pictures are of several cameras: {', '.join(model or 'unnamed' for model in models)}")
        silent = sum(photograph.telemetry is None for photograph in self.photographs)
        if 0 < silent < len(self.photographs):
            found.append(f"{silent} of {len(self.photographs)} pictures looked at say nothing of the flight")
        return tuple(found)


def read_album(paths: Sequence[Path]) -> Album:
    """Look at the first and the last picture, and some between."""
    chosen = np.unique(np.linspace(0, len(paths) - 1, min(len(paths), _SAMPLED)).round().astype(int))
    return Album(tuple(read_photograph(paths[index], 0.0) for index in chosen))
