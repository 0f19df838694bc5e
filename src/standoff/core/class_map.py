"""From the labels that a model was trained with to the classes of the site."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from standoff.core.classes import CLASS_BY_NAME
from standoff.core.errors import ModelError

_SYNONYMS: Final = {
    "worker": ("person", "pedestrian", "people", "human"),
    "excavator": ("digger",),
    "wheel_loader": ("loader",),
    "dump_truck": ("dumper", "tipper"),
    "roller_or_dozer": ("roller", "dozer", "bulldozer", "compactor"),
    "vehicle": ("car", "van", "bus", "truck", "motorbike", "motorcycle"),
}

_LABELS_NAMED: Final = 12
IGNORE: Final = "ignore"
"""In a class map, in place of a class of the site: such a label stands for nothing that is asked for.

A detector's box of it is left out; of a labelled box, neither finding nor missing it is wrong.
"""

DEFAULT_CLASS_MAP: Final[Mapping[str, str]] = MappingProxyType(
    {name: name for name in CLASS_BY_NAME}
    | {synonym: name for name, synonyms in _SYNONYMS.items() for synonym in synonyms}
)
"""Label, in small letters and with underscores, to site class."""


def map_classes(labels: tuple[str, ...], overrides: Mapping[str, str], model: str) -> dict[str, str]:
    """Decide which of a model's labels are which site class.

    Args:
        labels: The model's labels.
        overrides: Label to site class or "ignore"; goes before the default map.
        model: The model, for messages.

    Returns:
        Site class of each label that has one.

    Raises:
        ModelError: An override names no label of the model, or no label is a site class.

    >>> map_classes(("person", "Dump Truck", "kite"), {}, "m.onnx")
    {'person': 'worker', 'Dump Truck': 'dump_truck'}
    """
    unknown = [label for label in overrides if label not in labels]
    if unknown:
        raise ModelError(
            expected=f"labels of {model} in the class map ({_listed(labels)})",
            found=", ".join(f"'{label}'" for label in unknown),
            fix="correct the class map",
        )
    wanted = {
        label: overrides.get(label, DEFAULT_CLASS_MAP.get(label.strip().lower().replace(" ", "_").replace("-", "_")))
        for label in labels
    }
    mapped = {label: name for label, name in wanted.items() if name is not None and name != IGNORE}
    if not mapped:
        raise ModelError(
            expected=f"a label in {model} that is a class of the site ({', '.join(CLASS_BY_NAME)})",
            found=_listed(labels),
            fix="say in a settings file which label is which class, such as "
            f"`detect: {{class_map: {{{labels[0]}: worker}}}}`, and give it with --config",
        )
    return mapped


def _listed(labels: tuple[str, ...]) -> str:
    more = f" and {len(labels) - _LABELS_NAMED} more" if len(labels) > _LABELS_NAMED else ""
    return (", ".join(labels[:_LABELS_NAMED]) or "no label") + more
