from __future__ import annotations

from pathlib import Path

import pytest
import yaml
from cli.calling import Call

from standoff.cli.ground_option import GroundOption
from standoff.config import build_ground, build_marker_observer, load_settings
from standoff.core.errors import ConfigError


def test_marker_writes_a_target(call: Call, tmp_path: Path) -> None:
    out = tmp_path / "target.pdf"
    code, said, _ = call("marker", "--size-m", "0.2", "--out", out, "--paper", "single")
    assert code == 0
    assert "0.274 m x 0.274 m" in said
    assert out.read_bytes().startswith(b"%PDF")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--size-m", "0.01"), "0.1 to 3.5 m"),
        (("--size-m", "9"), "0.1 to 3.5 m"),
        (("--size-m", "1", "--id", "600"), "0 to 586"),
        (("--size-m", "1", "--family", "qr"), "apriltag36h11"),
        (("--size-m", "1", "--paper", "napkin"), "A4"),
    ],
)
def test_what_cannot_be_printed_is_said_in_one_line(
    call: Call, tmp_path: Path, words: tuple[str, ...], said: str
) -> None:
    code, _, error = call("marker", *words, "--out", tmp_path / "target.pdf")
    assert code == 2
    assert said in error
    assert error.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_an_existing_file_is_not_replaced(call: Call, tmp_path: Path) -> None:
    out = tmp_path / "target.pdf"
    out.write_text("mine")
    code, _, error = call("marker", "--size-m", "0.2", "--out", out)
    assert (code, error.count("\n"), out.read_text()) == (2, 1, "mine")


def test_the_command_lines_marker_defines_the_site_frame_and_replaces_other_grounds(tmp_path: Path) -> None:
    file = tmp_path / "site.yaml"
    file.write_text("ground: {survey: survey.yaml, markers: [{id: 9, size_m: 1, x_m: 4, y_m: 2}]}\n", encoding="utf-8")
    settings = load_settings(file, {"ground": GroundOption("marker:1.2,id=3", None, None).settings})
    assert settings.ground.survey is None
    (marker,) = settings.ground.markers
    place = marker.place()
    assert (place.marker_id, place.corners_m.tolist()[:2]) == (3, [[0.0, 0.0, 0.0], [1.2, 0.0, 0.0]])
    assert build_marker_observer(settings) is not None
    assert load_settings(file, {"ground": GroundOption("none", None, None).settings}).ground.markers == ()


@pytest.mark.parametrize("text", ["marker:", "marker:x", "marker:1.2,id", "marker:1.2,id=-1", "marker:1.2,size=3"])
def test_a_marker_that_cannot_be_read_is_refused(text: str) -> None:
    with pytest.raises(ConfigError, match="marker:SIZE"):
        GroundOption(text, None, None)


@pytest.mark.parametrize(
    ("ground", "said"),
    [
        ({"markers": [{"size_m": 1.0}], "reference": {"square_m": 2.0}}, "needs a place"),
        ({"markers": [{"size_m": 1.0}, {"id": 1, "size_m": 1.0}]}, "needs a place"),
        ({"markers": [{"size_m": 1.0, "x_m": 0, "y_m": 0}] * 2}, "once only"),
        ({"markers": [{"size_m": 1.0, "x_m": 0}]}, "go together"),
        ({"markers": [{"size_m": 1.0, "heading_deg": 5}]}, "heading_deg"),
        ({"markers": [{"size_m": 1.0, "corners_m": [[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0]]}]}, "2.000 m"),
        ({"markers": [{"size_m": 1.0, "corners_m": [[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0]]}]}, "a square"),
        ({"marker_family": "qr"}, "apriltag36h11"),
    ],
)
def test_markers_that_contradict_something_are_refused(ground: dict[str, object], said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        load_settings(None, {"ground": ground})


@pytest.mark.parametrize("beside", ["markers", "survey"])
def test_what_the_paper_s_method_does_not_read_is_refused_not_ignored(tmp_path: Path, beside: str) -> None:
    survey = tmp_path / "survey.yaml"
    points = [{"px": [x, y], "m": [x / 10, -y / 10]} for x in (10, 300) for y in (20, 200)]
    survey.write_text(yaml.safe_dump({"image_size_px": [320, 240], "points": points}), encoding="utf-8")
    told = {"markers": [{"size_m": 1.0, "x_m": 4.0, "y_m": 2.0}], "survey": str(survey)}
    paper = {"square_m": 2.89, "params": {"method": "paper"}}
    with pytest.raises(ConfigError, match="does not read them"):
        build_ground(load_settings(None, {"ground": {"reference": paper, beside: told[beside]}}))


def test_the_command_line_s_auto_keeps_the_file_s_markers_and_none_ends_all_measuring(tmp_path: Path) -> None:
    file = tmp_path / "site.yaml"
    file.write_text("ground: {auto: false, markers: [{id: 9, size_m: 1}]}\n", encoding="utf-8")
    auto = load_settings(file, {"ground": GroundOption("auto", None, None).settings}).ground
    none = load_settings(file, {"ground": GroundOption("none", None, None).settings}).ground
    assert (auto.auto, len(auto.markers), none.auto, len(none.markers)) == (True, 1, False, 0)
