from __future__ import annotations

from pathlib import Path

from standoff.files.below import files_below


def test_files_are_found_through_links_and_once_where_a_link_leads_back(tmp_path: Path) -> None:
    kept, seen = tmp_path / "kept", tmp_path / "seen"
    for name in ("kept/a.txt", "kept/deep/b.TXT", "kept/deep/c.png", "kept/.hidden/d.txt", "seen/.e.txt", "seen/f.txt"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    (seen / "linked").symlink_to(kept)
    (seen / "linked too").symlink_to(kept / "deep")
    (kept / "back").symlink_to(seen)
    (seen / "itself").symlink_to(seen / "itself")
    (seen / "nowhere").symlink_to(tmp_path / "gone")
    found = [path.relative_to(seen).as_posix() for path in files_below(seen, {".txt"})]
    assert found == ["f.txt", "linked/a.txt", "linked/deep/b.TXT"]


def test_in_what_is_no_folder_there_is_nothing(tmp_path: Path) -> None:
    (tmp_path / "a.txt").touch()
    assert not list(files_below(tmp_path / "a.txt", {".txt"}))
    assert not list(files_below(tmp_path / "gone", {".txt"}))
