"""The base of every struct of arrays: checked once, read-only, sliced as one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Self

import numpy as np
import numpy.typing as npt

Columns = Mapping[str, tuple[type, tuple[int, ...]]]
"""Name of each column: its dtype and the shape of one row."""


class Rows:
    """Struct of arrays with one row per entity. Subclasses list their columns in `_COLUMNS`."""

    __slots__ = ()
    _COLUMNS: ClassVar[Columns]
    _OPTIONAL: ClassVar[frozenset[str]] = frozenset()
    """Columns after the first that may be left out, empty: then numbers are NaN and texts empty in every row."""

    def __post_init__(self) -> None:
        count: int | None = None
        for name, (dtype, tail) in self._COLUMNS.items():
            column: npt.NDArray[Any] = np.array(getattr(self, name), dtype=dtype)
            if column.size == 0 and count and name in self._OPTIONAL:
                column = np.full((count, *tail), "" if dtype is np.object_ else np.nan, dtype=dtype)
            if column.size == 0:
                column = column.reshape(0, *tail)
            if column.shape[1:] != tail or column.ndim != 1 + len(tail):
                raise ValueError(f"{type(self).__name__}.{name} must be (N, {tail}), not {column.shape}")
            if count is not None and len(column) != count:
                raise ValueError(f"{type(self).__name__}.{name} has {len(column)} rows, the others {count}")
            count = len(column)
            column.setflags(write=False)
            object.__setattr__(self, name, column)

    def __len__(self) -> int:
        return len(getattr(self, next(iter(self._COLUMNS))))

    def __getitem__(self, mask: npt.NDArray[np.bool_] | npt.NDArray[np.int64] | slice) -> Self:
        # Rows of what was checked need no second check, which would take longer than all else here.
        part = object.__new__(type(self))
        for name, (_, tail) in self._COLUMNS.items():
            column = getattr(self, name)[mask]
            if np.ndim(column) != 1 + len(tail):
                raise ValueError(f"{type(self).__name__} takes a mask, several rows or a slice, not {mask!r}")
            column.setflags(write=False)
            object.__setattr__(part, name, column)
        return part

    def columns(self) -> dict[str, npt.NDArray[Any]]:
        """Return all columns by name."""
        return {name: getattr(self, name) for name in self._COLUMNS}

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """Return the rows of several structs, one after another."""
        return cls(**{name: np.concatenate([getattr(part, name) for part in parts]) for name in cls._COLUMNS})

    @classmethod
    def empty(cls) -> Self:
        """Return a struct with no rows."""
        return cls(**{name: np.zeros((0, *tail), dtype) for name, (dtype, tail) in cls._COLUMNS.items()})
