"""What an install brings: distributions that need each other, with the libraries in their wheels."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from importlib.metadata import Distribution, distributions
from pathlib import Path

from packaging.requirements import Requirement


@dataclass(frozen=True, slots=True)
class Part:
    """One distribution of an install.

    Attributes:
        name: Normalised, as indexes have it.
        version: Of it.
        stated: Its licence in its own words: an SPDX expression where it gives one, else the most that it says.
        libraries: Names of the shared libraries of others that its wheel brings, without their versions; in order.
        needs: Names of the parts that it needs itself.
    """

    name: str
    version: str
    stated: tuple[str, ...]
    libraries: tuple[str, ...]
    needs: tuple[str, ...]


def normalised(name: str) -> str:
    """Return a distribution's name as indexes have it.

    >>> normalised("Boolean.py"), normalised("typing_extensions")
    ('boolean-py', 'typing-extensions')
    """
    return re.sub(r"[-_.]+", "-", name).lower()


def parts_of(roots: Sequence[str], path: Iterable[Path | str] | None = None) -> dict[str, Part]:
    """Return all that some requirements bring, by name; markers are those of this Python and platform.

    Args:
        roots: Requirements, with extras as in `standoff[scale]`.
        path: Folders, or wheels, in which to look; None: this environment.

    Raises:
        LookupError: Something that is needed is not there.
    """
    found = distributions() if path is None else distributions(path=[str(one) for one in path])
    known = {normalised(one.metadata["Name"]): one for one in found}
    parts: dict[str, Part] = {}
    waiting = [(Requirement(root), "") for root in roots]
    seen: set[tuple[str, str]] = set()
    while waiting:
        wanted, by = waiting.pop()
        name = normalised(wanted.name)
        if name not in known:
            raise LookupError(f"expected {name}, which {by or 'the install'} needs; it is not there. Install it.")
        if name not in parts:
            parts[name] = _part(known[name])
        for extra in {"", *wanted.extras} - {extra for one, extra in seen if one == name}:
            seen.add((name, extra))
            waiting += [(need, name) for need in _needs(known[name], extra)]
    return dict(sorted(parts.items()))


def _needs(distribution: Distribution, extra: str) -> Iterator[Requirement]:
    for text in distribution.requires or []:
        need = Requirement(text)
        if need.marker is None or need.marker.evaluate({"extra": extra}):
            yield need


def _part(distribution: Distribution) -> Part:
    about = distribution.metadata
    files = [Path(str(file)) for file in distribution.files or []]
    within = [file.name for file in files if ".so" in file.name and file.parent.name.endswith(".libs")]
    return Part(
        name=normalised(about["Name"]),
        version=distribution.version,
        stated=_stated(distribution),
        libraries=tuple(sorted({library_name(file) for file in within})),
        needs=tuple(sorted({normalised(need.name) for need in _needs(distribution, "")})),
    )


def _stated(distribution: Distribution) -> tuple[str, ...]:
    about = distribution.metadata
    if about["License-Expression"]:
        return (about["License-Expression"],)
    named = [one.rpartition(" :: ")[2] for one in about.get_all("Classifier") or [] if one.startswith("License ::")]
    named = [one for one in named if one != "OSI Approved"]
    text = (about["License"] or "").strip()
    # A whole licence instead of its name says less than a classifier does.
    return tuple(named) or ((text,) if text and "\n" not in text else ())


def library_name(file: str) -> str:
    """Return what a shared library is called without the versions and hashes in its file's name.

    >>> library_name("libavcodec-5e6b81c2.so.62.28.102"), library_name("libopenblasp-r0-59ffcd50.3.15.so")
    ('libavcodec', 'libopenblasp')
    >>> library_name("libgfortran-040039e1-0352e75f.so.5.0.0"), library_name("libxcb-shape-7716c890.so.0.0.0")
    ('libgfortran', 'libxcb-shape')
    """
    stem = file.partition(".so")[0]
    return re.sub(r"(-r0)?(-[0-9a-f]{8})+(\.[0-9.]+)?$", "", stem)
