"""What a network says of a picture, whatever its family: boxes, and the probability of each label."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from standoff.core.boxes import unknown_points
from standoff.core.homography import FloatArray
from standoff.stages.detect.interface import Interface

Output = npt.NDArray[Any]
_NAMES_OF_BOXES: Final = ("box", "det")
_LARGEST_PROBABILITY: Final = 1.05
"""8-bit networks may round 1 up by a step."""

_ROUNDING_PX: Final = 1.0
"""How far half precision may move a corner, at 1920 px."""

LARGEST_PART: Final = 10.0
"""Boxes as parts of the input may reach beyond it, but not by this much; boxes in pixels do."""


class UnreadableOutputs(Exception):
    """The outputs are not those of the family.

    Args:
        expected: What would have been right.
        found: What is there.
    """

    def __init__(self, expected: str, found: str) -> None:
        super().__init__(expected, found)
        self.expected, self.found = expected, found


@dataclass(frozen=True, slots=True)
class Candidates:
    """Boxes that may be something.

    Attributes:
        xyxy_px: (N, 4) left, top, right, bottom in the network's input; 0 is the edge of its first pixel.
        probability: (N, C) of each label, 0 to 1.
        foot_px: (N, 2) ground points in the network's input; left out: the network gives none.
        foot_sigma_px: (N, 2) their standard errors across and down.
    """

    xyxy_px: FloatArray
    probability: npt.NDArray[np.floating]
    foot_px: FloatArray = field(default_factory=lambda: unknown_points(0))
    foot_sigma_px: FloatArray = field(default_factory=lambda: unknown_points(0))


@dataclass(frozen=True, slots=True)
class OutputReader:
    """How to read a network.

    Attributes:
        names: The outputs to compute.
        read: From them, and the least probability that matters, to candidates.
        boxes_are_parts: The boxes come as parts of the input, where others of the family have pixels.
    """

    names: tuple[str, ...]
    read: Callable[[list[Output], float], Candidates]
    boxes_are_parts: bool = False


def check_candidates(found: Candidates) -> None:
    """Refuse what cannot be boxes and probabilities.

    Raises:
        UnreadableOutputs: There is NaN, a box that ends before it begins, or a probability below 0 or above 1.
    """
    if np.isnan(found.xyxy_px).any():
        raise UnreadableOutputs("numbers", "NaN")
    with np.errstate(invalid="ignore"):  # infinite less infinite; an infinite box ends where the picture does
        sizes_px = found.xyxy_px[:, 2:] - found.xyxy_px[:, :2]
    if (inverted := (sizes_px < -_ROUNDING_PX).any(axis=1)).any():
        width_px, height_px = sizes_px[inverted][0]
        expected = "boxes whose right lies right of their left, and bottom below top,"
        raise UnreadableOutputs(expected, f"one of {width_px:.3g}x{height_px:.3g}")
    check_probability(found.probability)


def check_probability(values: npt.NDArray[np.floating]) -> None:
    """Refuse what cannot be probabilities.

    Raises:
        UnreadableOutputs: There is NaN, or a value below 0 or above 1.
    """
    if not values.size:
        return
    least, most = values.min(), values.max()
    if np.isnan(most):
        raise UnreadableOutputs("numbers", "NaN")
    if least < 0 or most > _LARGEST_PROBABILITY:
        raise UnreadableOutputs("probabilities, 0 to 1,", f"{least:.3g} to {most:.3g}")


def candidates_from_centres(centre: FloatArray, size: FloatArray, probability: npt.NDArray[np.floating]) -> Candidates:
    """Return candidates from (N, 2) centres and (N, 2) widths and heights, in input pixels."""
    half = size / 2.0
    return Candidates(np.concatenate([centre - half, centre + half], axis=1), probability)


def are_parts(boxes: Output) -> bool:
    """Tell whether (N, 4) boxes are parts of the input: none reaches as far as boxes in pixels do.

    Rows of nothing but zeros, which some networks give for an empty picture, do not tell; they count as pixels.
    """
    largest = np.abs(boxes).max(initial=0.0)
    return bool(0.0 < largest <= LARGEST_PART)


def is_table(output: Output, columns: int) -> bool:
    """Tell whether an output is (1, N, columns) of floats."""
    return output.ndim == 3 and output.shape[0] == 1 and output.shape[2] == columns and output.dtype.kind == "f"


def find_output(
    role: str, shape: str, fits: Callable[[Output], bool], interface: Interface, trial: Mapping[str, Output]
) -> str:
    """Return the name of the one output that can have a role.

    Args:
        role: As descriptions call it.
        shape: What is wanted, for messages.
        fits: Tells whether an output can be that.
        interface: What is known of the network.
        trial: Its outputs, by name.

    Raises:
        UnreadableOutputs: There is none, or more than one.
    """
    said = interface.output_names.get(role)
    names = [name for name, output in trial.items() if fits(output) and said in (None, name)]
    if role == "boxes" and len(names) > 1:
        # The logits of four classes look like boxes, too.
        names = [name for name in names if any(word in name.lower() for word in _NAMES_OF_BOXES)]
    if len(names) != 1:
        expected = f"one output of {shape} with {len(interface.classes)} classes"
        raise UnreadableOutputs(expected, listed_outputs(trial))
    return names[0]


def listed_outputs(trial: Mapping[str, Output]) -> str:
    """Name outputs for a message, with shape and type."""
    return ", ".join(f"{name} {output.shape} {output.dtype}" for name, output in trial.items())
