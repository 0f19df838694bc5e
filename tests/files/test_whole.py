from __future__ import annotations

import errno
from functools import partial
from pathlib import Path

import pytest

from standoff.core.errors import OutputError
from standoff.files.whole import whole_file
from standoff.files.whole import whole_folder as any_whole_folder

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
