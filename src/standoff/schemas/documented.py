"""A documented dataclass as JSON Schema: types from its annotations, meanings from its docstring."""

from __future__ import annotations

import inspect
import re
from collections.abc import Collection
from dataclasses import fields
from typing import Any, get_type_hints

from pydantic import TypeAdapter


def attribute_meanings(documented: type) -> dict[str, str]:
    """Return what a class's docstring says of each of its attributes; nothing where docstrings are stripped.

    >>> from standoff.core.hazards import Hazard
    >>> attribute_meanings(Hazard)["time_s"]
    'Presentation timestamp.'
    """
    text = inspect.getdoc(documented) or ""
    _, _, section = text.partition("\nAttributes:\n")
    lines = section.partition("\n\n")[0]
    found = re.findall(r"^    (\w+): (.*(?:\n {8}.*)*)", lines, re.MULTILINE)
    return {name: " ".join(meaning.split()) for name, meaning in found}


def dataclass_properties(documented: type, names: Collection[str] | None = None) -> dict[str, Any]:
    """Return the schema of each field as JSON holds it; numbers that can be NaN are null where they are.

    Args:
        documented: A dataclass that is documented field by field.
        names: Of the fields; None: all.
    """
    hints, meanings = get_type_hints(documented), attribute_meanings(documented)
    chosen = [field.name for field in fields(documented) if names is None or field.name in names]
    return {name: _value(hints[name], meanings.get(name, "")) for name in chosen}


def number(meaning: str) -> dict[str, Any]:
    """Return the schema of a number whose meaning says where it is NaN, if anywhere: there JSON has null.

    >>> number("Mean share; NaN without frames.")
    {'type': ['number', 'null'], 'description': 'Mean share; null without frames.'}
    """
    return _value(float, meaning)


def _value(hint: Any, meaning: str) -> dict[str, Any]:  # noqa: ANN401
    made = TypeAdapter(hint).json_schema(mode="serialization")
    if hint is float and "NaN" in meaning:
        made["type"] = ["number", "null"]
    return {**made, "description": meaning.replace("NaN", "null")}
