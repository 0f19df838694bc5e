from __future__ import annotations

import numpy as np
import pytest

from standoff.labels.marking import would_be_marked


@pytest.mark.parametrize(
    ("side_px", "visible_px", "visible_share", "marked"),
    [
        (20.0, 200.0, 1.0, True),
        (5.0, 20.0, 1.0, False),
        (20.0, 15.0, 1.0, False),
        (60.0, 400.0, 0.1, False),
        (60.0, 1600.0, 0.1, True),
    ],
)
def test_small_and_hidden_things_are_not_marked(
    side_px: float, visible_px: float, visible_share: float, marked: bool
) -> None:
    box_px = np.array([[10.0, 10.0, 12.0, 10.0 + side_px]])
    assert would_be_marked(box_px, np.array([visible_px]), np.array([visible_share])).tolist() == [marked]


def test_nothing_is_nothing() -> None:
    assert would_be_marked(np.empty((0, 4)), np.empty(0), np.empty(0)).shape == (0,)
