"""The table of platforms in the documentation is that of the lock, and says which wheel is missing."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from platform_wheels import BEGIN, END, PLATFORMS, runtime_versions, table, write_between

PROJECT = Path(__file__).parents[2]
PAGE = PROJECT / "docs" / "install.md"


def test_the_table_of_the_documentation_has_the_versions_of_the_lock() -> None:
    text = PAGE.read_text(encoding="utf-8").partition(BEGIN)[2].partition(END)[0]
    rows = re.findall(r"^\| ([\w-]+) (\S+) \|(.*)\|$", text, re.MULTILINE)
    same = re.findall(r"([\w-]+) (\d[\w.]*\w)", text.partition("The same wheel everywhere: ")[2])
    said = {name: version for name, version, _ in rows} | dict(same)
    wanted = runtime_versions(PROJECT / "requirements.lock")
    assert {name: said.get(name) for name in wanted} == wanted
    assert all(cells.count("|") == len(PLATFORMS) - 1 for _, _, cells in rows)


def test_a_wheel_that_one_platform_lacks_stands_out_and_one_that_is_the_same_everywhere_is_only_named() -> None:
    everywhere = "pure-1.0-py3-none-any.whl"
    found = {
        "here": {"fast": "fast-2.0-cp311-cp311-win_amd64.whl", "pure": everywhere},
        "there": {"fast": "", "pure": everywhere},
    }
    said = table({"fast": "2.0", "pure": "1.0"}, found)
    assert "| fast 2.0 | wheel | **none** |" in said
    assert said.endswith("The same wheel everywhere: pure 1.0.")
    assert "| pure" not in said


def test_only_what_stands_between_the_marks_is_replaced(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(f"before\n{BEGIN}\nold\n{END}\nafter\n")
    write_between(page, "new")
    assert page.read_text() == f"before\n{BEGIN}\n\nnew\n\n{END}\nafter\n"


@pytest.mark.parametrize("text", ["no marks", f"{END} {BEGIN}"])
def test_a_page_without_the_marks_is_left_alone(tmp_path: Path, text: str) -> None:
    page = tmp_path / "page.md"
    page.write_text(text)
    with pytest.raises(SystemExit, match="expected"):
        write_between(page, "new")
    assert page.read_text() == text
