"""Error measures against closed forms, and against scipy and dense sampling as oracles."""

import numpy as np
import pytest
from scipy.stats import wasserstein_distance

from patchlaw.geometry import PatchGrid
from patchlaw.multiscale.runs.comparison import ERRORS, error_measures, on_grid, uncertainty

ROUNDING = 1e-12  # sums of a few dozen doubles


def curves(force, patch_pressure=None, grid=(2, 2), **columns):
    force = np.asarray(force, float)
    steps = np.arange(1.0, force.size + 1.0)
    if patch_pressure is None:
        patch_pressure = np.repeat(force[:, None], grid[0] * grid[1], axis=1)
    unknown = np.full(force.size, np.nan)
    content = {"approach": steps, "area": 0.1 * force, "separation": 10.0 - steps}
    content |= dict.fromkeys(("approach_error", "force_error", "area_error"), unknown)
    content |= {name: np.asarray(values, float) for name, values in columns.items()}
    return content | {
        "patches": grid, "force": force, "patch_pressure": np.asarray(patch_pressure, float),
    }  # fmt: skip


def test_relative_to_the_largest_or_the_same_step():
    right = curves([1.0, 4.0, 2.0], separation=[10.0, 5.0, 8.0])
    run = curves([1.5, 4.0, 1.8], separation=[10.0, 6.0, 8.4])
    found = error_measures(run, right, right["patches"])
    assert found["force_max"] == pytest.approx(0.5 / 4.0, rel=ROUNDING)
    assert found["force_last"] == pytest.approx(-0.2 / 2.0, rel=ROUNDING)
    assert found["separation_max"] == pytest.approx(1.0 / 5.0, rel=ROUNDING)
    assert found["separation_last"] == pytest.approx(0.4 / 8.0, rel=ROUNDING)
    assert (found["approach_max"], found["approach_last"]) == (0.0, 0.0)


def test_partial_run_is_measured_where_it_is():
    right, run = curves([1.0, 2.0, 40.0]), curves([1.0, 2.5])
    found = error_measures(run, right, right["patches"])
    assert found["force_max"] == pytest.approx(0.25, rel=ROUNDING)  # of 2 N, not of 40 N
    assert np.isnan([found["force_last"], found["pressure_l1"], found["distribution"]]).all()


def test_no_step_and_no_load_leave_everything_unknown():
    right = curves([0.0, 0.0])
    assert np.isnan(error_measures({}, right, right["patches"])["force_max"])
    found = error_measures(curves([1.0, 1.0]), right, right["patches"])
    assert np.isnan([found["force_max"], found["force_last"], found["pressure_l1"]]).all()


def test_unloading_to_nothing_has_no_relative_error_at_the_end():
    right, run = curves([4.0, 1e-12]), curves([4.0, 1e-11])
    assert np.isnan(error_measures(run, right, right["patches"])["force_last"])


def test_distances_of_pressures():
    right = curves([1.0], [[1.0, 0.0, 3.0, 0.0]])
    moved = curves([1.0], [[0.0, 1.0, 0.0, 3.0]])
    found = error_measures(moved, right, right["patches"])
    assert found["pressure_l1"] == pytest.approx(2.0, rel=ROUNDING)  # nothing in common
    assert found["distribution"] == 0.0  # blind to where
    double = curves([2.0], [[2.0, 0.0, 6.0, 0.0]])
    found = error_measures(double, right, right["patches"])
    assert found["pressure_l1"] == pytest.approx(1.0, rel=ROUNDING)
    assert found["distribution"] == pytest.approx(0.0, abs=ROUNDING)  # blind to the force


def test_distribution_is_the_wasserstein_distance_of_scipy():
    rng = np.random.default_rng(4)
    p, r = rng.exponential(size=(2, 48))
    grid = (6, 8)
    found = error_measures(curves([1.0], [p], grid), curves([1.0], [r], grid), grid)
    oracle = wasserstein_distance(p / p.mean(), r / r.mean())
    assert found["distribution"] == pytest.approx(oracle, rel=ROUNDING)


@pytest.mark.parametrize(("old", "new"), [((3, 2), (2, 5)), ((1, 1), (4, 4)), ((8, 4), (4, 2))])
def test_pressures_on_other_patches(old, new):
    rng = np.random.default_rng(1)
    given = PatchGrid(grid=old, lengths=(1.0, 2.0))
    wanted = PatchGrid(grid=new, lengths=(1.0, 2.0))
    pressure = rng.random(given.count)
    found = on_grid(pressure, old, new)
    assert found.sum() * wanted.area == pytest.approx(pressure.sum() * given.area, rel=ROUNDING)
    # points in the middle of cells that divide both grids: their mean is exact
    many = PatchGrid(grid=(24, 40), lengths=(1.0, 2.0))
    owner = wanted.index_of(*many.centres.T)
    sampled = pressure[given.index_of(*many.centres.T)]
    means = np.bincount(owner, sampled) / np.bincount(owner)
    np.testing.assert_allclose(found, means, rtol=ROUNDING)


def test_uncertainty_takes_error_bars_and_sums_refinements():
    best = curves([2.0, 4.0], force_error=[0.1, 0.04])
    by_mesh, by_cells = curves([2.0, 4.4]), curves([2.0, 3.6], area=[0.2, 0.44])
    found = uncertainty(best, [(by_mesh, best), (by_cells, best)], best["patches"])
    assert found["force_max"] == pytest.approx(0.1 / 4.0, rel=ROUNDING)
    assert found["force_last"] == pytest.approx(0.04 / 4.0, rel=ROUNDING)
    assert found["area_last"] == pytest.approx(0.1 + 0.1, rel=ROUNDING)
    assert found["pressure_l1"] == pytest.approx(0.1 + 0.1, rel=ROUNDING)


def test_steps_before_meshes_find_a_contact_leave_the_other_error_bars():
    best = curves([0.0, 4.0], force_error=[np.nan, 0.04])
    found = uncertainty(best, [], best["patches"])
    assert (found["force_max"], found["force_last"]) == pytest.approx((0.01, 0.01))


def test_nothing_is_known_without_error_bar_or_refinement():
    best = curves([2.0, 4.0])
    found = uncertainty(best, [], best["patches"])
    assert list(found) == list(ERRORS) and np.isnan(list(found.values())).all()
