"""COCO annotations of what is visible in a picture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from standoff.core.classes import CLASSES
from standoff.labels.coco_document import CocoDocument
from standoff.simulation.truth import IdArray, Row, mask_counts


class Annotations:
    """Collect the annotations of picture after picture."""

    def __init__(self) -> None:
        self._document = CocoDocument(
            [{"name": site_class.name, "supercategory": site_class.role.value} for site_class in CLASSES]
        )

    def add(
        self, image: Mapping[str, Any], entities: Sequence[Row], size_px: tuple[int, int], ids: IdArray | None
    ) -> None:
        """Add a picture.

        Args:
            image: COCO's own fields less `id`, `width` and `height`.
            entities: Rows of `truth.TRUTH_SCHEMA`.
            size_px: (width, height).
            ids: (H, W) id picture for masks, or None to leave them out.
        """
        self._document.add_picture(size_px, image)
        for row in entities:
            if not row["visible_px"]:
                continue
            fields = {"entity_id": row["entity_id"], "visible_share": round(row["visible_share"], 4)}
            if ids is not None:
                fields["segmentation"] = mask_counts(ids, row["entity_id"])
            corners_px = [row[f"{name}_px"] for name in ("x1", "y1", "x2", "y2")]
            self._document.add_box(row["class_id"], corners_px, row["visible_px"], fields)

    def to_dict(self, description: str) -> dict[str, Any]:
        """Return everything in COCO's layout."""
        return self._document.to_dict(description)
