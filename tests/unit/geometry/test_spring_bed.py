"""Springs behind laws: how many, how close, and what has none."""

import numpy as np
import pytest

from patchlaw.geometry import Friction, Material, MaterialPair
from patchlaw.geometry.materials import mindlin_ratio
from patchlaw.geometry.spring_bed import (
    FEWEST,
    MOST,
    TOLERANCE,
    SpringBed,
    never_falling,
    springs_of,
    springs_of_law,
    stiffness_ratios,
)
from patchlaw.support import InputError

TOUCH, END, DECAY = 0.37e-3, 6.1e-3, 0.83e-3


def hertzian(closure):
    return 217.0 * np.maximum(closure - TOUCH, 0.0) ** 1.5


def hertzian_rate(closure):
    return 325.5 * np.sqrt(np.maximum(closure - TOUCH, 0.0))


def exponential(closure):
    return 0.0193 * np.expm1(np.maximum(closure - TOUCH, 0.0) / DECAY)


def exponential_rate(closure):
    over = np.maximum(closure - TOUCH, 0.0)
    return 0.0193 / DECAY * np.exp(over / DECAY) * (closure > TOUCH)


LAWS = {"hertz": (hertzian, hertzian_rate), "exponential": (exponential, exponential_rate)}


@pytest.mark.parametrize("name", LAWS)
def test_ten_to_thirty_springs_keep_the_tolerance(name):
    bed = springs_of(*LAWS[name], TOUCH, END)
    assert FEWEST <= len(bed) <= MOST
    assert bed.error <= 3.0 * TOLERANCE  # raised for a law over three decades
    assert bed.missed <= 2.5 * bed.error  # misses of groups one after another add up
    closure = np.linspace(TOUCH, END, 57)
    pressure = LAWS[name][0](closure)
    allowed = np.maximum(pressure, 0.03 * pressure.max())  # the floor of errors
    assert np.abs(bed.pressure(closure) - pressure).max() > 0.0
    assert np.all(np.abs(bed.pressure(closure) - pressure) <= 1.05 * bed.missed * allowed)


@pytest.mark.parametrize("name", LAWS)
def test_the_normal_law_read_twice_is_that_of_the_springs(name):
    """μ [p(c) − p(c − s/(μ r))] for springs that all slide or stick, sampled by their groups."""
    pressure, rate = LAWS[name]
    bed = springs_of(pressure, rate, TOUCH, END)
    closure, largest = 0.9 * END, float(pressure(np.array([0.9 * END]))[0])
    for back in np.linspace(0.0, closure - TOUCH, 23):
        stuck = np.maximum(closure - back - bed.centre, 0.0) @ (
            bed.stiffness * np.clip((closure - bed.start) / bed.width, 0.0, 1.0)
        )
        exact = float(pressure(np.array([closure - back]))[0])
        assert stuck == pytest.approx(exact, abs=2.0 * bed.error * largest)


def test_a_linear_law_is_one_spring():
    bed = springs_of(lambda c: 17.0 * c, lambda c: np.full_like(c, 17.0), 0.0, END)
    assert len(bed) == 1
    assert bed.stiffness == pytest.approx([17.0])
    assert bed.error < 1e-13


def test_where_the_stiffness_falls_everywhere_one_spring_is_the_mean():
    def pressure(closure):  # of a patch whose neighbours take load over
        return np.sin(closure / END)

    def rate(closure):
        return np.cos(closure / END) / END

    bed = springs_of(pressure, rate, 0.0, END)
    assert bed.stiffness == pytest.approx([np.sin(1.0) / END], rel=1e-5)  # trapezoidal rule
    # the largest difference is from the chord, near 0.57 of the way, relative to the pressure
    assert bed.missed == pytest.approx(1.0 - np.sin(1.0), rel=0.01)


def test_where_the_stiffness_falls_here_and_there_springs_bear_the_pressure_elsewhere():
    dip = 0.002 * END

    def pressure(closure):  # contacts that ease as others come
        return closure**2 / END**2 + 0.02 * np.sin(closure / dip) * (closure < 0.3 * END) / 30.0

    def rate(closure):
        wave = 0.02 * np.cos(closure / dip) * (closure < 0.3 * END) / 30.0 / dip
        return 2.0 * closure / END**2 + wave

    bed = springs_of(pressure, rate, 0.0, END)
    closure = np.linspace(0.35, 1.0, 33) * END
    assert bed.pressure(closure) == pytest.approx(pressure(closure), rel=0.02)
    assert (np.diff(bed.start) > 0.0).all()
    assert (bed.stiffness > 0.0).all()


def test_values_that_do_not_fall_are_the_nearest_ones():
    random = np.random.default_rng(8)
    for count in (1, 2, 7, 12):
        values, weights = random.normal(size=count), random.uniform(0.1, 3.0, count)
        found = never_falling(values, weights)
        assert (np.diff(found) >= 0.0).all()
        # the minimum over all values that do not fall: min–max of means (Barlow et al. 1972)
        for k in range(count):
            lowest = [
                max(np.average(values[i : j + 1], weights=weights[i : j + 1]) for i in range(k + 1))
                for j in range(k, count)
            ]
            assert found[k] == pytest.approx(min(lowest), rel=1e-12, abs=1e-14)


def test_an_open_law_has_no_springs():
    assert len(springs_of(hertzian, hertzian_rate, np.inf, np.inf)) == 0


def test_a_law_without_range_is_refused():
    class Endless:
        pressure, stiffness = staticmethod(hertzian), staticmethod(hertzian_rate)

    with pytest.raises(InputError, match="needs the range of a law") as error:
        springs_of_law(Endless())
    assert error.value.key == "friction"
    for Endless.range in ((TOUCH, np.inf), (END, TOUCH), (np.nan, END)):
        with pytest.raises(InputError, match="needs the range of a law"):
            springs_of_law(Endless())
    Endless.range = (TOUCH, END)
    assert isinstance(springs_of_law(Endless()), SpringBed)


def test_the_ratio_is_that_of_the_bodies_or_of_the_laws():
    class Law:
        stiffness_ratio = 1.31

    assert stiffness_ratios([Law()], Friction(coefficient=0.2)) == pytest.approx([1.31])
    friction = Friction(coefficient=0.2, poisson_ratio=0.3)
    assert stiffness_ratios([Law()], friction) == pytest.approx([1.7 / 1.4])
    Law.stiffness_ratio = np.nan
    with pytest.raises(InputError, match="do not know their ratio") as error:
        stiffness_ratios([Law()], Friction(coefficient=0.2))
    assert error.value.key == "friction"


@pytest.mark.parametrize("poisson_ratio", [0.0, 0.21, 0.49])
def test_mindlins_ratio_is_that_of_the_pair(poisson_ratio):
    soft = Material(young_modulus=730.0, poisson_ratio=poisson_ratio)
    pair = MaterialPair(first=soft, second=soft)
    assert pair.stiffness_ratio == pytest.approx(mindlin_ratio(poisson_ratio), rel=1e-15)
    assert mindlin_ratio(0.0) == 1.0
