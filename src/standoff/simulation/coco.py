"""COCO annotations of what is visible in a picture."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from standoff.core.classes import CLASSES
from standoff.simulation.truth import IdArray, Row, mask_counts

CATEGORIES: list[dict[str, Any]] = [
    {"id": site_class.id + 1, "name": site_class.name, "supercategory": site_class.role.value} for site_class in CLASSES
]
"""COCO counts categories from 1: a category's id is the class id plus one."""


class Annotations:
    """Collect the annotations of picture after picture."""

    def __init__(self) -> None:
        self._images: list[dict[str, Any]] = []
        self._annotations: list[dict[str, Any]] = []

    def add(
        self, image: dict[str, Any], entities: Sequence[Row], size_px: tuple[int, int], ids: IdArray | None
    ) -> None:
        """Add a picture.

        Args:
            image: COCO's own fields less `id`, `width` and `height`.
            entities: Rows of `truth.TRUTH_SCHEMA`.
            size_px: (width, height).
            ids: (H, W) id picture for masks, or None to leave them out.
        """
        image_id = len(self._images) + 1
        self._images.append({"id": image_id, "width": size_px[0], "height": size_px[1], **image})
        self._annotations += [
            self._annotation(len(self._annotations) + number, image_id, row, ids)
            for number, row in enumerate((row for row in entities if row["visible_px"]), start=1)
        ]

    def _annotation(self, number: int, image_id: int, row: Row, ids: IdArray | None) -> dict[str, Any]:
        left, top, right, bottom = (row[f"{name}_px"] for name in ("x1", "y1", "x2", "y2"))
        annotation: dict[str, Any] = {
            "id": number,
            "image_id": image_id,
            "category_id": row["class_id"] + 1,
            # COCO counts from the corner of the top-left pixel, standoff from its centre
            "bbox": [left + 0.5, top + 0.5, right - left, bottom - top],
            "area": row["visible_px"],
            "iscrowd": 0,
            "entity_id": row["entity_id"],
            "visible_share": round(row["visible_share"], 4),
        }
        if ids is not None:
            annotation["segmentation"] = mask_counts(ids, row["entity_id"])
        return annotation

    def to_dict(self, description: str) -> dict[str, Any]:
        """Return everything in COCO's layout."""
        return {
            "info": {"description": description, "version": "1"},
            "licenses": [],
            "categories": CATEGORIES,
            "images": self._images,
            "annotations": self._annotations,
        }
