"""Two whole numbers with a sign between them, as several options take them."""

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
