"""Regions of pictures in which nothing is known: crowds, car parks, whatever a set does not label."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np

from standoff.core.errors import DataError
from standoff.core.homography import FloatArray
from standoff.files.number_lists import number_array
from standoff.labels.documents import read_yaml

_SIDES: Final = 4
OWN_REGIONS: Final = "ignore.yaml"
"""In a set's folder: the regions that it says itself nothing is known of, as simulated composites have them."""


def read_regions(path: Path) -> dict[str, FloatArray]:
    """Read (N, 4) left, top, right, bottom, in pixels, by the stem of the picture.

    Args:
        path: YAML of `stem: [[x1, y1, x2, y2], ...]`.

    Raises:
        DataError: It cannot be read, or holds something else.
    """
    regions = {str(stem): corners_of(boxes) for stem, boxes in read_yaml(path).items()}
    wrong = sorted(stem for stem, boxes in regions.items() if boxes is None)
    if wrong:
        raise DataError(
            expected=f"[[x1, y1, x2, y2], ...] of each picture in {path}",
            found=f"something else for {', '.join(wrong)}",
            fix="correct the file",
        )
    return {stem: boxes for stem, boxes in regions.items() if boxes is not None}


def corners_of(boxes: object) -> FloatArray | None:
    """Return (N, 4) left, top, right, bottom as YAML gives them; None where it is something else."""
    try:
        corners = number_array(boxes, 2) if boxes != [] else np.zeros((0, 4))
    except ValueError:
        return None
    if corners.shape[1] != _SIDES:
        return None
    return corners if np.isfinite(corners).all() and (corners[:, :2] <= corners[:, 2:]).all() else None
