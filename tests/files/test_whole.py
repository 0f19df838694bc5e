from __future__ import annotations

import errno
import os
import stat
import subprocess
import sys
import threading
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

from standoff.core.errors import OutputError
from standoff.files.json_text import write_json
from standoff.files.whole import partial_file, whole_file
from standoff.files.whole import whole_folder as any_whole_folder
from standoff.files.yaml_text import write_yaml

whole_folder = partial(any_whole_folder, own=("a.txt", "old.txt"))


def test_a_folder_appears_when_the_block_has_ended(tmp_path: Path) -> None:
    out = tmp_path / "deep" / "clip"
    with whole_folder(out, overwrite=False) as folder:
        (folder / "a.txt").write_text("a")
        assert not out.exists()
    assert (out / "a.txt").read_text() == "a"
    assert [path.name for path in out.parent.iterdir()] == ["clip"]


def test_an_interrupted_block_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt), whole_folder(tmp_path / "clip", overwrite=False) as folder:
        (folder / "a.txt").write_text("a")
        raise KeyboardInterrupt
    assert list(tmp_path.iterdir()) == []


def test_an_interrupted_block_keeps_what_was_there_before(tmp_path: Path) -> None:
    (tmp_path / "clip").mkdir()
    (tmp_path / "clip" / "old.txt").write_text("old")
    with pytest.raises(KeyboardInterrupt), whole_folder(tmp_path / "clip", overwrite=True):
        raise KeyboardInterrupt
    assert (tmp_path / "clip" / "old.txt").read_text() == "old"


def test_what_a_killed_run_left_is_replaced(tmp_path: Path) -> None:
    (tmp_path / ".clip.partial").mkdir()
    (tmp_path / ".clip.partial" / "rest.txt").write_text("rest")
    with whole_folder(tmp_path / "clip", overwrite=False):
        pass
    assert list((tmp_path / "clip").iterdir()) == []


def test_a_used_folder_a_file_and_a_forbidden_place_are_refused(tmp_path: Path) -> None:
    (tmp_path / "used").mkdir()
    (tmp_path / "used" / "a.txt").write_text("a")
    with pytest.raises(OutputError, match="overwrite"), whole_folder(tmp_path / "used", overwrite=False):
        pass
    with pytest.raises(OutputError, match="the file"), whole_folder(tmp_path / "used" / "a.txt", overwrite=True):
        pass
    with (
        pytest.raises(OutputError, match="written to"),
        whole_folder(tmp_path / "used" / "a.txt" / "b", overwrite=True),
    ):
        pass


def test_what_is_not_ours_is_never_replaced(tmp_path: Path) -> None:
    film = tmp_path / "flights" / "site.mp4"
    film.parent.mkdir()
    film.write_text("film")
    (film.parent / "a.txt").write_text("a")
    with pytest.raises(OutputError, match=r"site\.mp4") as refused, whole_folder(film.parent, overwrite=True):
        pytest.fail("not to be replaced")
    assert "--overwrite" not in str(refused.value)
    assert film.read_text() == "film"


def test_a_link_is_followed(tmp_path: Path) -> None:
    (tmp_path / "real").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "real")
    with whole_folder(tmp_path / "link", overwrite=False) as folder:
        (folder / "a.txt").write_text("a")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "real" / "a.txt").read_text() == "a"


def test_the_current_folder_is_refused_before_the_work(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(OutputError, match="current folder"), whole_folder(Path(), overwrite=False):
        pytest.fail("not to be begun")


def test_a_full_disk_is_an_error_in_one_line(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="No space"), whole_folder(tmp_path / "clip", overwrite=False):
        raise OSError(errno.ENOSPC, "No space left on device")
    assert list(tmp_path.iterdir()) == []


def test_a_file_that_is_not_finished_leaves_the_older_one_alone(tmp_path: Path) -> None:
    out = tmp_path / "model.onnx"
    out.write_text("older")
    with pytest.raises(ZeroDivisionError), whole_file(out) as half_written:
        half_written.write_text("half")
        raise ZeroDivisionError
    assert out.read_text() == "older"
    with whole_file(out) as half_written:
        half_written.write_text("newer")
    assert out.read_text() == "newer"
    assert list(tmp_path.iterdir()) == [out]


def test_a_file_that_cannot_be_written_is_an_error_in_one_line(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="a place to write"), whole_file(tmp_path / "nowhere" / "model.onnx"):
        pytest.fail("nothing to write to")


def writers() -> list[Callable[[Path], None]]:
    def by_whole_file(path: Path) -> None:
        with whole_file(path) as half_written:
            half_written.write_text('{"fx": 1}\n')

    def by_partial_file(path: Path) -> None:
        with partial_file(path) as half_written:
            half_written.write_text('{"fx": 1}\n')

    return [
        by_whole_file,
        by_partial_file,
        lambda path: write_json(path, {"fx": 1}),
        lambda path: write_yaml(path, {"fx": 1}),
    ]


@pytest.mark.parametrize("write", writers())
def test_a_pipe_is_written_into_and_stays_one(tmp_path: Path, write: Callable[[Path], None]) -> None:
    pipe, read = tmp_path / "pipe", []
    os.mkfifo(pipe)
    reader = threading.Thread(target=lambda: read.append(pipe.read_text()), daemon=True)
    reader.start()
    write(pipe)
    reader.join(timeout=10)
    assert "fx" in read[0]
    assert stat.S_ISFIFO(pipe.stat().st_mode)
    assert list(tmp_path.iterdir()) == [pipe]


@pytest.mark.parametrize("write", writers())
def test_the_file_behind_a_link_is_replaced_and_not_the_link(tmp_path: Path, write: Callable[[Path], None]) -> None:
    target = tmp_path / "real" / "camera.yaml"
    target.parent.mkdir()
    target.write_text("old")
    for link, to in (("near", "far"), ("far", target), ("new", target.parent / "new.yaml")):
        (tmp_path / link).symlink_to(to)
    write(tmp_path / "near")
    write(tmp_path / "new")
    assert (tmp_path / "near").is_symlink() and (tmp_path / "far").is_symlink()
    assert "fx" in target.read_text() and "fx" in (target.parent / "new.yaml").read_text()
    assert sorted(path.name for path in target.parent.iterdir()) == ["camera.yaml", "new.yaml"]


@pytest.mark.parametrize("write", writers())
def test_devices_take_what_is_written_and_stay_devices(write: Callable[[Path], None]) -> None:
    write(Path(os.devnull))
    assert stat.S_ISCHR(Path(os.devnull).stat().st_mode)


@pytest.mark.parametrize("appended", [False, True])
def test_standard_output_goes_on_where_the_file_ended(tmp_path: Path, appended: bool) -> None:
    code = """
from pathlib import Path
from standoff.files.json_text import write_json
print("before")
write_json(Path("/dev/stdout"), {"fx": 1})
print("after")
"""
    if not Path("/dev/stdout").exists() or not Path("/proc/self/fd").exists():
        pytest.skip("this system has no /dev/stdout in /proc")
    with (tmp_path / "log").open("a" if appended else "w") as log:
        subprocess.run([sys.executable, "-c", code], stdout=log, check=True)
    assert (tmp_path / "log").read_text() == 'before\n{\n  "fx": 1\n}\nafter\n'
    piped = subprocess.run([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True, check=True)
    assert piped.stdout == (tmp_path / "log").read_text()


def test_links_in_a_circle_are_an_error_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "a").symlink_to("b")
    (tmp_path / "b").symlink_to("a")
    for write in writers():
        with pytest.raises((OutputError, OSError), match=r"(?i)symbolic links"):
            write(tmp_path / "a")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a", "b"]
