"""Make one folder from which standoff is installed without a network: wheels for this platform, model, docs, checksums.

    python shipping/bundle.py [--out dist] [--extras scale]

Versions are those of `requirements.lock`. Whoever calls this needs a package index; whoever installs from the folder
needs nothing but Python.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import shutil
import string
import subprocess
import sys
import sysconfig
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from installed import parts_of
from licences import OURS, Rules, sbom

from standoff import __version__

HERE: Final = Path(__file__).parent
PROJECT: Final = HERE.parent
PYTHON: Final = f"{sys.version_info.major}.{sys.version_info.minor}"
PLATFORM: Final = sysconfig.get_platform().replace("-", "_")


def bundle_name() -> str:
    """Return what the folder is called: version, Python and platform, since wheels are for those."""
    return f"standoff-{__version__}-cp{PYTHON.replace('.', '')}-{PLATFORM}"


def make_bundle(out: Path, extras: Sequence[str] = (), *, docs: bool = True) -> Path:
    """Make the folder anew and return its path.

    Args:
        out: Where it goes.
        extras: Of standoff, whose needs are in it, too.
        docs: Whether the documentation is in it.

    Raises:
        subprocess.CalledProcessError: A wheel could not be had or made, or a page has a dead link.
        SystemExit: Something is in it that `licences.yaml` does not allow.
    """
    folder = out / bundle_name()
    partial = out / f"{folder.name}.partial"
    for old in (folder, partial):
        shutil.rmtree(old, ignore_errors=True)
    wheels = partial / "wheels"
    wheels.mkdir(parents=True)
    _gather(wheels, extras)
    roots = [_root(name, extras) for name in OURS]
    parts = parts_of(roots, sorted(wheels.glob("*.whl")))
    faults = list(Rules.read().faults(parts))
    if faults:
        raise SystemExit("not allowed in a bundle:\n" + "\n".join(faults))
    (partial / "sbom.cdx.json").write_text(sbom(parts, Rules.read()), encoding="utf-8")
    (partial / "requirements.txt").write_text("".join(f"{root}=={__version__}\n" for root in roots), encoding="utf-8")
    (partial / "python-version").write_text(f"{PYTHON}\n", encoding="utf-8")
    _write_readme(partial)
    if docs:
        mkdocs = [sys.executable, "-m", "mkdocs", "build", "--quiet", "--strict", "--no-directory-urls"]
        quiet = {**os.environ, "NO_MKDOCS_2_WARNING": "1"}
        subprocess.run([*mkdocs, "--site-dir", str(partial.resolve() / "docs")], cwd=PROJECT, env=quiet, check=True)
    _write_sums(partial)
    partial.rename(folder)
    return folder


def _root(name: str, extras: Sequence[str]) -> str:
    return f"{name}[{','.join(extras)}]" if extras and name == OURS[0] else name


def _gather(wheels: Path, extras: Sequence[str]) -> None:
    """Make wheels of ours, and get those of all that they need at the versions of the lock."""
    pip = [sys.executable, "-m", "pip", "wheel", "--quiet", "--disable-pip-version-check", "--wheel-dir", str(wheels)]
    subprocess.run([*pip, "--no-deps", str(PROJECT), str(PROJECT / "simulator")], check=True)
    ours = sorted(wheels.glob("standoff*.whl"))
    wanted = [_root(str(one), extras) if one.name.startswith(f"standoff-{__version__}") else str(one) for one in ours]
    subprocess.run([*pip, "--constraint", str(PROJECT / "requirements.lock"), *wanted], check=True)


def _write_readme(folder: Path) -> None:
    text = string.Template((HERE / "bundle.txt").read_text(encoding="utf-8"))
    said = text.substitute(version=__version__, python=PYTHON, platform=PLATFORM)
    (folder / "README.txt").write_text(said, encoding="utf-8")
    shutil.copy(HERE / "install.sh", folder)
    shutil.copy(PROJECT / "LICENSE", folder)


def _write_sums(folder: Path) -> None:
    """Write SHA-256 of every file, as `sha256sum` checks them."""
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    lines = [
        f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.relative_to(folder).as_posix()}\n" for path in files
    ]
    (folder / "SHA256SUMS").write_text("".join(lines), encoding="utf-8")


def main() -> None:
    """Make it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=PROJECT / "dist")
    parser.add_argument("--extras", default=os.environ.get("EXTRAS", ""))
    asked = parser.parse_args()
    folder = make_bundle(asked.out, [extra for extra in asked.extras.split(",") if extra])
    size_mb = sum(path.stat().st_size for path in folder.rglob("*") if path.is_file()) / 1e6
    print(f"{folder}: {len([*folder.glob('wheels/*.whl')])} wheels, {size_mb:.0f} MB. To install: sh install.sh in it.")


if __name__ == "__main__":
    main()
