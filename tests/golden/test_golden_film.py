"""What the shipped film gives, from recorded detections, is what it gave before: see `make.py`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.compute as pc
import pyarrow.parquet as pq
import pytest
from golden.make import GOLDEN, HAZARDS, TABLES, replay_film
from tolerances import GOLDEN_REL, GOLDEN_SHARE

START_S = 2.0
"""Of the film, in `make test`; all of it in `make test-live`."""


@pytest.fixture(
    scope="module", params=[pytest.param(START_S, id="start"), pytest.param(None, id="all", marks=pytest.mark.live)]
)
def film(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, float]:
    stop_s: float | None = request.param
    out = tmp_path_factory.mktemp("film")
    replay_film(out, *([] if stop_s is None else ["--stop", str(stop_s)]))
    return out, np.inf if stop_s is None else stop_s


@pytest.mark.parametrize("name", TABLES)
def test_the_tables_of_the_film_are_as_they_were(film: tuple[Path, float], name: str) -> None:
    out, stop_s = film
    before, now = (pq.read_table(folder / f"{name}.parquet") for folder in (GOLDEN, out))
    before = before.filter(pc.less(before["time_s"], stop_s))
    assert len(before) == len(now) > 0
    assert set(before.column_names) <= set(now.column_names)
    for column in before.column_names:
        assert_alike(column, before[column].to_pylist(), now[column].to_pylist())


def assert_alike(column: str, before: list[Any], now: list[Any]) -> None:
    """Compare two columns: words and counts exactly, numbers within a share of what is usual in the column."""
    assert [value is None for value in before] == [value is None for value in now], column
    known = [(one, other) for one, other in zip(before, now, strict=True) if one is not None]
    if not known or np.array(known[0][0]).dtype.kind != "f":
        assert all(one == other for one, other in known), column
        return
    one, other = (np.array([pair[k] for pair in known], dtype=np.float64) for k in (0, 1))
    same = np.isclose(other, one, rtol=GOLDEN_REL, atol=GOLDEN_REL)
    assert same.mean() >= GOLDEN_SHARE, (column, one[~same], other[~same])


def test_the_hazards_of_the_film_are_as_they_were(film: tuple[Path, float]) -> None:
    out, stop_s = film
    before, now = (said(folder / HAZARDS) for folder in (GOLDEN, out))
    ends = [event for event in now if event["reason"] == "end of stream"]
    assert [event for event in now if event not in ends] == [
        event for event in before if event["time_s"] < stop_s and event["reason"] != "end of stream"
    ]


def said(path: Path) -> list[dict[str, Any]]:
    """Return the events without what differs from run to run and from processor to processor."""
    words = ("rule", "severity", "phase", "track_ids", "time_s", "reason", "classes", "frame", "stream_id")
    events = [json.loads(line) for line in path.read_text().splitlines()]
    return [{word: event[word] for word in words} for event in events]
