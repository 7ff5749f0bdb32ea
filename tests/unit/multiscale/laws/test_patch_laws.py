"""All laws at once against the laws one by one, also where they are no functions of closure."""

from dataclasses import replace

import numpy as np
import pytest

from patchlaw.geometry import PatchGrid
from patchlaw.multiscale import LawTable, PatchLaw, PatchLaws
from patchlaw.multiscale.laws.rows import LawRows, Untouched
from patchlaw.multiscale.laws.worn_laws import WornLaws
from patchlaw.support import InputError


def law(touch=1e-3, rows=12, own=0.0, stiffness=4e3):
    approach = np.linspace(touch, 9e-3, rows)
    pressure = stiffness * (approach - touch) ** 1.5
    columns = LawRows(
        closure=approach - own * pressure, pressure=pressure, approach=approach,
        contact_area_fraction=3.0 * (approach - touch), contacts=np.arange(rows),
        unresolved_displacement=0.5 * (approach - touch),
    )  # fmt: skip
    return PatchLaw(rows=columns, first_touch=touch, initial_separation=0.02)


def open_law(touch=5e-3):
    return PatchLaw(rows=LawRows.none(), first_touch=touch, initial_separation=0.03)


LAWS = [law(), law(2e-3, 7, own=2e-4), open_law(), law(own=6e-3, rows=40), open_law(np.inf)]
FALLING = LAWS[3]


@pytest.mark.parametrize("common", [-1e-3, 1e-3, 1.7e-3, 4e-3, 8.99e-3, 9e-3, 0.02])
def test_packed_laws_are_the_laws(common):
    packed = PatchLaws(LAWS)
    local = common + 1e-4 * np.arange(5)
    for together, each in zip(
        packed.along(local),
        zip(*(one.along(s) for one, s in zip(LAWS, local, strict=True)), strict=True),
        strict=True,
    ):
        np.testing.assert_array_equal(together, np.array(each).ravel())
    point = packed.along(local)
    for index in (0, 1):  # those whose pressure is a function of closure
        values = LAWS[index].at(point.closure[index], extend=True)
        found = point.contact_area_fraction[index], point.separation[index]
        expected = values.contact_area_fraction, values.separation
        np.testing.assert_allclose(expected, found, rtol=1e-11, atol=1e-14)  # the inversion's
    rows = [np.searchsorted(one.rows.approach, s, side="right") - 1
            for one, s in zip(LAWS, local, strict=True)]  # fmt: skip
    assert point.contacts.tolist() == [max(row, 0) for row in rows]


def test_derivatives_are_exact():
    packed, h = PatchLaws(LAWS), 1e-9
    local = np.full(5, 6.123e-3)
    high, low, point = packed.along(local + h), packed.along(local - h), packed.along(local)
    # second-order differences of smooth pieces, and rounding of closures over h
    np.testing.assert_allclose(point.dclosure, (high.closure - low.closure) / 2e-9, rtol=1e-6)
    np.testing.assert_allclose(
        point.dpressure, (high.pressure - low.pressure) / 2e-9, rtol=1e-5, atol=1e-9
    )


def test_falling_closure_is_kept_along_the_approach():
    assert not FALLING.is_function
    local = np.linspace(1e-3, 9e-3, 101)
    point = FALLING.along(local)
    # p^(2/3) is a straight line; closure is interpolated on 40 rows
    np.testing.assert_allclose(point.pressure, 4e3 * (local - 1e-3) ** 1.5, rtol=1e-11, atol=1e-15)
    assert point.dclosure.min() < -0.5
    np.testing.assert_allclose(point.closure, local - 6e-3 * point.pressure, atol=3e-6)


def test_falling_closure_ends_the_law_over_closure():
    start, end = FALLING.range
    assert start == 1e-3
    assert end == FALLING.rows.closure.max()
    found = FALLING.at(np.linspace(start, end, 50))
    pressure, stiffness = found.pressure, found.stiffness
    assert np.all(np.diff(pressure) > 0.0)
    assert np.all(stiffness >= 0.0)
    with pytest.raises(InputError, match=r"beyond the end .* stops being a function of closure"):
        FALLING.at(1.01 * end)


def test_newton_may_look_beyond_where_closure_turns():
    """The law over closure goes on steeply there, and never onto the branch that falls."""
    _, end = FALLING.range
    turn = FALLING.rows.pressure[np.argmax(FALLING.rows.closure)]
    beyond = end + np.array([0.0, 1e-9, 1e-8, 1e-3])
    pressure, stiffness = FALLING.pressure(beyond), FALLING.stiffness(beyond)
    assert pressure[0] == pytest.approx(turn, rel=1e-12)
    assert np.all(np.diff(pressure) > 0.0)
    h = 1e-3 * (beyond[1:] - end)
    higher, lower = (FALLING.pressure(beyond[1:] + way * h) for way in (1, -1))
    # second-order differences of a power of 3/2
    np.testing.assert_allclose(stiffness[1:], (higher - lower) / (2 * h), rtol=1e-5)


@pytest.mark.parametrize("one", [LAWS[0], LAWS[1]])
def test_law_over_closure_is_the_law_along_the_approach(one):
    local = np.random.default_rng(2).uniform(0.0, 10e-3, 500)
    point = one.along(local)
    found = one.at(point.closure, extend=True)
    # the inversion ends at the rounding of the closure: 1e-16 over the distance from touch
    np.testing.assert_allclose(found.pressure, point.pressure, rtol=1e-9, atol=1e-15)
    np.testing.assert_allclose(
        found.stiffness, point.dpressure / point.dclosure, rtol=1e-8, atol=1e-9
    )


def test_ends_and_touches():
    packed = PatchLaws(LAWS)
    np.testing.assert_array_equal(packed.first_touch, [1e-3, 2e-3, 5e-3, 1e-3, np.inf])
    np.testing.assert_allclose(packed.end, [9e-3, 9e-3, 5e-3, 9e-3, np.inf], rtol=1e-15)


def test_laws_together_over_closure_are_the_laws():
    packed, rng = PatchLaws(LAWS), np.random.default_rng(3)
    patch = np.sort(rng.integers(0, len(LAWS), 200))
    closure = rng.uniform(-1e-3, 12e-3, 200)
    found = packed.at(patch, closure, extend=True)
    for index, one in enumerate(LAWS):
        own = patch == index
        for values, expected in zip(found, one.at(closure[own], extend=True), strict=True):
            # the inversion ends when the last closure is right to rounding
            np.testing.assert_allclose(values[own], expected, rtol=1e-12, atol=1e-18)
    new = np.zeros_like(closure)
    np.testing.assert_array_equal(packed.pressures(patch, closure, new), found.pressure)
    np.testing.assert_array_equal(packed.stiffnesses(patch, closure, new), found.stiffness)


def test_laws_together_refuse_what_one_of_them_refuses():
    packed, (_, end) = PatchLaws(LAWS), FALLING.range
    within = np.array([8e-3, 8e-3, 4e-3, end * (1.0 + 1e-13), 1.0])
    assert np.isfinite(packed.at(np.arange(5), within).pressure).all()
    beyond = within + np.array([0.0, 0.0, 0.0, 1e-6, 0.0])
    problem = rf"^{beyond[3]:.6g}.* stops being a function of closure .*up to {end:.6g} mm"
    with pytest.raises(InputError, match=problem):
        packed.at(np.arange(5), beyond)


def worn_table():
    """Two laws that nearly close, and what they are once 1 µm has worn off."""
    area = np.linspace(0.0, 0.98, 12) ** 3
    laws = [law(1e-3), law(2e-3)]
    laws = [replace(one, rows=replace(one.rows, contact_area_fraction=area)) for one in laws]
    depths = WornLaws(depth=np.array([1e-3]), laws=(laws[1],))
    return LawTable(
        patches=PatchGrid(grid=(1, 1), lengths=(1.0, 1.0)), laws=(laws[0],), made_by={},
        worn=(depths,),
    )  # fmt: skip


@pytest.mark.parametrize("depth", [0.0, 4e-4, 1e-3, 2e-3])
def test_no_more_than_the_whole_face_touches_beyond_the_end_of_laws_that_wear(depth):
    closures = np.linspace(-1e-3, 0.02, 50)
    found = worn_table().running_in.at(
        np.zeros(50, np.intp), closures, np.full(50, depth), extend=True
    )
    area = found.contact_area_fraction
    assert area.min() == 0.0 and area.max() == 1.0
    assert (np.diff(area) >= 0.0).all()


def test_laws_of_worn_surfaces_have_the_stiffness_ratio_of_the_bodies():
    table = worn_table().with_stiffness_ratios([1.25])
    assert table.at_levels(np.array([1]))[0].stiffness_ratio == table[0].stiffness_ratio == 1.25


@pytest.mark.parametrize("index", [1, 2, 3])
def test_untouched_patches_are_displaced_by_others(index):
    """Against linear interpolation, also at closures, and in a law that never touches."""
    touch = LAWS[index].rows.closure[0] if LAWS[index].rows else 5e-3
    own = LAWS[index].rows.unresolved_displacement[:1]
    closures = np.append(touch - np.array([4.3e-3, 2.9e-3, 1.1e-3]), [touch] * len(own))
    displaced = np.append([0.0, 1.7e-4, -2.3e-4], own)
    untouched = Untouched(closure=closures, unresolved_displacement=displaced)
    laws = [replace(one, untouched=untouched) if k == index else one for k, one in enumerate(LAWS)]
    packed, plain, every = PatchLaws(laws), PatchLaws(LAWS), np.linspace(-6e-3, touch, 41)[:-1]
    for closure in every:
        found = packed.at(index, np.array([closure]))
        gap = LAWS[index].initial_separation - closure + np.interp(closure, closures, displaced)
        if closure > closures[-1]:  # an open one goes on along its tangent
            gap += (closure - closures[-1]) * np.diff(displaced)[-1] / np.diff(closures)[-1]
        assert found.closure[0] == pytest.approx(closure, rel=1e-12)
        assert found.separation[0] == pytest.approx(gap, rel=1e-12)
        assert found.pressure[0] == found.dpressure[0] == 0.0
        local = closure + (LAWS[index].rows.approach - LAWS[index].rows.closure)[:1].sum()
        along = packed.along(np.full(5, local))
        assert along.separation[index] == pytest.approx(gap, rel=1e-12)
        after = packed.along(np.full(5, local + 1e-9)).separation[index]
        assert along.dseparation[index] == pytest.approx((after - gap) / 1e-9, rel=1e-4)
        assert packed.interface_stiffness(along)[index] == 0.0
    local = np.full(5, 8e-3)  # all else is as it was
    for with_rows, without in zip(packed.along(local), plain.along(local), strict=True):
        others = np.arange(5) != index if LAWS[index].is_open else np.full(5, True)
        np.testing.assert_array_equal(with_rows[others], without[others])
