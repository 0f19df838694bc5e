"""Two whole numbers with a sign between them, as several options take them, and ranges of frames."""

from __future__ import annotations

from standoff.core.errors import ConfigError


def two_integers(text: str, sign: str, *, expected: str, example: str) -> tuple[int, int]:
    """Read `A<sign>B`.

    Args:
        text: What was written.
        sign: A lower-case letter or another character.
        expected: For the error: what the option takes.
        example: For the error: what could be written.

    Raises:
        ConfigError: It is not of that form.

    >>> two_integers("9X6", "x", expected="COLUMNSxROWS", example="9x6")
    (9, 6)
    """
    first, found, second = text.lower().partition(sign)
    if not (found and first.isdecimal() and second.isdecimal()):
        raise ConfigError(expected=expected, found=repr(text), fix=f"write for example {example}")
    return int(first), int(second)


def frame_range(text: str | None) -> tuple[int, int] | None:
    """Read `FIRST-LAST`, frames counted from 1; None stays None.

    Raises:
        ConfigError: It is not of that form.

    >>> frame_range("1-219")
    (1, 219)
    """
    if text is None:
        return None
    expected, example = "--frames FIRST-LAST", "--frames 1-219"
    first, last = two_integers(text, "-", expected=expected, example=example)
    if not 0 < first <= last:
        raise ConfigError(expected=expected, found=repr(text), fix=f"write for example {example}")
    return first, last


def size_or_none(size: str | None) -> tuple[int | None, int | None]:
    """Read `--size WIDTHxHEIGHT`; None stays (None, None)."""
    if size is None:
        return None, None
    return two_integers(size, "x", expected="a size as WIDTHxHEIGHT", example="1920x1080")
