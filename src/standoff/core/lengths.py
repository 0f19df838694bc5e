"""Lengths as people read and type them, in metres or in feet. All else in standoff is in metres."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final, Literal

UnitName = Literal["metres", "feet"]

_FOOT_M: Final = 0.3048
_ROUND: Final = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0, 2000.0, 5000.0)
_SAID = re.compile(r"(?<![\w.])(\d+(?:\.\d+)?(?:(?:, | and | by )\d+(?:\.\d+)?)*) m\b(?![/²])")
_NUMBER = re.compile(r"\d+(?:\.\d+)?")


@dataclass(frozen=True, slots=True)
class LengthUnit:
    """A unit that people read lengths in, and how exactly.

    Attributes:
        name: In settings.
        symbol: Behind numbers.
        in_m: How long it is.
        whole_from: In this unit: lengths from here on that are no surer than a whole unit have no decimals.
    """

    name: UnitName
    symbol: str
    in_m: float
    whole_from: float = math.inf

    def length(self, length_m: float) -> str:
        """Return a length.

        >>> METRES.length(-0.04), METRES.length(2.26), FEET.length(2.26), FEET.length(float("nan"))
        ('0.0 m', '2.3 m', '7.4 ft', 'unknown')
        """
        if not math.isfinite(length_m):
            return "unknown"
        value = length_m / self.in_m
        return f"{self._rounded(value, self._decimals(value, math.nan))} {self.symbol}"

    def distance(self, distance_m: float, sigma_m: float, *, filtered: bool = False) -> str:
        """Return a distance with its standard error; what the outlier filter made up is marked.

        >>> METRES.distance(7.42, 0.31), METRES.distance(7.42, 0.031), METRES.distance(float("nan"), 1.0)
        ('7.4 ±0.3 m', '7.42 ±0.03 m', 'unknown')
        >>> METRES.distance(7.42, 0.31, filtered=True), METRES.distance(7.42, float("nan"))
        ('≈ 7.4 ±0.3 m', '7.4 m')
        >>> FEET.distance(7.42, 0.31), FEET.distance(42.0, 0.31)
        ('24.3 ±1.0 ft', '138 ±1 ft')
        """
        if not math.isfinite(distance_m):
            return "unknown"
        value, sigma = distance_m / self.in_m, sigma_m / self.in_m
        decimals = self._decimals(value, sigma)
        error = f" ±{sigma:.{decimals}f}" if math.isfinite(sigma) else ""
        return f"{'≈ ' if filtered else ''}{self._rounded(value, decimals)}{error} {self.symbol}"

    def limit(self, length_m: float) -> str:
        """Return a length that somebody set, without decimals that say nothing.

        >>> METRES.limit(1.0), FEET.limit(1.0)
        ('1 m', '3.28 ft')
        """
        return f"{round(length_m / self.in_m, 2):g} {self.symbol}"

    def bar(self, longest_m: float) -> tuple[float, str]:
        """Return the longest round length up to `longest_m`, the shortest one at least: in metres, and as text.

        >>> METRES.bar(7.0), FEET.bar(7.0)
        ((5.0, '5 m'), (6.096, '20 ft'))
        """
        value = max((one for one in _ROUND if one * self.in_m <= longest_m), default=_ROUND[0])
        return value * self.in_m, f"{value:g} {self.symbol}"

    def said(self, text: str) -> str:
        """Return a text of the stages, which speak of metres, with this unit in brackets behind them.

        >>> FEET.said("a rectangular reference of 2.4 by 3 m: expect 2 %")
        'a rectangular reference of 2.4 by 3 m (7.9 by 9.8 ft): expect 2 %'
        >>> METRES.said("a square reference of 2.89 m")
        'a square reference of 2.89 m'
        """
        return text if self is METRES else _SAID.sub(lambda found: f"{found[0]} ({self._converted(found[1])})", text)

    def _converted(self, numbers: str) -> str:
        return _NUMBER.sub(lambda one: f"{float(one[0]) / self.in_m:.1f}", numbers) + f" {self.symbol}"

    def _decimals(self, value: float, sigma: float) -> int:
        """Return how many decimals are worth reading; an error is never rounded to 0 where one more would show it."""
        if sigma < 0.095:
            return 2
        return 0 if value >= self.whole_from and not sigma < 0.95 else 1

    @staticmethod
    def _rounded(value: float, decimals: int) -> str:
        return f"{round(value, decimals) + 0.0:.{decimals}f}"  # + 0.0: there is no -0.0


METRES: Final = LengthUnit("metres", "m", 1.0)
FEET: Final = LengthUnit("feet", "ft", _FOOT_M, whole_from=100.0)
UNITS: Final[Mapping[UnitName, LengthUnit]] = MappingProxyType({"metres": METRES, "feet": FEET})
"""By name in settings."""


_TYPED_IN_M: Final = {
    "": 1.0, "m": 1.0, "cm": 0.01, "mm": 0.001, "ft": _FOOT_M, "'": _FOOT_M, "in": _FOOT_M / 12, '"': _FOOT_M / 12
}  # fmt: skip
_AMOUNT = r"\d+(?:\.\d*)?|\.\d+"
_TYPED = re.compile(rf"([-+]?)({_AMOUNT})\s*(m|cm|mm|ft|in|'|\"|)")
_FEET_AND_INCHES = re.compile(rf"([-+]?)(\d+)\s*(?:ft|')\s*({_AMOUNT})\s*(?:in|\")")
_PLAIN_SIGNS = str.maketrans({"\u2032": "'", "\u2019": "'", "\u2033": '"', "\u201d": '"'})


@dataclass(frozen=True, slots=True)
class TypedLength:
    """A length as somebody typed it.

    Attributes:
        text: What was typed.
        length_m: What it is.
        names_unit: Whether it says in what; a 0 need not.
    """

    text: str
    length_m: float
    names_unit: bool

    @classmethod
    def read(cls, text: str) -> TypedLength:
        r"""Read a number with a unit behind it, or without one: then it is metres.

        Raises:
            ValueError: It is no length.

        >>> TypedLength.read("9.5ft").length_m, TypedLength.read("2.89").names_unit
        (2.8956, False)
        >>> round(TypedLength.read("9'6\"").length_m, 6)
        2.8956
        """
        plain = text.strip().lower().translate(_PLAIN_SIGNS)
        if found := _FEET_AND_INCHES.fullmatch(plain):
            sign, feet, inches = found.groups()
            if float(inches) >= 12.0:
                raise ValueError(f"{text!r}: a foot has 12 inches")
            length_m, unit = (float(feet) + float(inches) / 12.0) * _FOOT_M, "ft"
        elif found := _TYPED.fullmatch(plain):
            sign, amount, unit = found.groups()
            length_m = float(amount) * _TYPED_IN_M[unit]
        else:
            raise ValueError(f"{text!r} is no length")
        return cls(text, -length_m if sign == "-" else length_m, names_unit=bool(unit) or length_m == 0.0)
