"""How many of the workers a detector finds, by how tall they are in its picture."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from standoff.core.homography import FloatArray

KEY: Final = "finds_workers"
"""In a detector's description, and in a model's file: what `WorkerFinding` says of it."""

_NOT_TOLD: Final = {"height_px": (30.0, 60.0, 120.0), "share": (0.5, 0.9, 0.95)}
"""A guess for detectors of which nobody measured it, on the side of too much that is unknown."""


@dataclass(frozen=True, slots=True)
class WorkerFinding:
    """What share of the workers a detector finds.

    Attributes:
        height_px: Heights of boxes in the network's input, rising.
        share: Of those of whom nothing is hidden, noticed at each of them: a track shows them, or the ground under them
            is one on which somebody may stand.
        input_size_px: (width, height) of the network's input; (0, 0): as large as the picture.
        view_share: The parts of the picture's width and height that the input shows, less than 1 where it looks at
            slices.
        measured: Whether somebody measured it, or it is the guess for detectors that do not say.
    """

    height_px: tuple[float, ...] = _NOT_TOLD["height_px"]
    share: tuple[float, ...] = _NOT_TOLD["share"]
    input_size_px: tuple[int, int] = (0, 0)
    view_share: tuple[float, float] = (1.0, 1.0)
    measured: bool = False

    @classmethod
    def of_detector(cls, description: Mapping[str, Any]) -> WorkerFinding:
        """Read what a detector says of itself; what is replayed was found by the detector that was recorded."""
        while "detector" in description:
            description = description["detector"]
        told = description.get(KEY)
        guess = cls(
            input_size_px=tuple(description.get("input_size_px") or (0, 0)),
            view_share=tuple(description.get("view_share") or (1.0, 1.0)),
        )
        if not told:
            return guess
        return guess.measured_as(tuple(told["height_px"]), tuple(told["share"]))

    def measured_as(self, height_px: tuple[float, ...], share: tuple[float, ...]) -> WorkerFinding:
        """Return it with what somebody measured."""
        return replace(self, height_px=height_px, share=share, measured=True)

    def least_height_px(self, share: float) -> float:
        """Return how tall in the input a worker must be so that this share is found; infinite where none is enough.

        >>> WorkerFinding((20.0, 40.0), (0.5, 0.9)).least_height_px(0.9)
        40.0
        """
        if share > self.share[-1]:
            return float("inf")
        first = int(np.searchsorted(self.share, share))
        low = max(first - 1, 0)
        return float(np.exp(np.interp(share, self.share[low : first + 1], np.log(self.height_px[low : first + 1]))))

    def to_dict(self) -> dict[str, list[float]]:
        """Return what a model's file says of it; nothing where nobody measured it."""
        return {"height_px": list(self.height_px), "share": list(self.share)} if self.measured else {}

    def picture_px_per_input_px(self, size_px: tuple[int, int]) -> float:
        """Return by how much a picture of this (width, height) is made smaller; 1 where it is not.

        A picture that is enlarged shows no more for it.
        """
        if not all(self.input_size_px):
            return 1.0
        sides = zip(size_px, self.view_share, self.input_size_px, strict=True)
        return max(1.0, *(side * share / input_side for side, share, input_side in sides))

    def share_found(self, height_px: FloatArray, size_px: tuple[int, int]) -> FloatArray:
        """Return what share of workers is found.

        Args:
            height_px: Of any shape, heights in the picture; NaN is never found.
            size_px: (width, height) of the picture.
        """
        known = np.nan_to_num(np.asarray(height_px, dtype=np.float64), nan=0.0)
        in_input_px = np.maximum(known / self.picture_px_per_input_px(size_px), 1e-3)
        return np.interp(np.log(in_input_px), np.log(self.height_px), self.share, left=0.0)
