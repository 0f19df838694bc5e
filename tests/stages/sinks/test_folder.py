from __future__ import annotations

from pathlib import Path

import pytest

from standoff.core.errors import OutputError
from standoff.core.outputs import RUN_FILES
from standoff.stages.sinks import prepare_output


def test_a_new_folder_is_created_with_its_parents(tmp_path: Path) -> None:
    folder = prepare_output(tmp_path / "a" / "b")
    assert folder.is_dir()
    assert list(folder.iterdir()) == []


def test_a_folder_with_strangers_can_be_used(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    assert prepare_output(tmp_path) == tmp_path


def test_a_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("")
    with pytest.raises(OutputError, match=r"expected an output folder, found the file .*out\. Choose another folder\."):
        prepare_output(tmp_path / "out")


def test_a_folder_below_a_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="that can be written to"):
        prepare_output(tmp_path / "file" / "out")


def test_a_folder_that_takes_no_files_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_arguments: object, **_names: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("tempfile.NamedTemporaryFile", refuse)
    with pytest.raises(OutputError, match="No space left on device") as caught:
        prepare_output(tmp_path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", [*RUN_FILES, "tracks.parts", "frames.parts", ".report.html.partial"])
def test_a_folder_that_holds_a_run_or_the_rest_of_one_is_refused(tmp_path: Path, name: str) -> None:
    _leave(tmp_path / name)
    with pytest.raises(OutputError, match=f"{name}.*--overwrite"):
        prepare_output(tmp_path)


def test_overwriting_removes_our_files_and_nothing_else(tmp_path: Path) -> None:
    for name in (*RUN_FILES, "tracks.parts"):
        _leave(tmp_path / name)
    (tmp_path / "site.yaml").write_text("mine")
    prepare_output(tmp_path, overwrite=True)
    assert [path.name for path in tmp_path.iterdir()] == ["site.yaml"]


def _leave(path: Path) -> None:
    if path.suffix == ".parts":
        path.mkdir()
        (path / "part-000000.parquet").write_bytes(b"")
    else:
        path.write_text("")
