"""Times and quantities as people say them, and that they mean the number that they stand for."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from patchlaw.support.quantities import parse_quantity
from patchlaw.support.readable import (
    duration,
    measured,
    number,
    percent,
    quantities,
    quantity,
    usual_unit,
    with_error,
)

SECONDS = {"s": 1.0, "min": 60.0, "h": 3600.0}


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (0.0, "0 s"), (0.0347, "0.035 s"), (9.94, "9.9 s"), (12.34, "12.3 s"), (59.94, "59.9 s"),
        (59.96, "1 min"), (80.3, "1 min 20 s"), (119.7, "2 min"), (3599.6, "1 h"),
        (7500.0, "2 h 5 min"), (86400.0, "24 h"),
    ],
)  # fmt: skip
def test_durations(seconds, text):
    assert duration(seconds) == text


def test_an_error_as_small_as_rounding_is_none():
    assert with_error(1.9999999999, 1e-15) == "2"
    assert with_error(2.0, 1e-8) == "2.000000000 ± 0.000000010"


@pytest.mark.slow
@given(st.floats(0.01, 1e6))
def test_duration_is_the_time(seconds):
    words = duration(seconds).split()
    said = sum(float(n) * SECONDS[unit] for n, unit in zip(words[::2], words[1::2], strict=True))
    assert said == pytest.approx(seconds, rel=0.051)  # two digits below 10 s
    assert all(
        float(n) < 60 for n, unit in zip(words[::2], words[1::2], strict=True) if unit != "h"
    )


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (0.008, "mm", "8 µm"), (1.0, "mm", "1 mm"), (999.99, "mm", "1 m"),
        (-3.2e-4, "mm", "-320 nm"),
        (210e3, "MPa", "210 GPa"), (4000.0, "MPa", "4 GPa"), (12345.678, "N", "12.35 kN"),
        (0.00099999, "N", "1 mN"), (0.0, "N", "0 N"), (1e-9, "mm", "0.001 nm"),
    ],
)  # fmt: skip
def test_quantities(value, unit, text):
    assert quantity(value, unit) == text


@pytest.mark.parametrize(
    ("values", "unit", "texts"),
    [
        ([0.16, 8.6e-4], "N", ["160 mN", "0.86 mN"]),
        ([2e-5, 3.14e-3, math.inf], "mm", ["0.02 µm", "3.1 µm", "∞ µm"]),
        ([0.0, 0.0], "MPa", ["0 MPa", "0 MPa"]), ([], "N", []),
    ],
)  # fmt: skip
def test_quantities_of_one_sentence_have_one_unit(values, unit, texts):
    assert quantities(values, unit, 2) == texts


@settings(deadline=None)  # the first call reads the units
@given(st.floats(1e-12, 1e12), st.sampled_from(["mm", "N", "MPa"]), st.integers(1, 9))
def test_quantity_is_read_back(value, unit, digits):
    again = parse_quantity(quantity(value, unit, digits), unit)
    assert again == pytest.approx(value, rel=0.51 * 10.0 ** (1 - digits))  # its last digit


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0"), (0.00012, "0.00012"), (41000.0, "41000"), (123456.0, "123500"), (-2.5, "-2.5"),
        (1.2347e-9, "1.235·10⁻⁹"), (4.2e12, "4.2·10¹²"), (math.nan, "–"), (math.inf, "∞"),
    ],
)  # fmt: skip
def test_numbers_have_no_power_of_ten_of_code(value, text):
    assert number(value) == text


@pytest.mark.parametrize(
    ("values", "unit", "found"),
    [
        ([0.01, 20.0], "N", ("N", 1.0)), ([3e-5, 2e-4], "N", ("µN", 1e-6)),
        ([2e5], "N", ("kN", 1e3)), ([5.9e-4], "mm", ("µm", 1e-3)), ([2e-5], "mm", ("nm", 1e-6)),
        ([math.nan, 0.0], "MPa", ("MPa", 1.0)),
        ([12.0, -30.0], "mm", ("mm", 1.0)), ([], "S", ("S", 1.0)),
        ([0.06, 3e-6], "mm³/s", ("mm³/s", 1.0)), ([7.0e4], "N/mm", ("kN/mm", 1e3)),
    ],
)  # fmt: skip
def test_columns_have_one_unit_that_suits_their_largest_value(values, unit, found):
    assert usual_unit(values, unit) == found


@pytest.mark.parametrize(
    ("value", "error", "unit", "text"),
    [
        (5.8987e-4, 6.5e-7, "mm", "0.58987 ± 0.00065 µm"),
        (1.3e-3, 4e-6, "N", "1.3000 ± 0.0040 mN"),
        (2.5e-4, None, "N", "250 µN"), (20.0, 0.0, "N", "20 N"), (14100.0, None, "MPa", "14.1 GPa"),
        (2.9e-6, 1.8e-6, "mm³/s", "(2.9 ± 1.8)·10⁻⁶ mm³/s"),
        (9.8e-6, None, "mm³/s", "9.8·10⁻⁶ mm³/s"),
    ],
)  # fmt: skip
def test_measured_quantities_have_value_and_error_in_one_unit(value, error, unit, text):
    assert measured(value, error, unit) == text


def test_shares_are_in_per_cent():
    assert [percent(share) for share in (0.5, 0.0123, 1.2e-6)] == ["50 %", "1.2 %", "0.00012 %"]
