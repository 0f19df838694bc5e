"""YAML, read and written in one way: names stay names, and what might be read in two ways is refused.

Plain values are those of YAML 1.2's core schema: true and false are the only booleans, so that `no`, `yes`, `on` and
`off` are names, 1e3 is a number, and 12:30:45, 1_000, 0777 and 2026-11-28 are texts: whoever wants a number of them
says so. Keys are names as they are written, or whole numbers. A key that stands twice in a mapping is refused: the last
one would win in silence.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import yaml

from standoff.core.errors import DataError, StandoffError
from standoff.files.plain_text import read_text
from standoff.files.whole import whole_file

_TAG: Final = "tag:yaml.org,2002:"
_DIGITS: Final = 300
"""A whole number of more has no place in a float."""
_DEEPEST: Final = 60
"""Levels within each other: further, Python's own would run out."""

_CORE: Final[Mapping[str, tuple[str, str]]] = {
    "null": (r"~|null|Null|NULL|", "~nN\0"),
    "bool": (r"true|True|TRUE|false|False|FALSE", "tTfF"),
    "int": (r"[-+]?(?:0|[1-9][0-9]*)|0o[0-7]+|0x[0-9a-fA-F]+", "-+0123456789"),
    "float": (
        r"[-+]?(?:\.[0-9]+|[0-9]+\.[0-9]*)(?:[eE][-+]?[0-9]+)?|[-+]?[0-9]+[eE][-+]?[0-9]+"
        r"|[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN|Nan)",
        "-+.0123456789",
    ),
    "merge": (r"<<", "<"),
}
"""Kinds of plain values, what they look like, and how they begin; zero is nothing at all. OpenCV writes .Nan."""
_LOOKS: Final = {kind: re.compile(f"(?:{pattern})\\Z") for kind, (pattern, _) in _CORE.items()}


class _Loader(yaml.SafeLoader):
    """Composes nodes, plain values told apart by `_CORE`."""


class _Dumper(yaml.SafeDumper):
    """Quotes texts that a reader of either YAML 1.1 or 1.2 would take for something else."""


_Loader.yaml_implicit_resolvers = {}
for _kind, (_, _first) in _CORE.items():
    _begins = ["" if letter == "\0" else letter for letter in _first]
    _Loader.add_implicit_resolver(_TAG + _kind, _LOOKS[_kind], _begins)
    _Dumper.add_implicit_resolver(_TAG + _kind, _LOOKS[_kind], _begins)


class _Refused(Exception):
    """Something that is YAML and is not read.

    Args:
        line: Where, from 1.
        found: What.
        fix: What to do.
    """

    def __init__(self, line: int, found: str, fix: str = "correct the file") -> None:
        self.line, self.found, self.fix = line, found, fix
        super().__init__(found)


def parse_yaml(text: str, what: str, where: str, error: type[StandoffError] = DataError) -> Any:  # noqa: ANN401
    r"""Return what a YAML text says, in Python's own types.

    Args:
        text: Of one document.
        what: What it should be, for the message ("a camera file").
        where: It stands, for the message: a path, a command-line option.
        error: Raised where it cannot be read.

    Raises:
        StandoffError: `error`: it is not YAML, has a key twice, or a value that is not read; says in which line.

    >>> parse_yaml("names: [person, no]\nlr: 1e-3", "settings", "here")
    {'names': ['person', 'no'], 'lr': 0.001}
    """
    try:
        node = yaml.compose(text, Loader=_Loader)
        return None if node is None else _Reader().value(node)
    except _Refused as refused:
        raise error(expected=what, found=f"{where}, line {refused.line}: {refused.found}", fix=refused.fix) from None
    except yaml.YAMLError as problem:
        found = f"{where}{_line_of(problem, text)}: not YAML ({_reason(problem)})"
        raise error(expected=what, found=found, fix="correct the file") from None
    except RecursionError:
        raise error(expected=what, found=f"{where}: YAML nested too deeply", fix="correct the file") from None


def read_yaml(path: Path, what: str, error: type[StandoffError] = DataError) -> Any:  # noqa: ANN401
    """Return what a YAML file says, as `parse_yaml`.

    Raises:
        StandoffError: `error`: it cannot be read either.
    """
    return parse_yaml(read_text(path, what, error), what, str(path), error)


def dump_yaml(content: object, *, flow: bool | None = False, width: int = 80) -> str:
    """Return plain values as YAML that `parse_yaml` and readers of YAML 1.1 understand alike, keys in their own order.

    Args:
        content: Mappings, lists, texts, numbers.
        flow: Whether all stands in brackets; None: only what holds no more mappings and lists.
        width: Of lines, in letters.
    """
    return str(yaml.dump(content, Dumper=_Dumper, sort_keys=False, default_flow_style=flow, width=width))


def write_yaml(path: Path, content: Mapping[str, Any]) -> None:
    """Write a YAML file, whole or not at all, its keys in their own order.

    Args:
        path: Of the file.
        content: Plain values.

    Raises:
        OutputError: It cannot be written.
    """
    with whole_file(path) as partial:
        partial.write_text(dump_yaml(dict(content)), encoding="utf-8")


class _Reader:
    """Makes values of one document's nodes."""

    def __init__(self) -> None:
        self._made: dict[int, Any] = {}
        self._depth = 0

    def value(self, node: yaml.Node) -> Any:  # noqa: ANN401
        # Aliases of one anchor are one value: a document of a few lines could say a billion otherwise.
        if id(node) in self._made:
            return self._made[id(node)]
        self._depth += 1
        if self._depth > _DEEPEST:
            raise _Refused(_line(node), f"more than {_DEEPEST} levels, or an anchor within itself")
        if isinstance(node, yaml.ScalarNode):
            made = _scalar(node)
        elif node.tag == _TAG + "seq" and isinstance(node, yaml.SequenceNode):
            made = [self.value(one) for one in node.value]
        elif node.tag == _TAG + "map" and isinstance(node, yaml.MappingNode):
            made = self._mapping(node)
        else:
            raise _unknown_tag(node)
        self._depth -= 1
        self._made[id(node)] = made
        return made

    def _mapping(self, node: yaml.MappingNode) -> dict[str | int, Any]:
        merged: dict[str | int, Any] = {}
        own: list[tuple[str | int, yaml.Node]] = []
        lines: dict[str, int] = {}
        for key_node, value_node in node.value:
            if key_node.tag == _TAG + "merge":
                merged = self._merged(value_node) | merged
                continue
            key = _key(key_node)
            # 1 and "1" would fall together somewhere.
            if str(key) in lines:
                found = f"the key `{key}` a second time, after line {lines[str(key)]}"
                raise _Refused(_line(key_node), found, "keep one of them")
            lines[str(key)] = _line(key_node)
            own.append((key, value_node))
        return merged | {key: self.value(value_node) for key, value_node in own}

    def _merged(self, node: yaml.Node) -> dict[str | int, Any]:
        """Return what `<<` stands for: a mapping, or several, of which the first that has a key wins."""
        given = self.value(node)
        merged: dict[str | int, Any] = {}
        for one in given if isinstance(given, list) else [given]:
            if not isinstance(one, dict):
                raise _Refused(_line(node), "`<<` with something else than mappings")
            merged = one | merged
        return merged


def _key(node: yaml.Node) -> str | int:
    """Return a name as it is written, or a whole number."""
    if not isinstance(node, yaml.ScalarNode) or not node.value:
        raise _Refused(_line(node), "a key that is no name")
    return int(_scalar(node)) if node.tag == _TAG + "int" else str(node.value)


def _scalar(node: yaml.ScalarNode) -> Any:  # noqa: ANN401
    kind, text = node.tag.removeprefix(_TAG), str(node.value)
    if kind in ("str", "merge"):
        return text
    if kind not in _LOOKS:
        raise _unknown_tag(node)
    if not _LOOKS[kind].match(text):
        raise _Refused(_line(node), f"`{text[:80]}`, which is no {kind}")
    if kind == "null":
        return None
    if kind == "bool":
        return text.lower() == "true"
    if kind == "int":
        if len(text) > _DIGITS:
            raise _Refused(_line(node), f"a number of {len(text)} digits")
        return int(text, 0)
    number = float(text.lower().replace(".inf", "inf").replace(".nan", "nan"))
    if math.isinf(number) and not text.lower().endswith("inf"):
        raise _Refused(_line(node), f"the number {text[:80]}, which is too large")
    return number


def _unknown_tag(node: yaml.Node) -> _Refused:
    return _Refused(_line(node), f"a value marked `{node.tag.replace(_TAG, '!!')}`, which is not read")


def _line(node: yaml.Node) -> int:
    return int(node.start_mark.line) + 1


def _line_of(problem: yaml.YAMLError, text: str) -> str:
    mark = getattr(problem, "problem_mark", None) or getattr(problem, "context_mark", None)
    if mark is not None:
        return f", line {mark.line + 1}"
    position = getattr(problem, "position", None)
    return "" if position is None else f", line {text.count(chr(10), 0, position) + 1}"


def _reason(problem: yaml.YAMLError) -> str:
    reason = getattr(problem, "problem", None) or getattr(problem, "reason", None) or "cannot be read"
    return str(reason)
