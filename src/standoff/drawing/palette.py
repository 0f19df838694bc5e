"""The colours of every output, in one place, so that red means the same in the video and in the report."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Literal

from standoff.core.classes import CLASSES, Role

Bgr = tuple[int, int, int]
Tone = Literal["danger", "warning", "unknown", "worker", "machine", "reference", "zone", "light", "dark"]

HEX: Mapping[Tone, str] = MappingProxyType(
    {
        "danger": "#f5484a",
        "warning": "#ffb224",
        "unknown": "#a3abb5",
        "worker": "#1fc7b6",
        "machine": "#6ea8ff",
        "reference": "#c9a2ff",
        "zone": "#ff86d3",
        "light": "#f4f6f8",
        "dark": "#14181d",
    }
)

_BGR: Mapping[Tone, Bgr] = MappingProxyType(
    {tone: (int(code[5:7], 16), int(code[3:5], 16), int(code[1:3], 16)) for tone, code in HEX.items()}
)


def bgr(tone: Tone) -> Bgr:
    """Return a colour for OpenCV.

    >>> bgr("danger")
    (74, 72, 245)
    """
    return _BGR[tone]


def class_tone(class_id: int) -> Tone:
    """Return the colour of an entity that is in no hazard.

    >>> class_tone(1)
    'machine'
    """
    tones: dict[Role, Tone] = {Role.PERSON: "worker", Role.EQUIPMENT: "machine", Role.REFERENCE: "reference"}
    return tones[CLASSES[class_id].role]
