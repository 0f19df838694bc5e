"""The changelog follows its rule (docs/install.md): Keep a Changelog, and a heading for the version that there is."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest

from standoff import __version__

PROJECT = Path(__file__).parents[2]
KINDS = ["Added", "Changed", "Deprecated", "Removed", "Fixed", "Security"]


def parts() -> dict[str, str]:
    """Return the text under each heading of a version, in their order."""
    text = (PROJECT / "CHANGELOG.md").read_text(encoding="utf-8")
    _, *rest = re.split(r"^## (.*)$", text, flags=re.MULTILINE)
    return dict(zip(rest[::2], rest[1::2], strict=True))


def test_every_heading_is_a_version_and_its_day_and_the_newest_is_first() -> None:
    headings = [*parts()]
    found = [re.fullmatch(r"\[(\d+)\.(\d+)\.(\d+)\] - (\d{4}-\d\d-\d\d|unreleased)", heading) for heading in headings]
    assert all(found), headings
    versions = [tuple(int(number) for number in one.groups()[:3]) for one in found if one]
    assert versions == sorted(set(versions), reverse=True)
    assert not any("unreleased" in heading for heading in headings[1:])


def test_changes_stand_under_the_six_words_once_each() -> None:
    for heading, text in parts().items():
        kinds = re.findall(r"^### (.*)$", text, re.MULTILINE)
        assert len(kinds) == len(set(kinds)), heading
        assert set(kinds) <= set(KINDS), heading


@pytest.mark.parametrize("file", ["pyproject.toml", "simulator/pyproject.toml"])
def test_the_version_of_a_distribution_is_that_of_the_program(file: str) -> None:
    project = tomllib.loads((PROJECT / file).read_text(encoding="utf-8"))["project"]
    assert project["version"] == __version__


def test_the_version_has_the_first_heading() -> None:
    assert next(iter(parts())).startswith(f"[{__version__}] - ")
