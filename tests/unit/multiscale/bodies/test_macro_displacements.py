"""Displacements of patches in the macro model that laws are calibrated to."""

from pathlib import Path

import numpy as np
import pytest
from helpers.laws_on_mesh import lay_on_mesh

from patchlaw import macro
from patchlaw.geometry import Control
from patchlaw.macro import displacements_under
from patchlaw.multiscale import Scene, make_setup, run

PAPER = Path(__file__).parents[4] / "demos" / "scenes" / "paper.toml"
SMALL = [
    "surface.grid=[32, 32]", "block.cells=[8, 8, 5]", "patches.grid=[4, 2]", "load.steps=2",
    "micro.model=half-space", "coupling.kind=consistent",
]  # fmt: skip
# few rows of laws, and one step under them
COARSE = ["coupling.table_tolerance=0.02", "load.steps=1", "output.check=none"]


def test_the_mesh_gives_those_of_its_compliance(monkeypatch):
    lay_on_mesh(monkeypatch, condensed=True)
    setup = make_setup(Scene.load(PAPER, SMALL))
    pressures = np.random.default_rng(1).uniform(0.0, 50.0, (3, 8))
    pressures[1] = 0.0  # before the first touch
    dense, meshed = (setup.bodies.patch_displacements(solutions)(pressures) for solutions in (8, 0))
    np.testing.assert_allclose(meshed, dense, rtol=1e-8, atol=1e-12)  # linear solves to 1e-10
    assert np.all(meshed[1] == 0.0)


@pytest.mark.long
def test_laws_on_the_mesh_are_those_of_the_condensed_block(monkeypatch):
    found = []
    for condensed in (True, False):
        lay_on_mesh(monkeypatch, condensed=condensed)
        found.append(run(Scene.load(PAPER, [*SMALL, *COARSE])).force_N)
    condensed, full = found
    np.testing.assert_allclose(full, condensed, rtol=1e-6)
    words = ["surface.grid=[32, 32]", "micro.model=half-space", "coupling.kind=concurrent"]
    cells = run(Scene.load(PAPER, [*words, *COARSE[1:]])).force_N
    # laws are even over a patch, and their rows err by 2 % at most; 0.08 % measured
    np.testing.assert_allclose(condensed, cells, rtol=5e-3)


@pytest.mark.long
@pytest.mark.parametrize("element", ["P1", "Q1"])
def test_consistent_laws_solve_the_mesh_once_for_each_loaded_patch(monkeypatch, element):
    """Rows need these solutions, load steps no others; a second run of rows would find them."""
    monkeypatch.setenv("PATCHLAW_CACHE", "off")
    lay_on_mesh(monkeypatch, condensed=True)
    given = []

    def counted(face, pressures):
        given.append(pressures)
        return displacements_under(face, pressures)

    monkeypatch.setattr(macro, "displacements_under", counted)
    setup = make_setup(Scene.load(PAPER, [*SMALL, *COARSE, f"block.element={element}"]))
    assert setup.condensed
    step = setup.model.press(Control(approach=0.008))
    touched = setup.table.touched
    assert 0 < len(touched) < setup.parts.patches.count
    if element == "P1":
        np.testing.assert_array_equal(np.concatenate(given).sum(axis=0), np.isin(range(8), touched))
    else:  # hexahedra need no mesh
        assert not given and not setup.bodies.made_bodies
    # what the load step is in equilibrium with: the whole mesh under its pressures
    pressure = step.patches.pressure_MPa
    (moved,) = displacements_under(setup.bodies.contact_face, pressure[None])
    closure = 0.008 - moved
    np.testing.assert_allclose(step.patches.closure_mm, closure, rtol=1e-8)  # solved to 1e-10
    setup.release()
