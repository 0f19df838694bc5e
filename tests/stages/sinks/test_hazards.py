from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

from stages.sinks.fake_site import FakeSite

from standoff.core.types import Hazard, Outcome
from standoff.stages.sinks import HazardSink

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


def test_what_the_end_of_the_stream_opens_says_its_classes_too(tmp_path: Path) -> None:
    sink = HazardSink(tmp_path / "hazards.jsonl")
    result = replace(FakeSite((64, 36)).result(0), hazards=())
    sink.write(result)
    late = Hazard("H1", "proximity", "danger", "opened", (2, 3), 0.0, 1.0, -1.0, 0.1)
    sink.close(Outcome("complete", hazards=(late, replace(late, phase="closed"))))
    lines = [json.loads(line) for line in (tmp_path / "hazards.jsonl").read_text().splitlines()]
    assert [line["classes"] for line in lines] == [["worker", "excavator"]] * 2
