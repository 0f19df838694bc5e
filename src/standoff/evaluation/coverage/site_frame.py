"""Whether a run counts its places from where a clip's truth does."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from standoff.clips import read_scene
from standoff.core.homography import FloatArray
from standoff.evaluation.paper.corner_order import CornerOrder
from standoff.stages.ground import ReferenceShape

_SAME_M = 1e-3
_BY_REFERENCE = ("fused", "refined", "reference:")
"""How the methods of maps begin that rest on the reference object; others have a site frame of their own."""


def shared_turning(settings: Mapping[str, Any], clip: Path) -> CornerOrder | None:
    """Return what turns a run's places into the truth's; None where the two do not share their site frame.

    Args:
        settings: Of the run, as its record has them; empty: nothing is known of them.
        clip: Folder of the truth.

    Raises:
        DataError: The clip's scene is missing or broken.
    """
    entry, told_m = read_scene(clip)["reference"], _corners_told(settings)
    if entry is None or told_m is None:
        return None
    true_m = np.array(entry["top_m"], dtype=np.float64)[:, :2]
    if told_m.shape != true_m.shape or np.abs(told_m - true_m).max() > _SAME_M:
        return None
    return CornerOrder(ReferenceShape.from_corners(true_m), true_m)


def _corners_told(settings: Mapping[str, Any]) -> FloatArray | None:
    section: Any = settings
    for name in ("ground", "reference", "corners_m"):
        section = section.get(name) if isinstance(section, Mapping) else None
    try:
        return None if section is None else np.array(section, dtype=np.float64)
    except (TypeError, ValueError):
        return None


def rests_on_reference(method: str | None) -> bool:
    """Tell whether a map's places are those of the reference object.

    >>> rests_on_reference("fused"), rests_on_reference("telemetry"), rests_on_reference(None)
    (True, False, False)
    """
    return method is not None and method.startswith(_BY_REFERENCE)
