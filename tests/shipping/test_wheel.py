"""A wheel has the pages where Node builds them; one made without Node works, and says how to get them."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

PROJECT = Path(__file__).resolve().parents[2]
PAGES = "standoff/service/page/"

pytestmark = pytest.mark.live


def wheel_of(project: Path, tools: str, out: Path) -> list[str]:
    """Build a wheel with the tools of a PATH; return the names of its files."""
    command = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--wheel-dir", str(out), str(project)]
    subprocess.run(command, check=True, env={**os.environ, "PATH": tools})
    (wheel,) = out.glob("standoff-*.whl")
    with zipfile.ZipFile(wheel) as packed:
        return packed.namelist()


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """What is in the repository, and nothing that was built."""
    names = subprocess.run(["git", "ls-files", "-z"], cwd=PROJECT, check=True, capture_output=True, text=True).stdout
    for name in filter(None, names.split("\0")):
        if name.startswith(("src/", "page/")) or "/" not in name:
            target = tmp_path / "project" / name
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(PROJECT / name, target)
    return tmp_path / "project"


def test_where_node_is_the_wheel_has_the_pages(project: Path, tmp_path: Path) -> None:
    if shutil.which("npm") is None:
        pytest.skip("needs Node, which builds the pages")
    pages = [name for name in wheel_of(project, os.environ["PATH"], tmp_path / "out") if name.startswith(PAGES)]
    assert {f"{PAGES}setup.html", f"{PAGES}review.html"} < set(pages)
    assert any(name.endswith(".js") for name in pages)


def test_where_no_node_is_the_wheel_works_and_says_how_to_get_them(project: Path, tmp_path: Path) -> None:
    empty = tmp_path / "tools"
    empty.mkdir()
    names = wheel_of(project, str(empty), tmp_path / "out")
    assert not [name for name in names if name.startswith(PAGES)]
    (wheel,) = (tmp_path / "out").glob("standoff-*.whl")
    with zipfile.ZipFile(wheel) as packed:
        packed.extractall(tmp_path / "installed")
    film = tmp_path / "installed" / "standoff" / "demo" / "video.mp4"
    told = subprocess.run(
        [sys.executable, "-m", "standoff", "setup", str(film), "--no-browser"],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(tmp_path / "installed")},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (told.returncode, told.stdout, told.stderr.count("\n")) == (2, "", 1), told.stderr
    assert "make page" in told.stderr
