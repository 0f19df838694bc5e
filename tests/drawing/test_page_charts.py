from __future__ import annotations

import pytest

from standoff.core.lengths import FEET, METRES, LengthUnit
from standoff.drawing.page_charts import read_in, themed_figure


@pytest.mark.parametrize("unit", [METRES, FEET])
def test_an_axis_is_marked_where_the_number_lies(unit: LengthUnit) -> None:
    with themed_figure(6.0, 4.0) as figure:
        axes = figure.add_subplot()
        axes.set_ylim(-7.3, 61.0)
        read_in(axes.yaxis, unit, "gap")
        figure.draw_without_rendering()
        ticks = list(axes.get_yticks())
        labels = [label.get_text().replace("\N{MINUS SIGN}", "-") for label in axes.get_yticklabels()]
    assert axes.get_ylabel() == f"gap, {unit.symbol}"
    assert len(ticks) >= 4
    for place_m, text in zip(ticks, labels, strict=True):
        assert float(text) * unit.in_m == pytest.approx(place_m, abs=1e-9)
        assert len(text.strip("-")) <= 4  # round in the unit that is read


def test_in_metres_axes_are_marked_as_matplotlib_does() -> None:
    with themed_figure(6.0, 4.0) as figure:
        own, plain = figure.subplots(1, 2)
        for axes in (own, plain):
            axes.set_ylim(-7.3, 61.7)
        read_in(own.yaxis, METRES, "gap")
        figure.draw_without_rendering()
        assert [one.get_text() for one in own.get_yticklabels()] == [one.get_text() for one in plain.get_yticklabels()]
