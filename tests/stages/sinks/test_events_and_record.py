from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from stages.sinks.fake_site import FakeSite

from standoff.core.types import Hazard, Outcome
from standoff.stages.sinks import HazardSink, RecordSink
from standoff.stages.sinks.durations import Durations

NAN = float("nan")


def _refuse(constant: str) -> float:
    raise ValueError(f"{constant} is not JSON")


def test_events_are_on_disk_at_once_and_hold_no_nan(tmp_path: Path) -> None:
    sink = HazardSink(tmp_path / "hazards.jsonl")
    expected = 0
    for result in FakeSite((64, 36)).results(90):
        sink.write(result)
        expected += len(result.hazards)
        text = (tmp_path / "hazards.jsonl").read_text()
        assert text.count("\n") == expected
    events = [json.loads(line, parse_constant=_refuse) for line in text.splitlines()]
    unknown = [event for event in events if event["phase"] == "unknown"]
    assert unknown
    assert all(event["distance_m"] is None for event in unknown)
    assert events[0]["classes"] == ["worker", "excavator"]
    assert events[0]["stream_id"] == "site"
    sink.close(Outcome("complete"))


def test_what_the_end_of_the_stream_closes_is_written_with_its_classes(tmp_path: Path) -> None:
    sink = HazardSink(tmp_path / "hazards.jsonl")
    site = FakeSite((64, 36))
    first = site.result(0)
    sink.write(first)
    opened = first.hazards[0]
    closed = Hazard(
        opened.hazard_id, "proximity", "danger", "closed", opened.track_ids, 0.04, NAN, NAN, NAN, "end of stream"
    )
    sink.close(Outcome("complete", hazards=(closed,)))
    last = json.loads((tmp_path / "hazards.jsonl").read_text().splitlines()[-1])
    assert (last["phase"], last["reason"], last["distance_m"]) == ("closed", "end of stream", None)
    assert last["classes"] == ["worker", "excavator"]


def test_the_record_says_running_until_the_end(tmp_path: Path) -> None:
    path = tmp_path / "run.json"
    sink = RecordSink(path, {"configuration": {"detect": {"score": np.float64(0.4), "classes": (1, 2)}}, "x": NAN})
    record = json.loads(path.read_text(), parse_constant=_refuse)
    assert record["status"] == "running"
    assert record["configuration"] == {"detect": {"score": 0.4, "classes": [1, 2]}}
    assert record["x"] is None
    assert {"standoff", "python", "numpy", "av", "onnxruntime", "platform"} <= set(record["versions"])
    sink.close(Outcome("interrupted", "stopped by the operator"))
    assert json.loads(path.read_text())["status"] == "interrupted"
    assert [item.name for item in tmp_path.iterdir()] == ["run.json"]


def test_the_record_counts_what_happened(tmp_path: Path) -> None:
    sink = RecordSink(tmp_path / "run.json", {})
    results = list(FakeSite((64, 36)).results(100))
    for result in results:
        sink.write(result)
    sink.close(Outcome("failed", "model: out of memory", sink_errors={"video": "disk full"}))
    record = json.loads((tmp_path / "run.json").read_text(), parse_constant=_refuse)
    counts = record["counts"]
    assert (record["status"], record["message"]) == ("failed", "model: out of memory")
    assert record["sink_errors"] == {"video": "disk full"}
    assert counts["frames"] == 100
    assert counts["frames_with_map"] == 80
    assert counts["no_ground_map"] == {"reference hidden & <not> found": 20}
    assert counts["invalid_positions"] == {"no ground map": 100, "outside the trusted area": 15}
    assert (counts["tracks"], counts["pairs"]) == (5, 6)
    assert sum(counts["hazards"].values()) == len({e.hazard_id for r in results for e in r.hazards})
    assert record["stages"]["detect"]["median_ms"] == pytest.approx(20.0, rel=0.01)
    assert record["stages"]["ground"]["total_ms"] == pytest.approx(sum(2.0 + i % 3 for i in range(100)))


@given(st.lists(st.floats(0.01, 1e5), min_size=1, max_size=200))
def test_quantiles_of_durations_agree_with_numpy(values: list[float]) -> None:
    durations = Durations()
    for value in values:
        durations.add(value)
    for fraction in (0.5, 0.9):
        expected = float(np.quantile(values, fraction, method="inverted_cdf"))
        assert durations.quantile_ms(fraction) == pytest.approx(expected, rel=0.0101)
