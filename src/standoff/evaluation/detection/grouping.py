"""Score several classes as one, or leave some out, on truth and detections alike."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np

from standoff.core.classes import CLASSES, Role
from standoff.core.errors import ConfigError
from standoff.core.homography import BoolArray
from standoff.core.types import Detections, IntArray
from standoff.labels.types import LabelledPicture

MACHINE = "machine"
_GONE = -1


@dataclass(frozen=True, slots=True, eq=False)
class Grouping:
    """What becomes of each of the site's classes.

    Attributes:
        classes: Names afterwards.
        position: (C,) position of each of `CLASSES` among them; -1 for those that are not scored.
        ignored: (C,) True where a truth of the class becomes a region in which nothing counts; a truth that is
            neither scored nor ignored is background.
    """

    classes: tuple[str, ...]
    position: IntArray
    ignored: BoolArray

    def truth(self, picture: LabelledPicture) -> LabelledPicture:
        """Return what is to be found in a picture labelled with the site's classes."""
        ignored = picture.ignored | self.ignored[picture.class_id]
        position = np.where(ignored, 0, self.position[picture.class_id])
        kept = ignored | (position != _GONE)
        return replace(
            picture,
            xyxy_px=picture.xyxy_px[kept],
            class_id=position[kept].astype(np.int64),
            ignored=ignored[kept],
            foot_px=picture.foot_px[kept],
        )

    def found(self, detections: Detections) -> Detections:
        """Return the detections that are scored.

        Two boxes of one thing under two names that are scored as one stay two, the second of them a false alarm: the
        monitor would show both.
        """
        position = self.position[detections.class_id]
        return replace(detections, class_id=np.maximum(position, 0))[position != _GONE]

    def members(self, name: str) -> tuple[str, ...]:
        """Return the site's classes that are scored under a name."""
        where = self.classes.index(name)
        return tuple(site_class.name for site_class in CLASSES if self.position[site_class.id] == where)


def site_grouping(*, merge_machines: bool = False, without: Collection[str] = ()) -> Grouping:
    """Decide what is scored.

    Args:
        merge_machines: All equipment is one class, "machine", beside the worker; the reference object is background.
        without: Names of classes that are not scored: their truths are ignored regions, their detections dropped.

    Raises:
        ConfigError: `without` names no class of the site, or leaves none.

    >>> site_grouping(merge_machines=True).classes
    ('worker', 'machine')
    """
    known = [site_class.name for site_class in CLASSES]
    unknown = [name for name in without if name not in known]
    if unknown:
        raise ConfigError(
            expected=f"classes of the site ({', '.join(known)})", found=", ".join(unknown), fix="correct --without"
        )
    scored_as = {site_class.name: site_class.name for site_class in CLASSES if site_class.name not in without}
    if merge_machines:
        machines = {site_class.name for site_class in CLASSES if site_class.role is Role.EQUIPMENT}
        people = {site_class.name for site_class in CLASSES if site_class.role is Role.PERSON}
        scored_as = {name: MACHINE if name in machines else name for name in scored_as if name in machines | people}
    if not scored_as:
        raise ConfigError(expected="a class to score", found="none left", fix="leave out fewer with --without")
    classes = tuple(dict.fromkeys(scored_as.values()))
    return Grouping(
        classes=classes,
        position=np.array([classes.index(scored_as[name]) if name in scored_as else _GONE for name in known]),
        ignored=np.array([name in without for name in known]),
    )
