"""What cannot be shown is said in one line, before any page opens."""

from __future__ import annotations

from pathlib import Path

import pytest
from cli.calling import Call
from service.demo_film import DEMO

pytest.importorskip("fastapi", reason="the page's server needs the extra `serve`")


def test_bad_input_of_setup_and_open(call: Call, tmp_path: Path) -> None:
    (tmp_path / "no.mp4").write_bytes(b"nothing" * 100)
    (tmp_path / "site.yaml").write_text("detect_evry: 3\n")
    (tmp_path / "broken.yaml").write_text("ground: {\n")
    (tmp_path / "empty").mkdir()
    film = DEMO / "video.mp4"
    for words, told in (
        (("setup", tmp_path / "none.mp4"), "none.mp4"),
        (("setup", tmp_path / "no.mp4"), "no.mp4"),
        (("setup", tmp_path / "empty"), "empty"),
        (("setup", film, "--config", tmp_path / "site.yaml"), "detect_evry"),
        (("setup", film, "--config", tmp_path / "broken.yaml"), "broken.yaml"),
        (("open", tmp_path / "none"), "none"),
        (("open", tmp_path / "empty"), "run.json"),
    ):
        code, out, err = call(*words, "--no-browser")
        assert (code, out, err.count("\n")) == (2, "", 1), err
        assert told in err
    assert not list(tmp_path.glob(".*draft"))
