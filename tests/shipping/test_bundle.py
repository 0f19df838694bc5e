"""A bundle is installed without a network, or says in one line why it cannot be."""

from __future__ import annotations

import hashlib
import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from bundle import PYTHON, make_bundle

SHIPPING = Path(__file__).parents[2] / "shipping"

pytestmark = pytest.mark.skipif(shutil.which("sha256sum") is None, reason="install.sh needs sha256sum")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return what looks like a bundle without wheels."""
    made = tmp_path / "bundle"
    made.mkdir()
    shutil.copy(SHIPPING / "install.sh", made)
    (made / "python-version").write_text(f"{PYTHON}\n")
    (made / "requirements.txt").write_text("standoff\n")
    (made / "wheels").mkdir()
    sums = [f"{hashlib.sha256((made / name).read_bytes()).hexdigest()}  {name}\n" for name in ("requirements.txt",)]
    (made / "SHA256SUMS").write_text("".join(sums))
    return made


def install(folder: Path, target: Path, *before: str, python: str = sys.executable) -> subprocess.CompletedProcess[str]:
    environment = {"PATH": "/usr/bin:/bin:/usr/sbin:/sbin", "HOME": str(folder), "PYTHON": python}
    words = [*before, "sh", str(folder / "install.sh"), str(target)]
    return subprocess.run(words, env=environment, capture_output=True, text=True, check=False)


def test_a_bundle_for_another_python_is_refused(folder: Path, tmp_path: Path) -> None:
    (folder / "python-version").write_text("3.99\n")
    done = install(folder, tmp_path / "env")
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert f"expected Python 3.99, for which these wheels are; found {PYTHON}" in done.stderr
    assert not (tmp_path / "env").exists()


def test_a_python_that_is_not_there_is_named(folder: Path, tmp_path: Path) -> None:
    done = install(folder, tmp_path / "env", python=str(tmp_path / "python4"))
    assert done.returncode == 2
    assert "found none. Set PYTHON=" in done.stderr


def test_a_bundle_that_was_damaged_on_its_way_is_refused(folder: Path, tmp_path: Path) -> None:
    (folder / "requirements.txt").write_text("standof\n")
    done = install(folder, tmp_path / "env")
    assert done.returncode == 2
    assert "Copy the folder again" in done.stderr
    assert not (tmp_path / "env").exists()


@pytest.mark.live
def test_a_bundle_is_installed_and_measures_where_there_is_no_network(tmp_path: Path) -> None:
    folder = make_bundle(tmp_path, docs=False)
    apart = ("unshare", "--net", "--map-root-user")
    if subprocess.run([*apart, "true"], capture_output=True, check=False).returncode:
        pytest.skip("this machine lets nobody take the network away from a program")
    env = tmp_path / "env"
    done = install(folder, env, *apart)
    assert done.returncode == 0, done.stderr
    program = str(env / "bin" / "standoff")
    where = subprocess.run(
        [str(env / "bin" / "python"), "-c", "import standoff; print(standoff.__file__)"],
        env={}, cwd=tmp_path, capture_output=True, text=True, check=True,
    )  # fmt: skip
    film = Path(where.stdout.strip()).parent / "demo"
    assert film.is_relative_to(env)
    doctor = subprocess.run([*apart, program, "doctor"], env={"PATH": "/usr/bin:/bin"}, cwd=tmp_path, check=False)
    assert doctor.returncode == 0
    run = [program, "run", str(film / "video.mp4"), "--config", str(film / "reference.yaml"), "--out", "out"]
    options = ["--stop", "0.2", "--outputs", "tracks,proximity"]
    subprocess.run(
        [*apart, *run, *options], env={"PATH": "/usr/bin:/bin", "HOME": str(tmp_path)}, cwd=tmp_path, check=True
    )
    record = json.loads((tmp_path / "out" / "run.json").read_text())
    assert record["status"] == "complete"
    assert record["counts"]["measured_distances"] > 0
