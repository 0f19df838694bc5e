"""What a runtime install brings is allowed, and what is not allowed is found."""

from __future__ import annotations

import json
import sys
import zipfile
from dataclasses import replace
from pathlib import Path

import pytest
from installed import Part, parts_of
from licences import ROOTS, Rules, sbom

RULES = Rules.read()
PART = Part(name="thing", version="1.0", stated=("MIT",), libraries=(), needs=())


@pytest.fixture(scope="module")
def install() -> dict[str, Part]:
    return parts_of(ROOTS)


def test_all_that_a_runtime_install_brings_is_allowed(install: dict[str, Part]) -> None:
    assert list(RULES.faults(install)) == []


def test_a_runtime_install_brings_neither_what_trains_nor_what_tests(install: dict[str, Part]) -> None:
    assert {"standoff", "standoff-sim", "numpy", "onnxruntime", "av"} <= install.keys()
    assert not {"torch", "onnx", "pycocotools", "pytest", "mypy", "cyclonedx-python-lib"} & install.keys()


@pytest.mark.parametrize(
    "stated",
    [
        (), ("GPL-3.0-only",), ("AGPL-3.0-or-later",), ("LGPL-2.1-or-later",), ("MIT AND GPL-2.0-only",),
        ("GNU General Public License v3 (GPLv3)",), ("MIT License", "GNU Affero General Public License v3"),
        ("Proprietary",),
    ],
)  # fmt: skip
def test_what_is_under_another_licence_or_does_not_say_is_found(stated: tuple[str, ...]) -> None:
    (fault,) = RULES.faults({"thing": replace(PART, stated=stated)})
    assert "thing 1.0" in fault
    assert all(part in fault for part in stated) or not stated


@pytest.mark.parametrize(
    "stated", [("MIT",), ("MIT License",), ("Apache-2.0 WITH LLVM-exception AND MIT",), ("MIT OR GPL-2.0-only",)]
)
def test_what_is_under_licences_of_the_list_is_none(stated: tuple[str, ...]) -> None:
    assert list(RULES.faults({"thing": replace(PART, stated=stated)})) == []


@pytest.mark.parametrize(
    ("library", "said"), [("libx264", "GPL-2.0-or-later"), ("libgeos", "LGPL"), ("libnew", "unknown")]
)
def test_a_library_in_a_wheel_that_no_exception_names_is_found(library: str, said: str) -> None:
    (fault,) = RULES.faults({"thing": replace(PART, libraries=("libdav1d", library))})
    assert library in fault
    assert said in fault


@pytest.mark.skipif(sys.platform != "linux", reason="wheels of other platforms bring other libraries")
def test_an_exception_that_nothing_needs_any_more_is_found(install: dict[str, Part]) -> None:
    without = {**install, "shapely": replace(install["shapely"], libraries=("libgeos",))}
    assert list(RULES.faults(without)) == ["shapely: the exception for libgeos_c is not needed; take it out"]


def test_the_sbom_names_every_part_its_libraries_and_what_needs_what(install: dict[str, Part]) -> None:
    said = json.loads(sbom(install, RULES))
    components = [said["metadata"]["component"], *said["components"]]
    assert {one["name"]: one["version"] for one in components} == {name: part.version for name, part in install.items()}
    assert all(one["licenses"] for one in components)
    inside = {one["name"]: {each["name"] for each in one.get("components", ())} for one in components}
    assert inside == {name: set(part.libraries) for name, part in install.items()}
    needs = {one["ref"]: one.get("dependsOn", []) for one in said["dependencies"]}
    assert {*install["matplotlib"].needs} & {"numpy", "pillow"}
    assert f"numpy=={install['numpy'].version}" in needs[f"matplotlib=={install['matplotlib'].version}"]


def test_wheels_are_read_as_an_environment_is(tmp_path: Path) -> None:
    first = wheel(
        tmp_path, "first", "Requires-Dist: second; extra == 'more'\nLicense: MIT", libs=("libpng16-ab12cd34.so.1",)
    )
    second = wheel(
        tmp_path,
        "second",
        "Requires-Dist: gone; sys_platform == 'nowhere'\nClassifier: License :: OSI Approved :: BSD License",
    )
    assert [*parts_of(["first"], [first, second])] == ["first"]
    parts = parts_of(["first[more]"], [first, second])
    assert {name: part.stated for name, part in parts.items()} == {"first": ("MIT",), "second": ("BSD License",)}
    assert parts["first"].libraries == ("libpng16",)
    with pytest.raises(LookupError, match="second, which first needs"):
        parts_of(["first[more]"], [first])


def wheel(folder: Path, name: str, about: str, libs: tuple[str, ...] = ()) -> Path:
    path, info = folder / f"{name}-1.0-py3-none-any.whl", f"{name}-1.0.dist-info"
    files = [f"{name}.libs/{lib}" for lib in libs]
    with zipfile.ZipFile(path, "w") as file:
        file.writestr(
            f"{info}/METADATA", f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\nProvides-Extra: more\n{about}\n"
        )
        file.writestr(f"{info}/RECORD", "".join(f"{one},,\n" for one in files))
    return path
