from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from standoff.drawing.painter import Painter
from standoff.drawing.palette import bgr
from standoff.drawing.text import TextSprites

TEXT = TextSprites()


@given(
    st.lists(st.tuples(st.floats(-1e9, 1e9), st.floats(-1e9, 1e9)), min_size=2, max_size=6),
    st.booleans(),
)
def test_no_point_is_too_far_to_be_drawn(points: list[tuple[float, float]], dashed: bool) -> None:
    canvas = np.zeros((90, 160, 3), dtype=np.uint8)
    painter = Painter(canvas, TEXT)
    outline = np.array(points)
    painter.cased_line(outline, bgr("danger"), dashed=dashed)
    painter.fill(outline, bgr("danger"), 0.5)
    painter.dot(outline[0].tolist(), bgr("danger"))
    painter.box([*outline.min(axis=0), *outline.max(axis=0)], bgr("danger"), dashed=dashed)
    painter.label("far", [(x, y) for x, y in points])
    assert canvas.any()


def test_labels_do_not_cover_each_other() -> None:
    painter = Painter(np.zeros((200, 400, 3), dtype=np.uint8), TEXT)
    corners = [(10.0, 10.0), (10.0, 60.0), (200.0, 10.0)]
    for name in ("one", "two", "three", "four"):
        painter.label(name, corners, optional=True)
    taken = painter._taken
    assert len(taken) == 3
    assert all(a[2] <= b[0] or a[3] <= b[1] or b[2] <= a[0] or b[3] <= a[1] for a in taken for b in taken if a is not b)
    painter.label("danger", corners)
    assert len(taken) == 4
