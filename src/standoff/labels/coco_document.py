"""Build an annotation file in COCO's layout."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any


class CocoDocument:
    """Collect pictures and boxes; COCO counts all its ids from 1.

    Args:
        categories: Fields of each class (`name`; `supercategory` and `keypoints`, if there are any), in the order
            of class ids.
    """

    def __init__(self, categories: Sequence[Mapping[str, Any]]) -> None:
        self._categories = [{"id": number, **category} for number, category in enumerate(categories, start=1)]
        self._images: list[dict[str, Any]] = []
        self._annotations: list[dict[str, Any]] = []

    def add_picture(self, size_px: tuple[int, int], fields: Mapping[str, Any]) -> None:
        """Add a picture, to which the boxes that follow belong.

        Args:
            size_px: (width, height).
            fields: `file_name`, and whatever else is to be said.
        """
        number = len(self._images) + 1
        self._images.append({"id": number, "width": size_px[0], "height": size_px[1], **fields})

    def add_box(
        self, class_id: int, xyxy_px: Sequence[float], area_px: float, fields: Mapping[str, Any] | None = None
    ) -> None:
        """Add a box to the last picture.

        Args:
            class_id: Position in the categories.
            xyxy_px: Left, top, right, bottom; 0 is the centre of the first pixel.
            area_px: Of what is visible.
            fields: Whatever else is to be said.
        """
        left, top, right, bottom = xyxy_px
        self._annotations.append(
            {
                "id": len(self._annotations) + 1,
                "image_id": len(self._images),
                "category_id": class_id + 1,
                # COCO counts from the corner of the top-left pixel, standoff from its centre
                "bbox": [left + 0.5, top + 0.5, right - left, bottom - top],
                "area": area_px,
                "iscrowd": 0,
                **(fields or {}),
            }
        )

    def to_dict(self, description: str) -> dict[str, Any]:
        """Return everything in COCO's layout."""
        return {
            "info": {"description": description, "version": "1"},
            "licenses": [],
            "categories": self._categories,
            "images": self._images,
            "annotations": self._annotations,
        }
