"""Mean displacements of patches by a matrix on few cells, against those of all cells."""

import numpy as np
import pytest

from patchlaw.geometry import PatchGrid
from patchlaw.geometry.patches import field_means, mean_shares
from patchlaw.micro import BodyModes, FreeSides
from patchlaw.micro.boundary_elements.grid_compliance import Compliance
from patchlaw.micro.boundary_elements.side_cells import SideTerm

LENGTHS, GRID = (1.0, 0.75), (40, 30)
PATCHES = {
    "along cells": PatchGrid(grid=(5, 3), lengths=LENGTHS),
    "across cells": PatchGrid(grid=(3, 4), lengths=(0.7, 0.6), origin=(0.13, 0.07)),
}
SIDES = SideTerm(FreeSides(lengths=LENGTHS, poisson_ratio=0.3, decay_length=0.2))


@pytest.mark.parametrize("patches", PATCHES.values(), ids=PATCHES)
@pytest.mark.parametrize("bounded", [False, True], ids=["half-space", "body with sides"])
def test_patches_are_displaced_as_their_cells_in_the_mean(patches, bounded):
    draws = np.random.default_rng(5)
    half = draws.normal(size=(9, 9))
    terms = [SIDES, BodyModes(LENGTHS, 1e-4 * (half + half.T))] if bounded else []
    spacing = LENGTHS[0] / GRID[0], LENGTHS[1] / GRID[1]
    body = Compliance(periodic=False, modulus=4000.0, terms=terms).on_grid(GRID, spacing)
    few, pressure = draws.permutation(np.prod(GRID))[:60], np.zeros(GRID)
    pressure.ravel()[few] = draws.random(60)
    found = body.on_patches(few, mean_shares(patches, LENGTHS, GRID)) @ pressure.ravel()[few]
    exact = field_means(body.displacement(pressure), LENGTHS, patches)
    # rounding of transforms of 1200 cells
    assert found == pytest.approx(exact, rel=1e-12, abs=1e-14 * np.abs(exact).max())
