"""Where rows are added, and which errors are stated, on laws of closed forms."""

import numpy as np
import pytest

from patchlaw.multiscale import PatchLaw, Run, Scene
from patchlaw.multiscale.laws.interpolation import LawCurves
from patchlaw.multiscale.laws.refinement import RowMaker, errors_at, refined
from patchlaw.multiscale.laws.rows import LawRows

STIFFNESS = 4e3
COMPLIANCE = np.array([[2e-4, 5e-5], [5e-5, 2e-4]])
KINK = 5.2e-3


def pressures(approach):
    """Two patches: a Hertz contact, and one that a second contact joins."""
    first = STIFFNESS * approach**1.5
    return np.column_stack((first, first + 3 * STIFFNESS * np.maximum(approach - KINK, 0) ** 1.5))


def rows_of(approach, pressure):
    """Rows of two patches on the half-space of the compliance."""
    local, nothing = np.column_stack((approach, approach)), np.zeros((len(approach), 2))
    return LawRows(
        approach=local, closure=local - pressure @ COMPLIANCE, pressure=pressure,
        contact_area_fraction=nothing, contacts=nothing.astype(int),
        unresolved_displacement=nothing, outside_range=nothing > 0.0,
    )  # fmt: skip


class Solver:
    def __init__(self):
        self.asked = []

    def __call__(self, approach):
        assert np.all(np.diff(approach) > 0.0)
        self.asked.extend(approach)
        return rows_of(approach, pressures(approach))


def laws(rows, errors=None):
    ends = {"first_touch": 0.0, "initial_separation": 0.02}
    return [
        PatchLaw(rows=rows[:, index], **ends, **(errors or [{}] * 2)[index]) for index in range(2)
    ]


def curves(rows):
    each = [rows[:, column] for column in range(rows.pressure.shape[1])]
    return LawCurves.through(each[0].joined(*each[1:]), list(map(len, each)), np.zeros(len(each)))


def made(tolerance, **given):
    solver = Solver()
    made = refined(RowMaker(solver, curves, COMPLIANCE), 0.0, 9e-3, tolerance, **given)
    return (
        laws(made.rows, [made.of_law(law) for law in range(2)]),
        made.force,
        np.array(solver.asked),
    )


def found(some, approach):
    """Errors of laws on the half-space at approaches, by Newton's method itself."""
    errors = []
    for delta in approach:
        local = np.full(2, delta)
        for _ in range(12):  # Newton's steps, from afar
            points = [law.along(s) for law, s in zip(some, local, strict=True)]
            c, p, dc, dp = np.array([point[:4] for point in points]).T
            local = local - np.linalg.solve(
                np.diag(dc) + COMPLIANCE * dp, c + COMPLIANCE @ p - delta
            )
        errors.append(p - pressures(np.array([delta]))[0])
    return np.array(errors)


def test_rows_gather_at_a_kink():
    _, _, asked = made(1e-5)
    steps = np.diff(np.sort(asked))
    middle = 0.5 * (np.sort(asked)[1:] + np.sort(asked)[:-1])
    near = np.abs(middle - KINK) < 2e-4
    assert steps[near].max() < 0.2 * steps[~near].max()
    assert len(np.unique(asked)) == len(asked)


def test_stated_errors_are_those_of_the_laws():
    some, force_error, _ = made(1e-4)
    assert force_error <= 1e-4
    approach = np.linspace(1e-4, 9e-3, 300)
    wrong, true = found(some, approach), pressures(approach)
    load = np.maximum(true.mean(axis=1), 0.03 * true[-1].mean())
    largest = np.max(np.abs(wrong.mean(axis=1)) / load)
    # a bound where the kink is, and a few times as much where all is smooth
    assert largest < force_error < 5 * largest
    for law, error in zip(some, (np.abs(wrong) / np.maximum(true, load[:, None])).T, strict=True):
        assert error.max() < law.interpolation_error <= 2e-3
        assert law.interpolation_error < 10 * error.max()  # nor much less than stated


def test_errors_are_what_the_half_space_makes_of_them():
    rows = Solver()(9e-3 * np.linspace(0.0, 1.0, 9))
    new = Solver()(np.array([3.3e-3, 5.6e-3]))
    guess = curves(rows).at(np.arange(2), new.approach)
    errors = errors_at(guess, np.ones((2, 2)), new, COMPLIANCE, 0.0, np.arange(2))
    wrong, true = found(laws(rows), new.approach[:, 0]), new.pressure
    # first order against Newton's method: errors of 1 % leave 1 % of them
    expected = np.abs(wrong.mean(axis=1)) / true.mean(axis=1)
    np.testing.assert_allclose(errors[:, 0], expected, rtol=0.02)
    expected = np.abs(wrong) / np.maximum(true, true.mean(axis=1)[:, None])
    np.testing.assert_allclose(errors[:, 1:3], expected, rtol=0.02, atol=1e-9)


@pytest.mark.parametrize("most", [17, 50, 90])
def test_budget_is_kept_and_the_error_stated(most):
    some, error, asked = made(1e-9, most_rows=most)
    assert len(asked) == most
    assert 1e-9 < error < 1e-2
    assert len(some[0].rows) == most


def test_rows_follow_the_mean_gap_towards_full_contact():
    """Of an interface with ū = ū₀ (1 − p/P)² the stiffness P/(2 √(ū ū₀)) has no bound."""
    initial, full = 0.01, 60.0
    pressure = lambda approach: full * (approach / 0.02)  # noqa: E731
    gap = lambda p: initial * (1.0 - p / full) ** 2  # noqa: E731

    def rows(approach):
        p = pressure(approach)[:, None]
        closure = approach[:, None] - COMPLIANCE[:1, :1] * p
        return LawRows(
            approach=approach[:, None], closure=closure, pressure=p,
            contact_area_fraction=p / full, contacts=np.ones(p.shape, int),
            unresolved_displacement=closure - initial + gap(p),
        )  # fmt: skip

    make = RowMaker(rows, curves, COMPLIANCE[:1, :1], initial)
    own = refined(make, 0.0, 0.0197, 1e-3).rows[:, 0]
    law = PatchLaw(rows=own, first_touch=0.0, initial_separation=initial)
    point = law.along(np.linspace(0.001, 0.0196, 300))
    expected = full / (2.0 * np.sqrt(gap(point.pressure) * initial))
    # of monotone cubic functions over logarithms that fall by halves; 60 % off without such rows
    np.testing.assert_allclose(law.interface_stiffness(point), expected, rtol=0.05)


def test_nothing_to_refine_without_contact():
    solve = lambda approach: rows_of(approach, np.zeros((len(approach), 2)))  # noqa: E731
    made = refined(RowMaker(solve, curves, COMPLIANCE), 0.0, 1e-3, 1e-3)
    assert made.force == 0.0
    assert not made.rows.pressure.any() and not made.pressure.any()


@pytest.mark.long
@pytest.mark.parametrize(("tolerance", "missed"), [(1e-9, True), (1e-2, False)])
def test_tolerance_that_is_missed_is_said(tolerance, missed):
    spectrum = {"hurst": 0.8, "waves": [2, 5], "rms_slope": 0.2, "seed": 1}
    run = Run(Scene.from_dict({
        "surface": {"spectrum": spectrum, "grid": [16, 16], "lengths": [1.0, 1.0]},
        "block": {"young_modulus": 4000.0, "poisson_ratio": 0.3, "cells": [4, 4, 4]},
        "patches": {"grid": [2, 2]}, "micro": {"model": "circular-independent"},
        "coupling": {"table_tolerance": tolerance}, "load": {"approach": 0.01, "steps": 1},
    }))  # fmt: skip
    run.make_laws()
    said = [
        note for note in run.history().notes if "the laws miss coupling.table_tolerance" in note
    ]
    assert len(said) == missed


def test_intervals_halved_for_their_gap_alone_may_have_no_error_at_all():
    """Of nothing over nothing errors became NaN, and rows were added no more."""

    def solve(approach):
        return rows_of(approach, np.ones((len(approach), 2)))

    found = refined(RowMaker(solve, curves, COMPLIANCE, 0.02), 0.0, 19.9e-3, 2e-3)
    gaps = (0.02 - found.rows.closure).mean(axis=1)
    assert len(found.rows) > 9  # the gap of the last of nine intervals falls by more than a half
    assert np.all(gaps[:-1] < 2.0 * np.maximum(gaps[1:], 1e-4 * gaps[0]) * (1 + 1e-12))
    assert found.force == 0.0
