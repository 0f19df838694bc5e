"""What the detector is sure of and no track shows is said everywhere."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import yaml
from cli.calling import Call
from cli.test_cli import make_video

from standoff.core import protocols
from standoff.core.protocols import AnyGround, AnyMotion
from standoff.core.types import Detections, Tracks


@pytest.fixture
def video(tmp_path: Path) -> Path:
    return make_video(tmp_path / "site.mp4", 34)


class BlindTracker(protocols.Tracker):
    """A tracker that follows nobody."""

    def update(self, time_s: float, detections: Detections, motion: AnyMotion, ground: AnyGround) -> Tracks:
        return Tracks.empty()

    def coast(self, time_s: float, motion: AnyMotion) -> Tracks:
        return Tracks.empty()


def test_what_the_detector_is_sure_of_and_no_track_shows_is_said_everywhere(
    call: Call, video: Path, site: Path, tmp_path: Path
) -> None:
    settings = yaml.safe_load(site.read_text())
    settings["replace"] = settings.get("replace", {}) | {"track": {"factory": "cli.test_unfollowed:BlindTracker"}}
    site.write_text(yaml.safe_dump(settings), encoding="utf-8")
    code, _, err = call("run", video, "--config", site, "--out", tmp_path / "out", "--quiet", "--outputs", "hazards")
    assert code == 1
    assert "warning: 68 of 68 sure detections are in no track" in err
    record = json.loads((tmp_path / "out" / "run.json").read_text())
    assert record["counts"]["sure_detections"] == record["counts"]["unfollowed_detections"] == 68
    assert any("68 of 68" in warning for warning in record["warnings"])
    events = [json.loads(line) for line in (tmp_path / "out" / "hazards.jsonl").read_text().splitlines()]
    assert [(event["rule"], event["phase"]) for event in events] == [
        ("measurement", "opened"),
        ("measurement", "closed"),
    ]
