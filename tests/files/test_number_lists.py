"""Numbers that other programs wrote: exactly as deep in lists as they are expected."""

from __future__ import annotations

import pytest

from standoff.files.number_lists import number_array


@pytest.mark.parametrize("value", [True, [True, 690], [[1, 2], [False, 3]], None, "1", ["1", 2], {}, [[1, 2], [3]]])
def test_what_is_no_number_is_none(value: object) -> None:
    for axes in range(3):
        with pytest.raises(ValueError, match=r"number|levels|lengths"):
            number_array(value, axes)
