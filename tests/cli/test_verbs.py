from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from cli.calling import Call


def test_the_settings_that_are_shown_can_be_run(call: Call, site: Path, tmp_path: Path) -> None:
    code, out, _ = call("config", "show", "--config", site)
    assert code == 0
    (tmp_path / "shown.yaml").write_text(out)
    first, second = (
        json.loads(call("config", "show", "--config", path, "--json")[1]) for path in (site, tmp_path / "shown.yaml")
    )
    assert first == second


def test_check_reads_the_files_that_the_settings_name(call: Call, site: Path, tmp_path: Path) -> None:
    assert call("config", "check", site)[0] == 0
    (tmp_path / "survey.yaml").unlink()
    code, _, err = call("config", "check", site)
    assert code == 2
    assert "survey.yaml" in err


@pytest.mark.parametrize(
    "verb",
    [
        (),
        ("run",),
        ("export",),
        ("calibrate",),
        ("evaluate",),
        ("evaluate", "positions"),
        ("evaluate", "paper"),
        ("evaluate", "run"),
        ("config",),
        ("bench",),
        ("simulate",),
        ("simulate", "mobile"),
        ("simulate", "dataset"),
        ("doctor",),
    ],
)
def test_every_verb_explains_itself(call: Call, verb: tuple[str, ...]) -> None:
    code, out, _ = call(*verb, "--help")
    assert code == 0
    assert "Usage: standoff" in out


def test_doctor_names_what_there_is(call: Call) -> None:
    code, out, _ = call("doctor", "--json")
    report = json.loads(out)
    assert code == 0 and report["healthy"]
    assert {"onnxruntime", "CPUExecutionProvider"} <= {row["name"] for row in report["findings"] if row["ok"]}


def test_doctor_is_content_with_an_installation_that_can_only_run() -> None:
    # What trains and what draws comes with extras.
    absent = ("torch", "onnx", "moderngl", "trimesh", "collada", "shapely", "mapbox_earcut")
    words = f"import sys; sys.modules.update(dict.fromkeys({absent})); from standoff.cli import main; main()"
    done = subprocess.run(
        [sys.executable, "-c", words, "doctor", "--json"], capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")
    report = json.loads(done.stdout)
    (drawing,) = [row for row in report["findings"] if row["topic"] == "simulator"]
    assert report["healthy"] and not drawing["ok"]
    assert "pip install ./simulator" in drawing["fix"]


def test_the_boards_give_the_papers_tables(call: Call, shared_data: Path, tmp_path: Path) -> None:
    code, out, _ = call(
        "evaluate", "checkerboard", shared_data / "checkerboards", "--json", tmp_path / "f.json", "--full",
        "--figure", tmp_path / "f.png",
    )  # fmt: skip
    figures = json.loads((tmp_path / "f.json").read_text())
    assert code == 0
    assert "Table 5" in out
    assert 87 <= figures["before_percent"] <= 92 and 97.0 <= figures["after_percent"] <= 97.8
    assert len(figures["per_view"]) == 13
    assert (tmp_path / "f.png").stat().st_size > 10_000


def test_a_camera_is_calibrated_and_can_be_used(call: Call, shared_data: Path, tmp_path: Path) -> None:
    camera = tmp_path / "camera.yaml"
    assert call("calibrate", shared_data / "checkerboards", "--out", camera)[0] == 0
    code, out, _ = call("evaluate", "checkerboard", shared_data / "checkerboards", "--camera", camera, "--json", "-")
    assert code == 0
    assert json.loads(out)["after_percent"] > 97.9
