from __future__ import annotations

import signal
import sys
from pathlib import Path

import pytest
import yaml
from cli.calling import Call

from standoff.cli import main


@pytest.fixture
def call(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Call:
    """Run the program in this process; give its exit code, standard output and standard error."""

    def run(*words: object) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["standoff", *map(str, words)])
        before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
        try:
            with pytest.raises(SystemExit) as left:
                main()
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)
        printed = capsys.readouterr()
        code = left.value.code
        return code if isinstance(code, int) else int(code is not None), printed.out, printed.err

    return run


@pytest.fixture
def site(tmp_path: Path) -> Path:
    return write_site(tmp_path)


def write_site(folder: Path, **more: object) -> Path:
    """Write settings with a scripted detector and a survey in which twenty pixels are a metre."""
    survey = {
        "image_size_px": [320, 240],
        "points": [
            {"name": f"{x},{y}", "px": [x, y], "m": [x / 20, (240 - y) / 20]} for x in (10, 300) for y in (60, 230)
        ],
    }
    (folder / "survey.yaml").write_text(yaml.safe_dump(survey), encoding="utf-8")
    settings = {
        "ground": {"survey": "survey.yaml"},
        "replace": {"detect": {"factory": "cli.test_cli:Approach"}},
        "locate": {"radius_m": {"worker": 1.0, "excavator": 3.0}},
        **more,
    }
    path = folder / "site.yaml"
    path.write_text(yaml.safe_dump(settings), encoding="utf-8")
    return path
