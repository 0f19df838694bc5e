"""COCO annotations of what is visible in a picture."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from standoff.core.classes import CLASSES
from standoff.labels.coco_document import CocoDocument
from standoff.labels.ground_points import KEYPOINT
from standoff_sim.clip.truth import IdArray, Row, mask_counts


class Annotations:
    """Collect the annotations of picture after picture."""

    def __init__(self) -> None:
        self._document = CocoDocument(
            [
                {
                    "name": site_class.name,
                    "supercategory": site_class.role.value,
                    "keypoints": [KEYPOINT],
                    "skeleton": [],
                }
                for site_class in CLASSES
            ]
        )

    def add(
        self, image: Mapping[str, Any], entities: Sequence[Row], size_px: tuple[int, int], ids: IdArray | None
    ) -> None:
        """Add a picture.

        Args:
            image: COCO's own fields less `id`, `width` and `height`.
            entities: Rows of `standoff.clips.TRUTH_SCHEMA`.
            size_px: (width, height).
            ids: (H, W) id picture for masks, or None to leave them out.
        """
        self._document.add_picture(size_px, image)
        for row in entities:
            if not row["visible_px"]:
                continue
            fields: dict[str, Any] = {"entity_id": row["entity_id"], "visible_share": round(row["visible_share"], 4)}
            fields |= _keypoint(row["foot_x_px"], row["foot_y_px"], size_px)
            if ids is not None:
                fields["segmentation"] = mask_counts(ids, row["entity_id"])
            corners_px = [row[f"{name}_px"] for name in ("x1", "y1", "x2", "y2")]
            self._document.add_box(row["class_id"], corners_px, row["visible_px"], fields)

    def to_dict(self, description: str) -> dict[str, Any]:
        """Return everything in COCO's layout."""
        return self._document.to_dict(description)


def _keypoint(x_px: float, y_px: float, size_px: tuple[int, int]) -> dict[str, Any]:
    """Return COCO's fields of the ground point: not marked (0), outside the picture (1) or in it (2)."""
    if not (math.isfinite(x_px) and math.isfinite(y_px)):
        return {"keypoints": [0, 0, 0], "num_keypoints": 0}
    inside = 0 <= x_px + 0.5 <= size_px[0] and 0 <= y_px + 0.5 <= size_px[1]
    return {"keypoints": [round(x_px + 0.5, 3), round(y_px + 0.5, 3), 2 if inside else 1], "num_keypoints": 1}
