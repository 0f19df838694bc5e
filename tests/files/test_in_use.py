"""A folder that is being written is not taken away from under the one who writes."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from standoff.core.errors import OutputError
from standoff.files.in_use import FolderInUse, in_use
from standoff.files.whole import whole_folder


def test_a_folder_belongs_to_one_at_a_time(tmp_path: Path) -> None:
    mark = FolderInUse(tmp_path)
    with pytest.raises(OutputError, match="still going on"), in_use(tmp_path):
        pass
    mark.release()
    mark.release()
    with in_use(tmp_path):
        assert list(tmp_path.iterdir()) == []


def test_a_killed_process_leaves_no_mark(tmp_path: Path) -> None:
    words = "import sys, time; from pathlib import Path; from standoff.files.in_use import FolderInUse\n"
    words += "mark = FolderInUse(Path(sys.argv[1])); print('marked', flush=True); time.sleep(60)"
    process = subprocess.Popen([sys.executable, "-c", words, str(tmp_path)], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None and process.stdout.readline() == "marked\n"
    with pytest.raises(OutputError, match="still going on"):
        FolderInUse(tmp_path)
    process.kill()
    process.communicate()
    FolderInUse(tmp_path).release()


def test_a_folder_that_is_just_being_made_is_not_made_anew(tmp_path: Path) -> None:
    out = tmp_path / "clip"
    with whole_folder(out, overwrite=False, own=("one",)) as staging:
        (staging / "one").write_text("half")
        with (
            pytest.raises(OutputError, match="still going on"),
            whole_folder(out, overwrite=True, own=("one",)),
        ):
            pass
        (staging / "one").write_text("whole")
    assert (out / "one").read_text() == "whole"
