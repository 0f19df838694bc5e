"""Files as they come out of a bad copy: valid bytes, changed here and there. No reader may answer with a traceback."""

from __future__ import annotations

from collections.abc import Callable
from random import Random

from hypothesis import strategies as st

_FEW = 4
"""Changes of one file: more and every reader stops at the first line."""
_WORDS = (
    b"\x00",
    b"\xff",
    b"\xef\xbb\xbf",
    b"\n",
    b"\t",
    b":",
    b"[",
    b"{",
    b"-",
    b'"',
    b"&a ",
    b"*a",
    b"!!",
    b"nan",
    b"1e999",
)
"""What trips parsers: of bytes, of text, of YAML, of JSON, of numbers."""


@st.composite
def mutated(draw: st.DrawFn, originals: st.SearchStrategy[bytes]) -> bytes:
    """Return valid bytes after one to four changes.

    A change overwrites a byte, cuts out a piece, says a piece twice, moves it elsewhere, puts in a word that trips
    parsers, or ends the file early.

    Args:
        draw: Given by hypothesis.
        originals: Of valid files: `st.sampled_from([a, b])`, `st.just(a)`.
    """
    content = draw(originals)
    for change in draw(st.lists(st.sampled_from(_CHANGES), min_size=1, max_size=_FEW)):
        content = change(draw, content)
    return content


def damaged(rng: Random, content: bytes, *more_words: bytes) -> bytes:
    """Return valid bytes after one to four changes, as `mutated` and thirty times as quick: for readers of short texts.

    Args:
        rng: Draws.
        content: A valid text.
        more_words: What trips this reader beside all others.
    """
    for _ in range(rng.randint(1, _FEW)):
        first = rng.randint(0, len(content))
        end = first + rng.randint(0, 12)
        noise = rng.randbytes(rng.randint(1, 3))
        piece = rng.choice([b"", noise, content[first:end] * 2, rng.choice([*_WORDS, *more_words])])
        content = content[:first] + piece + content[end:]
    return content


def _place(draw: st.DrawFn, content: bytes) -> int:
    return draw(st.integers(0, len(content)))


def _piece(draw: st.DrawFn, content: bytes) -> tuple[int, int]:
    first = _place(draw, content)
    return first, min(first + draw(st.integers(1, 40)), len(content))


def _overwritten(draw: st.DrawFn, content: bytes) -> bytes:
    place = _place(draw, content)
    return content[:place] + bytes([draw(st.integers(0, 255))]) + content[place + 1 :]


def _cut(draw: st.DrawFn, content: bytes) -> bytes:
    first, end = _piece(draw, content)
    return content[:first] + content[end:]


def _twice(draw: st.DrawFn, content: bytes) -> bytes:
    first, end = _piece(draw, content)
    return content[:end] + content[first:]


def _moved(draw: st.DrawFn, content: bytes) -> bytes:
    first, end = _piece(draw, content)
    piece, rest = content[first:end], content[:first] + content[end:]
    place = _place(draw, rest)
    return rest[:place] + piece + rest[place:]


def _tripped(draw: st.DrawFn, content: bytes) -> bytes:
    place = _place(draw, content)
    return content[:place] + draw(st.sampled_from(_WORDS)) + content[place:]


def _ended(draw: st.DrawFn, content: bytes) -> bytes:
    return content[: _place(draw, content)]


_CHANGES: tuple[Callable[[st.DrawFn, bytes], bytes], ...] = (_overwritten, _cut, _twice, _moved, _tripped, _ended)
