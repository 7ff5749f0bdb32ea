"""Displacements of patches in the macro model that laws are calibrated to."""

from pathlib import Path

import numpy as np
import pytest

from multiscale import Scene, make_setup, run

PAPER = Path(__file__).parents[4] / "demos" / "scenes" / "paper.toml"
SMALL = [
    "surface.grid=[32, 32]", "block.cells=[8, 8, 5]", "patches.grid=[4, 2]", "load.steps=2",
    "micro.model=half-space", "coupling.kind=consistent", "coupling.compliance=finite-element",
]  # fmt: skip
# few rows of laws, and one step under them
COARSE = ["coupling.table_tolerance=0.02", "load.steps=1", "output.check=none"]


def test_the_mesh_gives_those_of_its_compliance():
    setup = make_setup(Scene.load(PAPER, SMALL))
    pressures = np.random.default_rng(1).uniform(0.0, 50.0, (3, 8))
    pressures[1] = 0.0  # before the first touch
    dense, meshed = (
        setup.bodies.patch_displacements(dense=dense, solutions=0)(pressures)
        for dense in (True, False)
    )
    np.testing.assert_allclose(meshed, dense, rtol=1e-8, atol=1e-12)  # linear solves to 1e-10
    assert np.all(meshed[1] == 0.0)


def test_laws_on_the_mesh_are_those_of_the_condensed_block():
    condensed, full = (
        run(Scene.load(PAPER, [*SMALL, *COARSE, f"coupling.newton={newton}"])).force_N
        for newton in ("condensed", "full")
    )
    np.testing.assert_allclose(full, condensed, rtol=1e-6)
    assert condensed[-1] == pytest.approx(3.0, rel=0.1)
