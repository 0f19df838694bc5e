"""Ask the package index for which platforms it has wheels of all that a runtime install needs, at the lock's versions.

    python shipping/platform_wheels.py [--write docs/install.md]

prints a table in Markdown, or puts it between the two marks of a page. pip itself is asked, once for each platform and
once more for each wheel that is missing there; nothing is downloaded.
"""

from __future__ import annotations

import argparse
import json
import re
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

from installed import parts_of
from licences import OURS

_LINUX: Final = ("manylinux_2_28", "manylinux_2_27", "manylinux_2_24", "manylinux_2_17", "manylinux2014", "manylinux1")
PLATFORMS: Final[Mapping[str, tuple[str, ...]]] = {
    "Linux x86-64": tuple(f"{tag}_x86_64" for tag in _LINUX),
    "Linux ARM64": tuple(f"{tag}_aarch64" for tag in _LINUX[:-1]),
    "Windows x86-64": ("win_amd64",),
    "macOS ARM64": ("macosx_14_0_arm64",),
    "macOS x86-64": ("macosx_14_0_x86_64",),
}
"""Tags of the wheels that pip would take there; Jetson is Linux ARM64."""
PYTHON: Final = "3.11"
BEGIN, END = "<!-- platform_wheels: begin -->", "<!-- platform_wheels: end -->"

_MISSING: Final = re.compile(r"No matching distribution found for ([\w.-]+)==")


def runtime_versions(lock: Path) -> dict[str, str]:
    """Return the version in the lock of each distribution that a runtime install here brings, ours left out."""
    locked = dict(re.findall(r"^([\w.-]+)==(\S+)$", lock.read_text(encoding="utf-8"), re.MULTILINE))
    return {name: locked[name] for name in parts_of(OURS) if name not in OURS}


def wheels_on(tags: Sequence[str], versions: Mapping[str, str]) -> dict[str, str]:
    """Return the file of the wheel that pip would take of each distribution; empty where there is none.

    Args:
        tags: Of the platform.
        versions: By name.

    Raises:
        RuntimeError: The index cannot be asked.
    """
    wanted, files = dict(versions), dict.fromkeys(versions, "")
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "report.json"
        pip = [sys.executable, "-m", "pip", "install", "--dry-run", "--no-deps", "--ignore-installed", "--quiet"]
        pip += ["--only-binary=:all:", "--implementation=cp", f"--python-version={PYTHON}", f"--target={folder}/none"]
        pip += [f"--platform={tag}" for tag in tags]
        while wanted:
            pins = [f"{name}=={version}" for name, version in wanted.items()]
            done = subprocess.run([*pip, "--report", str(report), *pins], capture_output=True, text=True, check=False)
            if done.returncode == 0:
                break
            missing = _MISSING.search(done.stderr)
            if missing is None:
                raise RuntimeError(done.stderr)
            del wanted[missing[1]]
        if wanted:
            for one in json.loads(report.read_text(encoding="utf-8"))["install"]:
                name = re.sub(r"[-_.]+", "-", one["metadata"]["name"]).lower()
                files[name] = one["download_info"]["url"].rpartition("/")[2]
    return files


def table(versions: Mapping[str, str], found: Mapping[str, Mapping[str, str]]) -> str:
    """Return what was found as Markdown: a table of what differs, and the names of what is the same everywhere.

    Args:
        versions: By name.
        found: Files by platform and name, as `wheels_on` gives them.
    """
    pure = [name for name in versions if all(files[name].endswith("-any.whl") for files in found.values())]
    lines = ["| package | " + " | ".join(found) + " |", "|---" * (len(found) + 1) + "|"]
    for name in versions:
        if name not in pure:
            cells = ["wheel" if files[name] else "**none**" for files in found.values()]
            lines.append(f"| {name} {versions[name]} | " + " | ".join(cells) + " |")
    same = ", ".join(f"{name} {versions[name]}" for name in pure)
    day = datetime.now(UTC).date().isoformat()
    head = f"Python {PYTHON}, versions of `requirements.lock`, as the package index had them on {day}:"
    return "\n".join([head, "", *lines, "", f"The same wheel everywhere: {same}."])


def write_between(page: Path, text: str) -> None:
    """Put a text between the two marks of a page.

    Raises:
        SystemExit: It has not both, in this order.
    """
    before, begin, rest = page.read_text(encoding="utf-8").partition(BEGIN)
    _, end, after = rest.partition(END)
    if not (begin and end):
        raise SystemExit(f"expected {BEGIN} and then {END} in {page}; not there. Put them where the table goes.")
    page.write_text(f"{before}{BEGIN}\n\n{text}\n\n{END}{after}", encoding="utf-8")


def main() -> None:
    """Ask, and print or write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--write", type=Path)
    asked = parser.parse_args()
    versions = runtime_versions(Path(__file__).parents[1] / "requirements.lock")
    text = table(versions, {name: wheels_on(tags, versions) for name, tags in PLATFORMS.items()})
    if asked.write:
        write_between(asked.write, text)
    else:
        print(text)


if __name__ == "__main__":
    main()
