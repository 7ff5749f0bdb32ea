"""Repaired laws rise, are the nearest that do, and say by how much they were changed."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize

from patchlaw.geometry import PatchGrid
from patchlaw.multiscale import LawTable, PatchLaw, read_laws, write_laws
from patchlaw.multiscale.laws.interpolation import rising_curves
from patchlaw.multiscale.laws.patch_law import repaired_law
from patchlaw.multiscale.laws.rows import LawRows

APPROACH = np.linspace(0.0, 8e-3, 9)
COMPLIANCE = 2e-5  # own displacement by unit pressure [mm/MPa]


def rows(pressure):
    """Rows of a patch alone, its closure less than the approach by its own displacement."""
    pressure, nothing = np.asarray(pressure, float), np.zeros(len(pressure))
    return LawRows(
        approach=APPROACH, closure=APPROACH - COMPLIANCE * pressure, pressure=pressure,
        contact_area_fraction=nothing, contacts=np.arange(9), unresolved_displacement=nothing,
    )  # fmt: skip


def noisy(seed=3):
    clean = 4e5 * APPROACH**1.5
    return np.abs(clean + np.random.default_rng(seed).normal(0.0, 0.2, 9) * clean.max()) * (
        APPROACH > 0.0
    )


def law(pressure, **changes):
    return PatchLaw(rows=rows(pressure), first_touch=0.0, initial_separation=0.02, **changes)


@pytest.mark.parametrize("seed", range(1, 6))
def test_is_the_nearest_rising_law(seed):
    given = noisy(seed)
    found, change = rows(given).with_rising_pressure()

    # an independent minimiser over rises ≥ 0
    def distance(rises):
        off = np.cumsum(rises) - given
        return off @ off, 2.0 * np.cumsum(off[::-1])[::-1]

    best = minimize(
        distance, np.full(9, given.max() / 9), jac=True, bounds=[(0.0, None)] * 9,
        options={"ftol": 1e-15, "gtol": 1e-12, "maxiter": 2000},
    )  # fmt: skip
    # L-BFGS-B stops at 1e-8 of the pressures
    np.testing.assert_allclose(found.pressure, np.cumsum(best.x), atol=1e-5 * given.max())
    assert change == pytest.approx(np.abs(found.pressure - given).max() / given.max(), rel=1e-12)
    assert change > 0.0
    # closure still is the approach less the own displacement
    np.testing.assert_allclose(found.closure, APPROACH - COMPLIANCE * found.pressure, rtol=1e-12)


def pairs(one, other):
    """Columns of two sets of rows, side by side."""
    return [(a, b) for (_, a), (_, b) in zip(one.columns(), other.columns(), strict=True)]


def test_rows_that_rise_are_left_alone():
    given = rows(4e5 * APPROACH**1.5)
    found, change = given.rising()
    assert change == 0.0
    assert all(np.array_equal(*pair) for pair in pairs(found, given))
    plain = law(4e5 * APPROACH**1.5)
    assert repaired_law(plain) is plain


def test_a_closure_a_little_below_is_left_out_and_said():
    given = rows(4e5 * APPROACH**1.5)
    closure = given.closure.copy()
    closure[4] = closure[3] - 4e-4 * np.ptp(closure)
    given = replace(given, closure=closure)
    found, change = given.rising()
    assert all(np.array_equal(one, np.delete(other, 4)) for one, other in pairs(found, given))
    assert change == pytest.approx(4e-4, rel=1e-9)


@pytest.mark.parametrize("second", [2.0, 0.0])
def test_curves_of_laws_side_by_side_are_those_of_each(second):
    first = rows(4e5 * APPROACH**1.5)
    noisy_one = replace(first, pressure=noisy())  # takes out rows where it is the second law
    other = noisy_one if second == 0.0 else replace(first, pressure=second * first.pressure)
    columns = {name: np.stack(both, axis=1) for (name, _), both in zip(
        first.columns(), pairs(first, other), strict=True)}  # fmt: skip
    together, at = rising_curves(LawRows(**columns)), APPROACH[1:-1] + 1e-5
    for number, one in enumerate((first, other)):
        alone = rising_curves(one.mapped(lambda column: column[:, None]))
        for found, known in zip(
            together.at(np.full(len(at), number), at), alone.at(np.zeros(len(at), int), at),
            strict=True,
        ):  # fmt: skip
            np.testing.assert_array_equal(found, known)


def repair_notes(found):
    return [note for note in found.notes(1.0) if "monotone repair" in note]


def table(pressures, coupling):
    laws = tuple(map(law, pressures))
    grid = PatchGrid(grid=(len(laws), 1), lengths=(1.0, 1.0))
    return LawTable(patches=grid, laws=laws, made_by={"coupling": coupling})


def test_a_noisy_file_is_repaired_and_says_so(tmp_path):
    clean = 4e5 * APPROACH**1.5
    written = table([clean, noisy()], "measured")
    write_laws(tmp_path / "laws.h5", written)
    found = read_laws(tmp_path / "laws.h5")
    assert found[0].repaired == 0.0 and np.array_equal(found[0].rows.pressure, clean)
    assert np.all(np.diff(found[1].rows.pressure) >= 0.0) and found[1].repaired > 0.01
    said = repair_notes(found)
    assert len(said) == 1
    assert "in the laws of 1 of 2 patches pressure or closure fell" in said[0]
    assert f"by up to {100 * found[1].repaired:.2g} % of their largest" in said[0]
    # what was repaired once stays as it is, and still says so
    write_laws(tmp_path / "again.h5", found)
    again = read_laws(tmp_path / "again.h5")
    assert again[1].rows.pressure.tobytes() == found[1].rows.pressure.tobytes()
    assert again[1].repaired == found[1].repaired


def test_laws_of_a_whole_surface_may_fall(tmp_path):
    # hard: a neighbour that takes load over unloads a patch, which is no noise
    write_laws(tmp_path / "laws.h5", table([noisy()], "consistent"))
    found = read_laws(tmp_path / "laws.h5")
    assert np.array_equal(found[0].rows.pressure, noisy())
    assert not repair_notes(found)


def test_rounding_is_not_reported():
    grid = PatchGrid(grid=(1, 1), lengths=(1.0, 1.0))
    laws = (law(APPROACH, repaired=1e-9),)
    assert not repair_notes(LawTable(patches=grid, laws=laws, made_by={}))
