"""Read text, and say plainly in which encoding it may be where that is not UTF-8."""

from __future__ import annotations

from pathlib import Path
from typing import Final

_UTF16_MARKS: Final = (b"\xff\xfe", b"\xfe\xff")


def read_utf8(path: Path) -> str:
    """Read a text in UTF-8, without its byte order mark.

    Raises:
        OSError: It cannot be read.
        ValueError: It is in another encoding, or no text; the message says which, without the path.
    """
    content = path.read_bytes()
    refuse_no_text(content)
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        letter = content[error.start : error.start + 1]
        raise ValueError(
            f"byte 0x{letter[0]:02X} in line {line}, which is '{letter.decode('cp1252', 'replace')}' in Windows-1252 "
            "and nothing in UTF-8"
        ) from error


def refuse_no_text(content: bytes) -> None:
    """Refuse what is in no encoding that begins like ASCII.

    Raises:
        ValueError: It is UTF-16, or holds what no text does.
    """
    if content.startswith(_UTF16_MARKS):
        raise ValueError("UTF-16, not UTF-8")
    if b"\0" in content:
        raise ValueError("bytes that are not text")
