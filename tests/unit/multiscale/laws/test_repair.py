"""Repaired laws rise, are the nearest that do, and say by how much they were changed."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize

from geometry.patches import PatchGrid
from multiscale.laws.files import LawTable, read_laws, write_laws
from multiscale.laws.patch_law import PatchLaw
from multiscale.laws.repair import evened, evened_law, repair_notes, risen

APPROACH = np.linspace(0.0, 8e-3, 9)
YIELDS = 2e-5  # own displacement by unit pressure [mm/MPa]


def rows(pressure):
    """Rows of a patch alone, its closure less than the approach by its own displacement."""
    pressure = np.asarray(pressure, float)
    nothing = np.zeros((len(pressure), 4))
    return np.column_stack((APPROACH, APPROACH - YIELDS * pressure, pressure, nothing))


def noisy(seed=3):
    clean = 4e5 * APPROACH**1.5
    return np.abs(clean + np.random.default_rng(seed).normal(0.0, 0.2, 9) * clean.max()) * (
        APPROACH > 0.0
    )


def law(pressure):
    made = rows(pressure)
    return PatchLaw(
        approach=made[:, 0], closure=made[:, 1], pressure=made[:, 2],
        contact_area_fraction=made[:, 3], contacts=np.arange(9), relief=made[:, 5],
        touch=0.0, reach=0.02,
    )  # fmt: skip


@pytest.mark.parametrize("seed", range(1, 6))
def test_is_the_nearest_rising_law(seed):
    given = noisy(seed)
    found, change = risen(rows(given))

    # an independent minimiser over rises ≥ 0
    def distance(rises):
        off = np.cumsum(rises) - given
        return off @ off, 2.0 * np.cumsum(off[::-1])[::-1]

    best = minimize(
        distance, np.full(9, given.max() / 9), jac=True, bounds=[(0.0, None)] * 9,
        options={"ftol": 1e-15, "gtol": 1e-12, "maxiter": 2000},
    )  # fmt: skip
    # L-BFGS-B stops at 1e-8 of the pressures
    np.testing.assert_allclose(found[:, 2], np.cumsum(best.x), atol=1e-5 * given.max())
    assert change == pytest.approx(np.abs(found[:, 2] - given).max() / given.max(), rel=1e-12)
    assert change > 0.0
    # closure still is the approach less the own displacement
    np.testing.assert_allclose(found[:, 1], APPROACH - YIELDS * found[:, 2], rtol=1e-12)


def test_rows_that_rise_are_left_alone():
    given = rows(4e5 * APPROACH**1.5)
    found, change = evened(given)
    assert change == 0.0 and np.array_equal(found, given)
    plain = law(4e5 * APPROACH**1.5)
    assert evened_law(plain) is plain


def test_a_closure_a_little_below_is_left_out_and_said():
    given = rows(4e5 * APPROACH**1.5)
    given[4, 1] = given[3, 1] - 4e-4 * np.ptp(given[:, 1])
    found, change = evened(given)
    np.testing.assert_array_equal(found, np.delete(given, 4, axis=0))
    assert change == pytest.approx(4e-4, rel=1e-9)


def table(pressures, coupling):
    laws = tuple(map(law, pressures))
    grid = PatchGrid(grid=(len(laws), 1), lengths=(1.0, 1.0))
    return LawTable(patches=grid, laws=laws, made_by={"coupling": coupling})


def test_a_noisy_file_is_repaired_and_says_so(tmp_path):
    clean = 4e5 * APPROACH**1.5
    written = table([clean, noisy()], "measured")
    write_laws(tmp_path / "laws.h5", written)
    found = read_laws(tmp_path / "laws.h5")
    assert found[0].repaired == 0.0 and np.array_equal(found[0].pressure, clean)
    assert np.all(np.diff(found[1].pressure) >= 0.0) and found[1].repaired > 0.01
    told = list(repair_notes(found.laws))
    assert len(told) == 1
    assert "in the laws of 1 of 2 patches pressure or closure fell" in told[0]
    assert f"by up to {found[1].repaired:.1e} of their largest" in told[0]
    # what was repaired once stays as it is, and still says so
    write_laws(tmp_path / "again.h5", found)
    again = read_laws(tmp_path / "again.h5")
    assert again[1].pressure.tobytes() == found[1].pressure.tobytes()
    assert again[1].repaired == found[1].repaired


def test_laws_of_a_whole_surface_may_fall(tmp_path):
    # hard: a neighbour that takes load over unloads a patch, which is no noise
    write_laws(tmp_path / "laws.h5", table([noisy()], "consistent"))
    found = read_laws(tmp_path / "laws.h5")
    assert np.array_equal(found[0].pressure, noisy())
    assert not list(repair_notes(found.laws))


def test_rounding_is_not_told():
    assert not list(repair_notes([replace(law(APPROACH), repaired=1e-9)]))
