"""Labelled pictures under the classes of the site, whatever their own are called."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from standoff.core.class_map import map_classes
from standoff.core.classes import CLASS_BY_NAME, CLASSES
from standoff.core.errors import DataError, ModelError
from standoff.labels.types import LabelledData, LabelledPicture


def to_site_classes(data: LabelledData) -> LabelledData:
    """Rename classes to those of the site ("person" is a worker), and drop boxes of anything else.

    What a detector finds where a box was dropped is a false alarm: a tree is not a worker.

    Returns:
        The same pictures; class ids are those of `standoff.core.classes.CLASSES`.

    Raises:
        DataError: None of the classes is one of the site.
    """
    names = site_names(data.classes, fix="map them in the `class_map` of a mixture file")
    ids = np.array([CLASS_BY_NAME[names[name]].id if name in names else -1 for name in data.classes])

    def renamed(picture: LabelledPicture) -> LabelledPicture:
        class_id = ids[picture.class_id]
        kept = picture.ignored | (class_id >= 0)
        return replace(
            picture,
            xyxy_px=picture.xyxy_px[kept],
            class_id=np.maximum(class_id[kept], 0),
            ignored=picture.ignored[kept],
            foot_px=picture.foot_px[kept],
        )

    splits = {split: tuple(map(renamed, pictures)) for split, pictures in data.splits.items()}
    return replace(data, classes=tuple(site_class.name for site_class in CLASSES), splits=splits)


def site_names(labels: tuple[str, ...], *, fix: str) -> dict[str, str]:
    """Return the class of the site of each label that means one.

    Args:
        labels: Of labelled pictures.
        fix: What to do where none does, for messages.

    Raises:
        DataError: None does.
    """
    try:
        return map_classes(labels, {}, "the labelled pictures")
    except ModelError as error:
        raise DataError(expected=error.expected, found=error.found, fix=fix) from error
