"""Lengths typed on the command line, and what people read of a run."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import av
import pyarrow.parquet as pq
import pytest
from cli.calling import Call
from cli.test_cli import video as video

from standoff.cli.ground_option import GroundOption
from standoff.core.errors import ConfigError


def _settings(ground: str) -> dict[str, Any]:
    return GroundOption(ground, None, None).settings


@pytest.mark.parametrize(
    ("typed", "in_metres"),
    [
        ("square:9.5ft", "square:2.8956"),
        ("square:9'6\"", "square:2.8956"),
        ("square:2.8956m", "square:2.8956"),
        ("rectangle:10ft,20ft,height=1ft6in", "rectangle:3.048,6.096,height=0.4572"),
        ("rectangle:10ft,20ft,height=0", "rectangle:3.048,6.096,height=0"),
        ("regular:6,5ft", "regular:6,1.524"),
        ("polygon:0,0,10ft,0,5ft,-10ft", "polygon:0,0,3.048,0,1.524,-3.048"),
        ("marker:20in,id=3", "marker:0.508,id=3"),
        ("marker:50.8cm", "marker:0.508"),
    ],
)
def test_a_length_is_the_same_in_every_unit(typed: str, in_metres: str) -> None:
    one, other = (
        json.loads(json.dumps(_settings(text)), parse_float=lambda x: round(float(x), 9)) for text in (typed, in_metres)
    )
    assert one == other


@pytest.mark.parametrize(
    "typed", ["rectangle:10ft,20", "rectangle:3.1m,2", "square:9.5ft,height=0.42", "polygon:0,0,9ft,0,9,9"]
)
def test_one_unit_among_bare_numbers_is_refused(typed: str) -> None:
    with pytest.raises(ConfigError, match=r"a unit behind every length of --ground, because one of them has a unit"):
        _settings(typed)


@pytest.mark.parametrize(
    "typed", ["square:9.5yd", "square:9.5 feet", "square:", "rectangle:9ft 6in", "regular:6", "marker:1.2x"]
)
def test_what_is_no_length_is_refused_with_what_can_be_written(typed: str) -> None:
    with pytest.raises(ConfigError, match=r"length.* for --ground .*2\.89m, 9\.5ft or 9'6"):
        _settings(typed)


def test_who_reads_feet_says_which_unit_he_types() -> None:
    bare, clear = GroundOption("square:2.89", None, None), GroundOption("square:2.89m", None, None)
    bare.check_units("metres")
    clear.check_units("feet")
    GroundOption("survey.yaml", None, None).check_units("feet")
    with pytest.raises(ConfigError, match=r"because lengths are shown in feet, found '2.89'. Write 2.89m or 2.89ft"):
        bare.check_units("feet")


@pytest.mark.parametrize(
    ("words", "telling"),
    [
        (("--unit", "yards"), "'metres' or 'feet'"),
        (("--unit", "feet", "--ground", "square:2.89"), "Write 2.89m or 2.89ft"),
        (("--ground", "rectangle:10ft,20"), "Write 20m or 20ft"),
    ],
)
def test_a_unit_that_is_not_clear_is_one_line_exit_2_and_no_folder(
    call: Call, video: Path, site: Path, tmp_path: Path, words: tuple[str, ...], telling: str
) -> None:
    code, out, err = call("run", video, "--config", site, "--out", tmp_path / "out", *words)
    assert (code, out) == (2, "")
    assert err.startswith("standoff: expected ") and err.count("\n") == 1 and telling in err
    assert not (tmp_path / "out").exists()


def test_feet_and_blur_change_what_people_see_and_nothing_that_machines_read(
    call: Call, video: Path, site: Path, tmp_path: Path
) -> None:
    words = (
        "run",
        video,
        "--config",
        site,
        "--quiet",
        "--outputs",
        "tracks,proximity,frames,hazards,video",
        "--stop",
        1.5,
    )
    assert call(*words, "--out", tmp_path / "plain")[0] == 0
    assert call(*words, "--out", tmp_path / "shown", "--unit", "feet", "--blur")[0] == 0
    for name in ("tracks", "proximity", "frames"):
        one, other = (pq.read_table(tmp_path / run / f"{name}.parquet") for run in ("plain", "shown"))
        assert one.equals(other) and one.num_rows > 0
    events = [(tmp_path / run / "hazards.jsonl").read_text() for run in ("plain", "shown")]
    assert len({re.sub(r'"hazard_id": ?"\w+"', "", text) for text in events}) == 1
    records = [json.loads((tmp_path / run / "run.json").read_text()) for run in ("plain", "shown")]
    assert [one["settings"]["show"] for one in records] == [
        {"unit": "metres", "blur": False}, {"unit": "feet", "blur": True}
    ]  # fmt: skip
    assert records[0]["counts"] == records[1]["counts"]
    assert _last_picture(tmp_path / "plain" / "annotated.mp4") != _last_picture(tmp_path / "shown" / "annotated.mp4")


def test_the_command_line_can_switch_the_files_blur_off(call: Call, video: Path, site: Path, tmp_path: Path) -> None:
    site.write_text(site.read_text() + "show: {blur: true, unit: feet}\n")
    for words, blurs in (((), True), (("--no-blur",), False)):
        call(
            "run", video, "--config", site, "--quiet", "--out", tmp_path / "out", "--outputs", "", "--overwrite", *words
        )
        show = json.loads((tmp_path / "out" / "run.json").read_text())["settings"]["show"]
        assert show == {"unit": "feet", "blur": blurs}


def _last_picture(film: Path) -> bytes:
    with av.open(str(film)) as container:
        return bytes([frame.to_ndarray(format="gray") for frame in container.decode(video=0)][-1].tobytes())
