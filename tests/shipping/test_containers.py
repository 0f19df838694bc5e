"""What can be said of the container files without building them."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from standoff import __version__

PROJECT = Path(__file__).parents[2]
FILES = sorted((PROJECT / "containers").glob("Containerfile.*"))
LOCKED = dict(re.findall(r"^([\w-]+)==(\S+)$", (PROJECT / "requirements.lock").read_text(), re.MULTILINE))


def instructions(path: Path) -> list[tuple[str, str]]:
    text = re.sub(r"^#.*\n", "", path.read_text(), flags=re.MULTILINE).replace("\\\n", " ")
    return [(word, rest) for word, _, rest in (line.partition(" ") for line in text.splitlines()) if word]


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.suffix)
def test_a_container_does_not_run_as_root(path: Path) -> None:
    users = [rest for word, rest in instructions(path) if word == "USER"]
    assert users[-1] == "10001"


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.suffix)
def test_a_container_is_built_on_one_version_of_its_base(path: Path) -> None:
    (base,) = [rest for word, rest in instructions(path) if word == "ARG"]
    assert re.fullmatch(r"BASE=[\w./-]+:\d+\.\d+\.\d+(-[\w-]+)?(@sha256:[0-9a-f]{64})?", base)
    assert {rest.partition(" AS ")[0] for word, rest in instructions(path) if word == "FROM"} == {"${BASE}"}


def test_cuda_comes_in_the_version_of_the_lock_on_the_image_of_this_version() -> None:
    cpu, cuda = (path.read_text() for path in FILES)
    assert f"onnxruntime-gpu[cuda,cudnn]=={LOCKED['onnxruntime']}" in cuda
    assert f"localhost/standoff:{__version__}" in cuda
    assert f"standoff:{__version__}" in cpu
