from __future__ import annotations

import html
import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
import pyarrow.parquet as pq
import pytest
import yaml
from cli.calling import Call
from laws import few
from pages import PageReader

from standoff.core import protocols
from standoff.core.errors import GroundError
from standoff.core.protocols import AnyMotion
from standoff.core.types import Detections, Frame, NoGroundMap

OUTPUTS = {
    "run.json", "tracks.parquet", "proximity.parquet", "frames.parquet", "detections.parquet", "hazards.jsonl",
    "annotated.mp4",
}  # fmt: skip


FINDS = {"finds_workers": {"height_px": [4.0, 8.0, 16.0], "share": [0.5, 0.95, 0.95]}}
"""What a detector says of itself that finds workers seen from straight above in a small picture."""


class Approach(protocols.Detector):
    """A detector that sees a worker walk towards an excavator."""

    def describe(self) -> Mapping[str, Any]:
        return FINDS

    def detect(self, frame: Frame) -> Detections:
        left = 20.0 + 60.0 * frame.time_s
        boxes = np.array([[left, 100.0, left + 12.0, 130.0], [240.0, 90.0, 300.0, 140.0]])
        return Detections(boxes, np.array([0.9, 0.9]), np.array([0, 1]))


@pytest.fixture
def video(tmp_path: Path) -> Path:
    return make_video(tmp_path / "site.mp4", 34)


def make_video(path: Path, frames: int) -> Path:
    with av.open(str(path), "w") as container:
        stream = container.add_stream("mpeg4", rate=10)
        stream.width, stream.height, stream.pix_fmt = 320, 240, "yuv420p"
        # Without texture nobody could tell whether the camera stands still, which is a warning.
        soil = cv2.resize(np.random.default_rng(0).integers(60, 150, (60, 80, 3), np.uint8), (320, 240))
        for index in range(frames):
            picture = soil + np.uint8(index % 50)
            for packet in stream.encode(av.VideoFrame.from_ndarray(picture, format="bgr24")):
                container.mux(packet)
        for packet in stream.encode():
            container.mux(packet)
    return path


def test_a_run_writes_every_output_and_finds_the_hazard(call: Call, video: Path, site: Path, tmp_path: Path) -> None:
    code, out, err = call("run", video, "--config", site, "--out", tmp_path / "out")
    assert (code, err) == (0, "")
    assert "complete" in out
    assert re.search(r"ground watched +\d+ %", out)
    assert {path.name for path in (tmp_path / "out").iterdir()} == OUTPUTS | {"report.html"}
    distances = pq.read_table(tmp_path / "out" / "proximity.parquet").to_pydict()
    expected_m = (270.0 - (26.0 + 60.0 * np.array(distances["time_s"]))) / 20.0
    feet_m = (140.0 - 130.0) / 20.0
    assert distances["distance_m"] == pytest.approx(np.hypot(expected_m, feet_m), abs=0.35)
    events = [json.loads(line) for line in (tmp_path / "out" / "hazards.jsonl").read_text().splitlines()]
    assert [events[0]["phase"], events[-1]["phase"]] == ["opened", "closed"]
    assert len({event["hazard_id"] for event in events}) == 1
    assert "danger" in {event["severity"] for event in events}
    record = json.loads((tmp_path / "out" / "run.json").read_text())
    assert record["status"] == "complete"
    assert record["counts"]["frames"] == record["counts"]["frames_with_map"] == 34
    assert record["watched"] == {
        "worker_height_px": [4.0, 8.0, 16.0],
        "found_share": [0.5, 0.95, 0.95],
        "measured": True,
        "warnings": [],
    }
    assert record["watched_ground"]["share"] > 0.9
    assert record["settings"]["locate"]["radius_m"] == {"worker": 1.0, "excavator": 3.0}


def test_what_is_lost_of_a_film_while_it_is_read_is_told_at_the_end_and_in_the_record(
    call: Call, video: Path, site: Path, tmp_path: Path
) -> None:
    double = tmp_path / "double.mkv"
    with av.open(str(video)) as source, av.open(str(double), "w") as target:
        stream = target.add_stream_from_template(source.streams.video[0])
        for number, packet in enumerate(packet for packet in source.demux(video=0) if packet.dts is not None):
            if number == 20:
                packet.pts, packet.dts = packet.pts - packet.duration, packet.dts - packet.duration
            packet.stream = stream
            target.mux_one(packet)
    code, _, err = call("run", double, "--config", site, "--outputs", "frames", "--out", tmp_path / "out")
    record = json.loads((tmp_path / "out" / "run.json").read_text(encoding="utf-8"))
    warning = "double.mkv: 1 frame is skipped, of a time that is not later (1.900 s after 1.900 s at frame 20)"
    assert (code, err) == (0, f"standoff: warning: {warning}\n")
    assert record["warnings"] == [warning]
    assert (record["source"]["skipped_frames"], record["counts"]["frames"]) == (1, 33)


def test_the_record_says_which_telemetry_was_used_and_where_it_does_not_fit(
    call: Call, video: Path, site: Path, tmp_path: Path
) -> None:
    readings = "HOME(9.0,45.0)\nGPS(9.0,45.0,9) BAROMETER:30.0\n\n"
    blocks = (f"{k}\n00:00:0{k},000 --> 00:00:0{k + 1},000\n{readings}" for k in (0, 1))
    (tmp_path / "site.srt").write_text("".join(blocks), encoding="utf-8")
    options = ("--config", site, "--outputs", "frames", "--overwrite", "--out", tmp_path / "out")
    code, _, err = call("run", video, *options)
    record = json.loads((tmp_path / "out" / "run.json").read_text(encoding="utf-8"))
    assert (code, err) == (0, "")
    assert record["source"]["telemetry"]["origin"] == "site.srt"
    assert record["source"]["telemetry"]["readings"] == ["height_m", "latitude_deg", "longitude_deg"]
    video.rename(tmp_path / "other.mp4")
    make_video(tmp_path / "site.mp4", 60)
    code, _, err = call("run", video, *options)
    record = json.loads((tmp_path / "out" / "run.json").read_text(encoding="utf-8"))
    warning = "site.srt: it covers 0.0 to 2.0 s of a film of 6.0 s"
    assert (code, err) == (0, f"standoff: warning: {warning}\n")
    assert record["warnings"] == [warning]
    code, _, err = call("run", video, *options, "--telemetry", "none")
    record = json.loads((tmp_path / "out" / "run.json").read_text(encoding="utf-8"))
    assert (code, err, record["source"]["telemetry"]) == (0, "", {"origin": "none"})
    code, _, err = call("run", video, *options, "--telemetry", site)
    assert code == 2
    assert "site.yaml is not used" in err


def test_json_prints_the_record_and_nothing_else(call: Call, video: Path, site: Path, tmp_path: Path) -> None:
    code, out, err = call("run", video, "--config", site, "--out", tmp_path / "out", "--json", "--outputs", "frames")
    assert (code, err) == (0, "")
    assert json.loads(out)["status"] == "complete"


def test_quiet_prints_nothing(call: Call, video: Path, site: Path, tmp_path: Path) -> None:
    assert call("run", video, "--config", site, "--out", tmp_path / "out", "--quiet") == (0, "", "")


@pytest.mark.parametrize("outputs", few(["", "report", "hazards", "tracks,proximity"], quick=2))
def test_every_output_is_optional(call: Call, video: Path, site: Path, tmp_path: Path, outputs: str) -> None:
    code, _, _ = call("run", video, "--config", site, "--out", tmp_path / "out", "--outputs", outputs)
    files = {path.stem for path in (tmp_path / "out").iterdir()}
    assert code == 0
    assert files == {"run", *filter(None, outputs.split(","))}


def test_start_stop_and_every_choose_the_frames(call: Call, video: Path, site: Path, tmp_path: Path) -> None:
    words = ("--start", 1.0, "--stop", 2.0, "--every", 2, "--outputs", "frames")
    assert call("run", video, "--config", site, "--out", tmp_path / "out", *words)[0] == 0
    assert pq.read_table(tmp_path / "out" / "frames.parquet")["frame"].to_pylist() == [10, 12, 14, 16, 18]


def test_a_run_in_which_nothing_could_be_measured_is_not_a_success(
    call: Call, video: Path, site: Path, tmp_path: Path
) -> None:
    words = ("--ground", "none", "--outputs", "frames,proximity")
    code, _, err = call("run", video, "--config", site, "--out", tmp_path / "out", *words)
    assert code == 1
    assert "no frame could be measured" in err
    table = pq.read_table(tmp_path / "out" / "proximity.parquet").to_pydict()
    assert table["distance_m"] and set(table["distance_m"]) == {None}
    assert not any(table["measured"])
    reasons = pq.read_table(tmp_path / "out" / "frames.parquet")["map_reason"].to_pylist()
    assert set(reasons) == {"no ground is configured"}


def test_a_survey_in_centimetres_is_told_at_the_end_and_measures_no_longer(
    call: Call, video: Path, site: Path, tmp_path: Path
) -> None:
    survey = yaml.safe_load((tmp_path / "survey.yaml").read_text(encoding="utf-8"))
    for point in survey["points"]:
        point["m"] = [100.0 * metre for metre in point["m"]]
    (tmp_path / "survey.yaml").write_text(yaml.safe_dump(survey), encoding="utf-8")
    words = ("--config", site, "--out", tmp_path / "out", "--outputs", "report", "--quiet")
    code, _, err = call("run", video, *words)
    record = json.loads((tmp_path / "out" / "run.json").read_text(encoding="utf-8"))
    assert (code, err.count("\n")) == (0, 1)
    assert "people and machines look" in err and "times too large: " in err
    assert len(record["warnings"]) == 1 and record["warnings"][0] in err
    assert any("times too large: " in reason for reason in record["counts"]["no_ground_map"])
    assert record["warnings"][0] in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")


def test_with_nothing_told_a_run_measures_or_says_what_would_help(
    call: Call, video: Path, site: Path, tmp_path: Path
) -> None:
    code, _, err = call("run", video, "--config", site, "--ground", "auto", "--out", tmp_path / "out", "--quiet")
    record = json.loads((tmp_path / "out" / "run.json").read_text(encoding="utf-8"))
    assert (code, "no frame could be measured" in err) == (1, True)
    assert all("would help" in reason for reason in record["counts"]["no_ground_map"])
    assert record["ground"]["basis"].startswith("nothing: too few people")
    assert html.escape(record["ground"]["basis"]).replace("&#x27;", "&#39;") in (
        tmp_path / "out" / "report.html"
    ).read_text(encoding="utf-8")


def test_a_second_run_into_the_same_folder_needs_overwrite(call: Call, video: Path, site: Path, tmp_path: Path) -> None:
    words = ("run", video, "--config", site, "--out", tmp_path / "out", "--outputs", "tracks", "--quiet")
    assert call(*words)[0] == 0
    before = (tmp_path / "out" / "run.json").read_text()
    code, _, err = call(*words)
    assert code == 2
    assert "--overwrite" in err
    assert (tmp_path / "out" / "run.json").read_text() == before
    assert call(*words, "--overwrite")[0] == 0


def test_a_truncated_video_keeps_what_was_read_and_says_that_it_is_not_all(
    call: Call, video: Path, site: Path, tmp_path: Path
) -> None:
    whole = make_video(tmp_path / "whole.avi", 200).read_bytes()
    cut = tmp_path / "cut.avi"
    cut.write_bytes(whole[: len(whole) // 2])
    code, _, err = call("run", cut, "--config", site, "--out", tmp_path / "out", "--quiet", "--outputs", "frames")
    assert code == 2
    assert "frames" in err and err.count("\n") == 1
    record = json.loads((tmp_path / "out" / "run.json").read_text())
    assert record["status"] == "failed"
    assert 0 < record["counts"]["frames"] < 200
    assert pq.read_table(tmp_path / "out" / "frames.parquet").num_rows == record["counts"]["frames"]


class Unplugged(protocols.Ground):
    """A ground stage whose sensor is not there."""

    def update(self, frame: Frame, detections: Detections, motion: AnyMotion) -> NoGroundMap:
        raise GroundError(expected="a sensor", found="none", fix="plug it in")


def test_a_run_that_fails_on_its_first_frame_is_one_line_and_a_record_of_it(
    call: Call, video: Path, site: Path, tmp_path: Path
) -> None:
    settings = yaml.safe_load(site.read_text())
    settings["replace"]["ground"] = {"factory": "cli.test_cli:Unplugged"}
    site.write_text(yaml.safe_dump(settings), encoding="utf-8")
    code, out, err = call("run", video, "--config", site, "--out", tmp_path / "out")
    assert (code, out) == (2, "")
    assert err == "standoff: expected a sensor, found none. Plug it in.\n"
    assert json.loads((tmp_path / "out" / "run.json").read_text())["status"] == "failed"


def test_a_reference_box_outside_the_picture_is_told_before_anything_is_written(
    call: Call, video: Path, site: Path, tmp_path: Path
) -> None:
    words = ("--ground", "square:2", "--reference-box", "900,900,950,950")
    code, out, err = call("run", video, "--config", site, "--out", tmp_path / "out", *words)
    assert (code, out) == (2, "")
    assert err.startswith("standoff: expected a box in the picture") and err.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_the_reference_box_is_for_the_first_frame_that_is_read(
    call: Call, video: Path, site: Path, tmp_path: Path
) -> None:
    words = ("--ground", "square:2", "--reference-box", "100,100,150,150", "--start", 1.0, "--outputs", "")
    code, _, err = call("run", video, "--config", site, "--out", tmp_path / "out", *words)
    assert (code, "no frame could be measured" in err) == (1, True)


def test_a_square_on_the_command_line_replaces_another_shape_in_the_file(
    call: Call, video: Path, tmp_path: Path
) -> None:
    reference = {"rectangle_m": [2.0, 3.0], "box_px": [100, 100, 150, 150], "params": {"method": "paper"}}
    site = tmp_path / "site.yaml"
    site.write_text(
        yaml.safe_dump(
            {"ground": {"reference": reference}, "replace": {"detect": {"factory": "cli.test_cli:Approach"}}}
        ),
        encoding="utf-8",
    )
    call("run", video, "--config", site, "--out", tmp_path / "out", "--ground", "square:2", "--outputs", "")
    ground = json.loads((tmp_path / "out" / "run.json").read_text())["ground"]
    assert ground["corners_m"] == [[0, 0], [2, 0], [2, 2], [0, 2]]
    assert (ground["params"]["method"], ground["box_xyxy_px"]) == ("paper", [100, 100, 150, 150])


@pytest.mark.parametrize(
    ("words", "corners"),
    [
        ("polygon:0,0,2,0,1,1.5", [[0, 0], [2, 0], [1, 1.5]]),
        ("polygon:0,0,2,0,2,1,1,2,0,1,height=0.4", [[0, 0], [2, 0], [2, 1], [1, 2], [0, 1]]),
        ("regular:4,2,height=0.4", [[0, 0], [2, 0], [2, 2], [0, 2]]),
    ],
)
def test_a_polygon_on_the_command_line_is_the_reference(
    call: Call, video: Path, site: Path, tmp_path: Path, words: str, corners: list[list[float]]
) -> None:
    box = ("--reference-box", "100,100,150,150", "--outputs", "")
    call("run", video, "--config", site, "--out", tmp_path / "out", "--ground", words, *box)
    ground = json.loads((tmp_path / "out" / "run.json").read_text())["ground"]
    assert np.allclose(ground["references"][0]["corners_m"], corners)
    assert ground["references"][0]["height_m"] == (0.4 if "height" in words else None)


@pytest.mark.parametrize("factory", ["no_such_module:Thing", "cli.test_cli:unplugged"])
def test_an_output_of_ones_own_that_cannot_be_made_leaves_the_folder_as_it_was(
    call: Call, video: Path, site: Path, tmp_path: Path, factory: str
) -> None:
    assert call("run", video, "--config", site, "--out", tmp_path / "out", "--quiet", "--outputs", "")[0] == 0
    before = (tmp_path / "out" / "run.json").read_bytes()
    settings = yaml.safe_load(site.read_text()) | {"extra_outputs": {"siren": {"factory": factory}}}
    site.write_text(yaml.safe_dump(settings), encoding="utf-8")
    code, _, err = call("run", video, "--config", site, "--out", tmp_path / "out", "--overwrite")
    assert (code, err.count("\n"), f"expected {factory} to" in err) == (2, 1, True)
    assert (tmp_path / "out" / "run.json").read_bytes() == before


def unplugged() -> None:
    raise OSError("no such port")


def test_a_run_never_replaces_its_own_source(call: Call, video: Path, site: Path, tmp_path: Path) -> None:
    source = video.rename(tmp_path / "annotated.mp4")
    code, _, err = call("run", source, "--config", site, "--out", tmp_path, "--overwrite")
    assert (code, err.count("\n"), "apart from the source" in err) == (2, 1, True)
    assert source.stat().st_size > 0


@pytest.mark.live
@pytest.mark.parametrize("ending", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_run_leaves_whole_files_that_say_so(
    video: Path, site: Path, tmp_path: Path, ending: signal.Signals
) -> None:
    long = make_video(tmp_path / "long.mp4", 3000)
    words = [sys.executable, "-c", "from standoff.cli import main; main()"]
    words += ["run", str(long), "--config", str(site), "--out", str(tmp_path / "out"), "--quiet"]
    search_path = os.pathsep.join(filter(None, [str(Path(__file__).parents[1]), os.environ.get("PYTHONPATH")]))
    process = subprocess.Popen(words, env=os.environ | {"PYTHONPATH": search_path}, stderr=subprocess.PIPE, text=True)
    film = tmp_path / "out" / "annotated.mp4"
    deadline_s = time.monotonic() + 60
    while not (film.exists() and film.stat().st_size > 0) and time.monotonic() < deadline_s:
        time.sleep(0.05)
    process.send_signal(ending)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 1
    assert err.startswith("standoff: interrupted") and err.count("\n") == 1
    record = json.loads((tmp_path / "out" / "run.json").read_text())
    assert record["status"] == "interrupted"
    assert pq.read_table(tmp_path / "out" / "frames.parquet").num_rows == record["counts"]["frames"] > 0
    with av.open(str(film)) as container:
        assert sum(1 for _ in container.decode(video=0)) == record["counts"]["frames"]
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "interrupted" in PageReader.of(page).text
