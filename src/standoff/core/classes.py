"""The label set: what can be on a site, how tall, how wide, and how far it reaches.

Heights and footprints are of common machines of each class (20 t excavator, 18 t wheel loader, 25 t
dump truck, 10 t roller, passenger car or van); they are priors, not measurements. The action radii
of worker, wheel loader and excavator are the paper's (section 6.1, Table 6); those of the other
machines are half their length plus 1 m of articulation, which nobody has published.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Final


class Role(Enum):
    """What a class is to the hazard rules."""

    PERSON = "person"
    EQUIPMENT = "equipment"
    REFERENCE = "reference"


@dataclass(frozen=True, slots=True)
class SiteClass:
    """One class of thing on a site.

    Attributes:
        id: Position in `CLASSES`; `class_id` everywhere in standoff, whatever the model's own ids are.
        name: The label.
        role: Person, equipment or reference object.
        height_m: Typical height above the ground.
        length_m: Longer side of the footprint.
        width_m: Shorter side of the footprint.
        action_radius_m: Radius of the struck-by hazard circle around it.
    """

    id: int
    name: str
    role: Role
    height_m: float
    length_m: float
    width_m: float
    action_radius_m: float


CLASSES: tuple[SiteClass, ...] = (
    SiteClass(0, "worker", Role.PERSON, 1.75, 0.6, 0.5, 2.0),
    SiteClass(1, "excavator", Role.EQUIPMENT, 3.0, 9.5, 2.8, 12.1),
    SiteClass(2, "wheel_loader", Role.EQUIPMENT, 3.4, 8.0, 2.7, 5.8),
    SiteClass(3, "dump_truck", Role.EQUIPMENT, 3.3, 8.5, 2.6, 5.3),
    SiteClass(4, "roller_or_dozer", Role.EQUIPMENT, 3.0, 5.5, 2.4, 3.8),
    SiteClass(5, "vehicle", Role.EQUIPMENT, 1.8, 4.8, 1.9, 3.4),
    SiteClass(6, "reference", Role.REFERENCE, 0.0, 0.0, 0.0, 0.0),
)

CAB_WITHIN_M: Final = 2.5
"""Who is so near to the middle of a machine is on it, not beside it."""

_BETWEEN: Final = re.compile(r"[,;|\t]")
_NUMBERED: Final = re.compile(r"(\d{1,6})(?:\s|\s*[:.,;)=-])\s*([^\W\d].*)")
_DRESSED: Final[Mapping[str, re.Pattern[str]]] = {
    "with a comma at its end": re.compile(r".*,"),
    "with a dash before it": re.compile(r"-\s.*"),
    "in quotes": re.compile(r"([\"']).*\1,?"),
    "with a number after it": re.compile(r".*\S\s*[:,;=\t]\s*\d+"),
}
"""Lists in another language's ways, by what its names have about them."""

CLASS_BY_NAME: dict[str, SiteClass] = {site_class.name: site_class for site_class in CLASSES}


def class_ids(role: Role) -> tuple[int, ...]:
    """Return the ids of all classes with a role.

    >>> class_ids(Role.PERSON)
    (0,)
    """
    return tuple(site_class.id for site_class in CLASSES if site_class.role is role)


def names_in_list(names: Iterable[object]) -> tuple[str, ...]:
    """Return the names of a list that a file gave, texts or whole numbers.

    Raises:
        ValueError: One is something else: what the file's language made of it need not be how it was written.

    >>> names_in_list(["no", 7])
    ('no', '7')
    """
    names = tuple(names)
    for name in names:
        if isinstance(name, bool) or not isinstance(name, str | int):
            raise ValueError(f"the name {name!r}, which is no text; put it in quotes")
    if len(names) == 1:
        _refuse_several(str(names[0]))
    return tuple(str(name) for name in names)


def names_by_line(text: str) -> tuple[str, ...]:
    r"""Return the names of a list with one a line; a line's number is the class id, so none may be empty.

    Class ids before the names are left away where they are those of the lines.

    Raises:
        ValueError: A line between two names is empty, or the lines are no plain names; says which.

    >>> names_by_line("worker\nexcavator\n\n"), names_by_line("0 worker\n1 excavator")
    (('worker', 'excavator'), ('worker', 'excavator'))
    """
    names = tuple(line.strip() for line in text.rstrip().splitlines())
    if "" in names:
        raise ValueError(f"an empty line for class id {names.index('')}; write some word for an id that is not used")
    if len(names) == 1:
        _refuse_several(names[0])
    for what, pattern in _DRESSED.items():
        if names and all(pattern.fullmatch(name) for name in names[: max(1, len(names) - 1)]):
            raise ValueError(f"{names[0]!r}, a name {what}; write the names alone")
    numbered = [match for name in names if (match := _NUMBERED.fullmatch(name))]
    ids = [int(match[1]) for match in numbered]
    if ids and ids == list(range(len(names))):
        return tuple(match[2] for match in numbered)
    if ids and sorted(ids) in (list(range(len(names))), list(range(1, len(names) + 1))):
        raise ValueError(f"{names[0]!r} for class id 0, a name after another number; write the names alone, in order")
    return names


def _refuse_several(name: str) -> None:
    if parts := _BETWEEN.findall(name):
        raise ValueError(f"a single name {name!r} with {parts[0]!r} in it: are they several? Write one a line")
