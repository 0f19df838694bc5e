from __future__ import annotations

import re
from decimal import Decimal
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from standoff.core.lengths import FEET, METRES, UNITS, LengthUnit, TypedLength

FOOT_M = Fraction(3048, 10000)
IN_M = {"m": Fraction(1), "ft": FOOT_M}
NUMBER = r"-?\d+(?:\.\d+)?"

units = st.sampled_from([METRES, FEET])
lengths_m = st.floats(0.0, 500.0)
sigmas_m = st.floats(1e-3, 30.0)


def _half_a_digit(text: str) -> Fraction:
    """Return how far off a number may be that was rounded to this text."""
    return Fraction(f"0.{len(text.partition('.')[2]) * '0'}5")


def test_every_unit_of_the_settings_is_there() -> None:
    assert {name: unit.name for name, unit in UNITS.items()} == {"metres": "metres", "feet": "feet"}


@given(lengths_m, sigmas_m, units)
def test_what_is_read_is_what_was_measured(distance_m: float, sigma_m: float, unit: LengthUnit) -> None:
    text = unit.distance(distance_m, sigma_m)
    match = re.fullmatch(rf"({NUMBER}) ±({NUMBER}) (m|ft)", text)
    assert match is not None and match[3] == unit.symbol
    for said, true in ((match[1], distance_m), (match[2], sigma_m)):
        off = abs(Fraction(said) * IN_M[unit.symbol] - Fraction(true))
        assert off <= _half_a_digit(said) * IN_M[unit.symbol] + Fraction(1, 10**9)


@given(lengths_m, sigmas_m)
def test_feet_are_never_written_less_exactly_than_metres(distance_m: float, sigma_m: float) -> None:
    in_metres, in_feet = (unit.distance(distance_m, sigma_m).split()[0] for unit in (METRES, FEET))
    finest_m, finest_ft_m = _half_a_digit(in_metres), _half_a_digit(in_feet) * FOOT_M
    # Two decimals in one and one in the other differ by a factor of three; whole feet are for errors above a foot.
    assert finest_ft_m <= 3.1 * finest_m or sigma_m >= 0.95 * float(FOOT_M)


@given(lengths_m, st.floats(0.02, 30.0), units)
def test_an_error_is_never_written_as_none(distance_m: float, sigma_m: float, unit: LengthUnit) -> None:
    match = re.search(rf"±({NUMBER})", unit.distance(distance_m, sigma_m))
    assert match is not None and float(match[1]) > 0


@given(st.floats(-50.0, 500.0), units)
def test_a_gap_keeps_its_sign_and_zero_has_none(gap_m: float, unit: LengthUnit) -> None:
    text = unit.length(gap_m)
    assert not re.fullmatch(r"-0(\.0)? .*", text)
    said = Fraction(text.split()[0])
    assert abs(said * IN_M[unit.symbol] - Fraction(gap_m)) <= _half_a_digit(text.split()[0]) * IN_M[unit.symbol]


def test_long_feet_have_no_decimals_that_nobody_knows() -> None:
    assert FEET.distance(42.0, 0.31) == "138 ±1 ft"
    assert FEET.distance(42.0, 0.1) == "137.8 ±0.3 ft"
    assert FEET.distance(30.0, 0.31) == "98.4 ±1.0 ft"
    assert METRES.distance(142.0, 5.0) == "142.0 ±5.0 m"


@given(st.floats(0.2, 900.0), units)
def test_a_scale_bar_is_round_fits_and_is_as_long_as_it_says(longest_m: float, unit: LengthUnit) -> None:
    length_m, text = unit.bar(longest_m)
    number, symbol = text.split()
    assert number.strip("0.") in ("1", "2", "5")
    assert length_m == pytest.approx(float(Fraction(number) * IN_M[symbol]))
    assert longest_m / 2.51 < length_m <= longest_m


SAID = [
    ("a square reference of 2.89 m", "a square reference of 2.89 m (9.5 ft)"),
    ("2 printed markers of 1.2 and 0.8 m", "2 printed markers of 1.2 and 0.8 m (3.9 and 2.6 ft)"),
    ("sides of 2, 3.05, 4 m: expect 2 %", "sides of 2, 3.05, 4 m (6.6, 10.0, 13.1 ft): expect 2 %"),
    ("6 surveyed points, 0.12 m off at the most", "6 surveyed points, 0.12 m (0.4 ft) off at the most"),
    ("stands 5.0 m from its stated place", "stands 5.0 m (16.4 ft) from its stated place"),
]  # fmt: skip


@pytest.mark.parametrize(("text", "in_feet"), SAID)
def test_what_the_stages_say_in_metres_is_said_in_feet_as_well(text: str, in_feet: str) -> None:
    assert FEET.said(text) == in_feet
    assert METRES.said(text) == text


@pytest.mark.parametrize("text", ["5 min", "12 m/s", "3 m²", "30 mm", "track 3 m", "marker3 m", "v1.2 of 4 people"])
def test_what_is_no_length_is_left_alone(text: str) -> None:
    assert FEET.said(text).startswith(text)
    assert (FEET.said(text) == text) == (text != "track 3 m")


@given(st.integers(0, 60), st.integers(0, 95), st.sampled_from([
    "{f}'{i}\"", "{f}' {i}\"", "{f}ft{i}in", "{f} ft {i} in", "{f}FT{i}IN", "{f}\u2032{i}\u2033", "{f}\u2019{i}\u201d",
]))  # fmt: skip
def test_feet_and_inches_are_read_in_every_spelling(feet: int, eighths: int, spelling: str) -> None:
    read = TypedLength.read(spelling.format(f=feet, i=eighths / 8))
    assert read.length_m == pytest.approx(float((feet + Fraction(eighths, 96)) * FOOT_M), abs=1e-12)
    assert read.names_unit


@given(st.decimals(0, 1000, places=3), st.sampled_from(["", "-", "+"]))
def test_a_unit_behind_a_number_is_what_it_says(amount: Decimal, sign: str) -> None:
    factor = {"": Fraction(1), "m": Fraction(1), "cm": Fraction(1, 100), "mm": Fraction(1, 1000)}
    factor |= {"ft": FOOT_M, "'": FOOT_M, "in": FOOT_M / 12, '"': FOOT_M / 12}
    for unit, in_m in factor.items():
        read = TypedLength.read(f"{sign}{amount}{unit}")
        assert read.length_m == pytest.approx(float(Fraction(f"{sign}{amount}") * in_m), abs=1e-12)
        assert read.names_unit == (bool(unit) or read.length_m == 0)


@pytest.mark.parametrize(
    "text",
    ["", "m", "ft", "9.5 foot", "9yd", "9'12\"", "9'6", "9.5'6\"", "6\"9'", "9'-6\"", "1e3", "nan", "inf", "0x9", "1,5",
     "1_000", "9ft6", "--9", "9''6\"", "9m6", "2.89 m m", "2.89k"],
)  # fmt: skip
def test_what_could_be_read_in_two_ways_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r"no length|12 inches"):
        TypedLength.read(text)
