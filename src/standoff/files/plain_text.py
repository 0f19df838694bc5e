"""Read text that other people's programs wrote: UTF-8, with or without a byte order mark."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from standoff.core.errors import DataError, StandoffError

_MARKS: Final = (
    (b"\xff\xfe\x00\x00", "UTF-32"),
    (b"\x00\x00\xfe\xff", "UTF-32"),
    (b"\xff\xfe", "UTF-16"),
    (b"\xfe\xff", "UTF-16"),
)
"""Byte order marks, longest first."""
_LOOKED_AT: Final = 4096
_EIGHT_BIT: Final = "Windows-1252 or another 8-bit encoding"


class UnknownEncoding(ValueError):
    """Bytes are not UTF-8; says what they look like.

    Args:
        likely: The encoding, for people.
        is_eight_bit: Whether every byte is likely a letter of its own.
    """

    def __init__(self, likely: str, *, is_eight_bit: bool = False) -> None:
        super().__init__(likely)
        self.is_eight_bit = is_eight_bit


def decoded(content: bytes) -> str:
    r"""Return bytes as text, without a byte order mark, all line ends as `\n`.

    Raises:
        UnknownEncoding: They are not UTF-8.

    >>> decoded(b"\xef\xbb\xbfperson\r\n")
    'person\n'
    """
    for mark, encoding in _MARKS:
        if content.startswith(mark):
            raise UnknownEncoding(encoding)
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        likely = _likely_encoding(content)
        raise UnknownEncoding(likely, is_eight_bit=likely == _EIGHT_BIT) from error
    if "\x00" in text:
        raise UnknownEncoding(_likely_encoding(content))
    return text.replace("\r\n", "\n").replace("\r", "\n")


def read_text(path: Path, what: str, error: type[StandoffError] = DataError) -> str:
    """Return a file's text, as `decoded`.

    Args:
        path: The file.
        what: What it should be, for the message ("a camera file").
        error: Raised where it cannot be read.

    Raises:
        StandoffError: `error`: it does not exist, cannot be read, or is not UTF-8; then its likely encoding is named.
    """
    try:
        return decoded(path.read_bytes())
    except FileNotFoundError:
        raise error(expected=f"{what} at {path}", found="no such file", fix="check the path") from None
    except OSError as problem:
        found = problem.strerror or type(problem).__name__
        raise error(expected=f"{what} at {path}", found=found, fix="check the path and its permissions") from None
    except UnknownEncoding as problem:
        raise error(expected=f"{what} in UTF-8 at {path}", found=f"{problem}", fix="save it as UTF-8 text") from None


def _likely_encoding(content: bytes) -> str:
    """Return the name of an encoding in which bytes that are not UTF-8 are text, for people."""
    start = content[:_LOOKED_AT]
    evens, odds = start[::2].count(0), start[1::2].count(0)
    # Latin letters in UTF-16 are a letter and a zero in turn.
    if max(evens, odds) > len(start) // 4 and min(evens, odds) * 8 < max(evens, odds):
        return "UTF-16"
    control = sum(byte < 32 and byte not in b"\t\n\r\f" for byte in start)
    if control:
        return "a binary file"
    # Of Western text few letters are not ASCII; all bytes but five are letters in Windows-1252.
    beyond_ascii = sum(byte > 127 for byte in start)
    return _EIGHT_BIT if beyond_ascii * 3 < len(start) else "a binary file, or other text"
