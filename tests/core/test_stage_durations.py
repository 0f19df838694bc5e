from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from standoff.core.stage_durations import Durations


@given(st.lists(st.floats(0.01, 1e5), min_size=1, max_size=200))
def test_quantiles_of_durations_agree_with_numpy(values: list[float]) -> None:
    durations = Durations()
    for value in values:
        durations.add(value)
    for fraction in (0.5, 0.9):
        expected = float(np.quantile(values, fraction, method="inverted_cdf"))
        assert durations.quantile_ms(fraction) == pytest.approx(expected, rel=0.0101)
