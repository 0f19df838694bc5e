"""A row of a table as JSON Schema, from the table's Arrow schema."""

from __future__ import annotations

from collections.abc import Callable, Collection
from typing import Any, Final

import pyarrow as pa

_KINDS: Final[tuple[tuple[Callable[[pa.DataType], bool], str], ...]] = (
    (pa.types.is_boolean, "boolean"),
    (pa.types.is_integer, "integer"),
    (pa.types.is_floating, "number"),
    (pa.types.is_string, "string"),
    (pa.types.is_dictionary, "string"),
    (pa.types.is_timestamp, "string"),
    (pa.types.is_list, "array"),
)


def row_schema(schema: pa.Schema, optional: Collection[str] = ()) -> dict[str, Any]:
    """Return what one row is, as an object: times as text (ISO 8601), lists as arrays.

    Args:
        schema: Of the table; each field has its unit and its meaning, which says where it can be null.
        optional: Columns that not every table has.
    """
    return {
        "type": "object",
        "description": "Numbers that were not measured are null; infinity is a number here.",
        "properties": {field.name: column_schema(field) for field in schema},
        "required": [name for name in schema.names if name not in optional],
    }


def column_schema(field: pa.Field) -> dict[str, Any]:
    """Return what one value of a column is.

    >>> column_schema(pa.field("gap_m", pa.float64(), metadata={"unit": "m", "description": "null: unknown"}))
    {'type': ['number', 'null'], 'description': 'null: unknown', 'unit': 'm'}
    """
    said = {key.decode(): text.decode() for key, text in (field.metadata or {}).items()}
    meaning, unit = said.get("description", ""), said.get("unit", "")
    kind = _kind(field.type)
    return {
        "type": [kind, "null"] if "null" in meaning else kind,
        **({"format": "date-time"} if pa.types.is_timestamp(field.type) else {}),
        **({"items": {"type": _kind(field.type.value_type)}} if kind == "array" else {}),
        "description": meaning,
        **({"unit": unit} if unit else {}),
    }


def _kind(arrow: pa.DataType) -> str:
    return next(kind for is_it, kind in _KINDS if is_it(arrow))
