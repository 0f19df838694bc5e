"""Columns of tables that may be damaged."""

from __future__ import annotations

import pyarrow as pa


def column_names(table: pa.Table) -> frozenset[str]:
    """Return the names of a table's columns; none of them where one is no text, as in a damaged file."""
    try:
        return frozenset(table.column_names)
    except UnicodeDecodeError:
        return frozenset()
