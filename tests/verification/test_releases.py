"""The same scene gives the same force on every release of dolfinx, PETSc, numpy and scipy."""

from pathlib import Path

import numpy as np
import pytest

from patchlaw.multiscale import Scene, run

PAPER = Path(__file__).parents[2] / "demos" / "scenes" / "paper.toml"
SMALL = [
    "surface.grid=[64, 64]", "block.cells=[8, 8, 5]", "load.steps=2",
    "output.figures=false", "output.report=false", "output.check=none",
]  # fmt: skip
# Figures of Debian 12 (dolfinx 0.5.2, PETSc 3.18.5, numpy 1.24.2, scipy 1.10.1) on one rank.
# Debian 13 (0.9.0, 3.22.5, 2.2.4, 1.15.3) and sid (0.11.0, 3.25.5, 2.4.6, 1.17.1) gave the first
# to 1e-14; the second is to be compared there anew since it knows slopes.
FORCES = {
    "embedded": (["patches.grid=[4, 2]"], [0.5591384826747613, 2.4175091443148617]),
    "concurrent": (
        ["coupling.kind=concurrent", "micro.model=half-space"],
        [0.6125249040556763, 2.9439139574577693],
    ),
}


@pytest.mark.parametrize(("scene", "force"), FORCES.values(), ids=FORCES)
def test_force_does_not_depend_on_the_release(scene, force):
    history = run(Scene.load(PAPER, SMALL + scene))
    # the residuals of Newton's methods are driven to 1e-10 of the load or below
    np.testing.assert_allclose(history.force_N, force, rtol=1e-8)
