"""Check the licences of all that a runtime install brings, and write them down as an SBOM (CycloneDX).

    python shipping/licences.py [--out dist/standoff.cdx.json] [WHEEL ...]

Without wheels it looks at the environment in which it runs. It leaves with 1 where something is in the install whose
licence `licences.yaml` neither allows nor excepts, or that does not say under which licence it is.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import yaml
from cyclonedx.contrib.license.factories import LicenseFactory
from cyclonedx.model.bom import Bom
from cyclonedx.model.component import Component, ComponentType
from cyclonedx.output.json import JsonV1Dot6
from cyclonedx.schema import SchemaVersion
from cyclonedx.validation.json import JsonStrictValidator
from installed import Part, parts_of
from license_expression import AND, OR, ExpressionError, get_spdx_licensing
from packageurl import PackageURL

HERE: Final = Path(__file__).parent
ROOTS: Final = ("standoff[serve,scale]", "standoff-sim")
"""What people install at run time; the extra `train` is no part of it."""
OURS: Final = ("standoff", "standoff-sim")

_SPDX: Final = get_spdx_licensing()


@dataclass(frozen=True, slots=True)
class Rules:
    """What `licences.yaml` says.

    Attributes:
        allowed: Licences by SPDX name.
        words: SPDX name by what distributions write instead.
        libraries: SPDX expression by library, or by distribution/library.
        excepted: Why (distribution, library) may be there all the same.
    """

    allowed: frozenset[str]
    words: Mapping[str, str]
    libraries: Mapping[str, str]
    excepted: Mapping[tuple[str, str], str]

    @classmethod
    def read(cls, path: Path = HERE / "licences.yaml") -> Rules:
        """Read the file."""
        said = yaml.safe_load(path.read_text(encoding="utf-8"))
        excepted = {(one["distribution"], name): one["why"] for one in said["exceptions"] for name in one["libraries"]}
        return cls(frozenset(said["allowed"]), said["words"], said["libraries"], excepted)

    def of_part(self, part: Part) -> str:
        """Return the SPDX expression of a distribution's own code; empty where nobody can tell."""
        named = [self.words.get(text, text) for text in part.stated]
        return " AND ".join(dict.fromkeys(one for one in named if _is_spdx(one))) if all(map(_is_spdx, named)) else ""

    def of_library(self, part: Part, library: str) -> str:
        """Return the SPDX expression of a library in its wheel; empty where the file does not say."""
        return self.libraries.get(f"{part.name}/{library}") or self.libraries.get(library, "")

    def allows(self, expression: str) -> bool:
        """Tell whether something under these licences may be in an install: all of `AND`, one of `OR`."""
        return bool(expression) and self._allows(_SPDX.parse(expression))

    def _allows(self, parsed: Any) -> bool:  # noqa: ANN401 - the library has no types
        if isinstance(parsed, AND):
            return all(map(self._allows, parsed.args))
        if isinstance(parsed, OR):
            return any(map(self._allows, parsed.args))
        return str(parsed) in self.allowed

    def faults(self, parts: Mapping[str, Part]) -> Iterator[str]:
        """Yield what is wrong with an install, a line each."""
        used: set[tuple[str, str]] = set()
        for part in parts.values():
            expression = self.of_part(part)
            if not self.allows(expression):
                yield f"{part.name} {part.version}: {expression or ' / '.join(part.stated) or 'no licence stated'}"
            for library in part.libraries:
                expression = self.of_library(part, library)
                if self.allows(expression):
                    continue
                used.add((part.name, library))
                if not expression or (part.name, library) not in self.excepted:
                    yield f"{part.name} {part.version}: {library} in its wheel: {expression or 'unknown'}"
        there = {name for name in parts if parts[name].libraries}
        for name, library in sorted(set(self.excepted) - used):
            # Wheels of other platforms have other libraries, or none.
            if name in there and sys.platform == "linux":
                yield f"{name}: the exception for {library} is not needed; take it out"


def _is_spdx(expression: str) -> bool:
    try:
        return not _SPDX.unknown_license_keys(expression)
    except ExpressionError:
        return False


def sbom(parts: Mapping[str, Part], rules: Rules) -> str:
    """Return the SBOM of an install as CycloneDX 1.6 in JSON: what it brings, what needs what, under which licences.

    Raises:
        ValueError: It is not valid CycloneDX, which would be a mistake of ours.
    """
    bom = Bom()
    components = {name: _component(part, rules) for name, part in parts.items()}
    bom.metadata.component = components[OURS[0]]
    bom.components.update(component for name, component in components.items() if name != OURS[0])
    for name, part in parts.items():
        bom.register_dependency(components[name], [components[need] for need in part.needs if need in components])
    text: str = JsonV1Dot6(bom).output_as_string(indent=2)
    fault = JsonStrictValidator(SchemaVersion.V1_6).validate_str(text)
    if fault is not None:
        raise ValueError(f"expected a valid SBOM, found {fault}")
    return text


def _component(part: Part, rules: Rules) -> Component:
    licence = LicenseFactory()
    own = rules.of_part(part) or " / ".join(part.stated)
    inside = [
        Component(
            name=library,
            type=ComponentType.LIBRARY,
            bom_ref=f"{part.name}/{library}",
            licenses=[licence.make_from_string(known)] if (known := rules.of_library(part, library)) else [],
        )
        for library in part.libraries
    ]
    return Component(
        name=part.name,
        version=part.version,
        type=ComponentType.APPLICATION if part.name in OURS else ComponentType.LIBRARY,
        bom_ref=f"{part.name}=={part.version}",
        purl=PackageURL("pypi", name=part.name, version=part.version),
        licenses=[licence.make_from_string(own)] if own else [],
        components=inside,
    )


def main() -> int:
    """Check, and write the SBOM."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("wheels", nargs="*", type=Path)
    parser.add_argument("--out", type=Path)
    asked = parser.parse_args()
    rules = Rules.read()
    parts = parts_of(ROOTS, asked.wheels or None)
    if asked.out:
        asked.out.parent.mkdir(parents=True, exist_ok=True)
        asked.out.write_text(sbom(parts, rules), encoding="utf-8")
    faults = list(rules.faults(parts))
    libraries = sum(len(part.libraries) for part in parts.values())
    print(f"{len(parts)} distributions, {libraries} libraries of others in their wheels, {len(faults)} not allowed")
    for fault in faults:
        print(f"  {fault}")
    return 1 if faults else 0


if __name__ == "__main__":
    raise SystemExit(main())
