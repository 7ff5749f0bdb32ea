"""Consistent laws on the half-space give back the solution that they were made from."""

import numpy as np
import pytest

from geometry import PatchGrid, Spectrum, patch_means, synthesise
from geometry.control import Control
from micro import influence_matrix, micro_model
from multiscale.couplings.condensed import CondensedCoupling
from multiscale.law_tables.consistent import consistent_laws

MODULUS = 4000.0
END = 9e-3


@pytest.fixture(scope="module")
def surface():
    spectrum = Spectrum(hurst=0.95, waves=(2, 10), rms_slope=0.215, seed=3)
    return synthesise(spectrum, grid=(64, 64), lengths=(1.0, 1.0))


def parts(surface, grid, name="circular", tolerance=1e-4):
    model = micro_model(name, surface, contact_modulus=MODULUS)
    patches = PatchGrid(grid=grid, lengths=surface.lengths)
    means = patch_means(surface, patches)
    table = consistent_laws(
        model, patches, mean_heights=means, approach_end=END, tolerance=tolerance, most_rows=400
    )
    half_space = influence_matrix(patches) / (np.pi * MODULUS)
    return model, patches, means, table, CondensedCoupling(table, half_space)


@pytest.mark.parametrize("name", ["circular", "half-space"])
@pytest.mark.parametrize("grid", [(1, 1), (3, 2), (8, 8)])
def test_whole_surface_comes_back(surface, grid, name):
    model, patches, means, table, coupling = parts(surface, grid, name, 1e-3)
    law = max(table.laws, key=lambda one: len(one.approach))
    rows = law.approach[[len(law.approach) // 2, -1]]
    for approach in (*rows, 0.537 * END):
        step = coupling.press(Control(approach=approach))
        whole = model.respond([approach], patches=patches, mean_heights=means)
        # at rows the micro model's own tolerance; between them that of the tables
        allowed = 1e-6 if approach in rows else 1e-3
        assert step.force_N == pytest.approx(whole.force[0], rel=allowed)
        # an untouched patch is taken to sink by its neighbours' mean pressures
        assert step.mean_separation_mm == pytest.approx(whole.mean_separation[0], rel=5e-3)
        np.testing.assert_allclose(
            step.patches.pressure_MPa,
            whole.patch_pressure[0],
            atol=allowed * whole.patch_pressure.max(),
        )


def test_tables_keep_their_tolerance_and_say_so(surface):
    model, patches, means, table, _ = parts(surface, (3, 2))
    approach = np.random.default_rng(4).uniform(1e-3, END, 100)
    pressure = model.respond(approach, patches=patches, mean_heights=means).patch_pressure
    load = np.maximum(pressure.mean(axis=1), 0.01 * pressure.mean(axis=1).max())
    made = np.column_stack([law.along(approach).pressure for law in table.laws])
    # what the tables say is measured half-way between rows; elsewhere it may be a little more
    assert np.max(np.abs((made - pressure).mean(axis=1)) / load) < 3e-4
    assert table.force_error <= 1e-4
    for law, wrong, found in zip(table.laws, (made - pressure).T, pressure.T, strict=True):
        assert np.max(np.abs(wrong) / np.maximum(found, load)) < 3e-3
        assert law.interpolation_error <= 1e-3  # ten times as large as the force's
        assert law.is_open or 0.0 < law.stiffness_error < 0.1
    assert (table.made_by["coupling"], table.made_by["tilt"]) == ("consistent", "0, 0")


def test_surface_out_of_reach_stays_open(surface):
    model = micro_model("circular", surface, contact_modulus=MODULUS)
    patches = PatchGrid(grid=(2, 2), lengths=surface.lengths)
    means = patch_means(surface, patches)
    end = 0.5 * model.first_touch
    if end <= 0.0:  # the highest summit is touched at once: lower all others out of reach
        end = 1e-9
    table = consistent_laws(model, patches, mean_heights=means, approach_end=end)
    assert sum(not law.is_open for law in table.laws) <= 1


class Leaning:
    """A block that yields all at once: above a force it leans to a side."""

    def __init__(self, loads, enough, lean):
        self.loads, self._enough, self._lean = loads, enough, lean

    def sag(self, forces):
        lean = self._lean if forces.sum() > self._enough else 0.0
        return lambda x, y: lean * (x - 0.5)

    def patch_compliance(self, patches):
        return np.zeros((patches.count, patches.count))


@pytest.mark.parametrize("lower", [0, 1])
def test_patches_may_fall_behind_on_a_block_that_yields_all_at_once(surface, lower):
    model = micro_model("circular", surface, contact_modulus=MODULUS)
    patches = PatchGrid(grid=(2, 1), lengths=surface.lengths)
    means = patch_means(surface, patches)
    force = model.respond([0.5 * END], patches=patches, mean_heights=means).force[0]
    loads = PatchGrid(grid=(4, 4), lengths=surface.lengths)
    block = Leaning(loads, force, (-1e-3, 1e-3)[lower])
    table = consistent_laws(
        model, patches, mean_heights=means, approach_end=END, tolerance=1e-3, sinking=block
    )
    waits = (np.diff(table.spread.approach, axis=0) == 0.0).any(axis=0)
    assert waits[lower] and not waits[1 - lower]  # its rows behind those before are left out
