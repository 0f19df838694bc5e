"""Whether a run counts its places from where a clip's truth does."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from standoff.evaluation.paper.clip import read_scene
from standoff.evaluation.paper.turning import Turning
from standoff.stages.ground import ReferenceShape

_SAME_M = 1e-3
_BY_REFERENCE = ("fused", "refined", "reference:")
"""How the methods of maps begin that rest on the reference object; others have a site frame of their own."""


def shared_turning(settings: Mapping[str, Any], clip: Path) -> Turning | None:
    """Return what turns a run's places into the truth's; None where the two do not share their site frame.

    Args:
        settings: Of the run, as its record has them; empty: nothing is known of them.
        clip: Folder of the truth.

    Raises:
        DataError: The clip's scene is missing or broken.
    """
    told = (settings.get("ground") or {}).get("reference") or {}
    entry = read_scene(clip)["reference"]
    if entry is None or not told.get("corners_m"):
        return None
    corners_m, true_m = np.array(told["corners_m"]), np.array(entry["top_m"])[:, :2]
    if corners_m.shape != true_m.shape or np.abs(corners_m - true_m).max() > _SAME_M:
        return None
    return Turning(ReferenceShape.from_corners(true_m), true_m)


def rests_on_reference(method: str | None) -> bool:
    """Tell whether a map's places are those of the reference object.

    >>> rests_on_reference("fused"), rests_on_reference("telemetry"), rests_on_reference(None)
    (True, False, False)
    """
    return method is not None and method.startswith(_BY_REFERENCE)
