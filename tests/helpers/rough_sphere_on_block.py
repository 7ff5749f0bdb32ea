"""The rough sphere of Greenwood & Tripp 1967 as a crowned block with a law of its roughness."""

import numpy as np

from helpers.block_cases import block_of
from helpers.rough_sphere_oracle import rough_sphere
from patchlaw.geometry import Control, PatchGrid
from patchlaw.macro import LawContactProblem, LoadedFace

RADIUS, DEVIATION = 1.0, 2e-4  # R and σ [mm]
ALONG = np.sqrt(2.0 * RADIUS * DEVIATION)
PRESSURE = np.sqrt(DEVIATION / (8.0 * RADIUS))  # of E* = 1 MPa


class Summits:
    """Pressure of asperities on a face, over its closure: a law as any user may write it."""

    def __init__(self, mu, heights):
        self._mu, self._heights = mu, heights

    def pressure(self, closure):
        return PRESSURE * self._mu * self._heights.force(6.0 - closure / DEVIATION)

    def stiffness(self, closure):
        return -PRESSURE * self._mu / DEVIATION * self._heights.slope(6.0 - closure / DEVIATION)


def forces_on_strips(mu, alpha, heights, cells, beyond):
    """Press a crowned block; return what strips of its face carry, and what the oracle says.

    Strips a cell wide, the middle one through the middle of the contact, carry the integrals of the
    pressure across it: their sum is the force, and the middle one tells ∫ p dρ.
    """
    exact = rough_sphere(mu, alpha, heights, beyond=np.sqrt(2.0) * beyond + 1.0)
    half = exact.hertz + beyond
    block = block_of(
        young_modulus=1.0,
        poisson_ratio=0.0,
        interface=(2.0 * half * ALONG,) * 2,
        height=4.0 * half * ALONG,  # the force is prescribed: a few radii are a half-space
        cells=(cells, cells, cells // 3 + 2),
        grading=16.0,
        margin=3.0 * half * ALONG,
        margin_cells=4,
        margin_grading=8.0,
    )
    strips = PatchGrid(grid=(cells, 1), lengths=block.mesh.shape.interface)
    pressed = LawContactProblem(
        LoadedFace.of_block(block, strips),
        [Summits(mu, heights)] * cells,
        "pointwise",
        crown=lambda x, y: ((x - half * ALONG) ** 2 + (y - half * ALONG) ** 2) / (2.0 * RADIUS),
    )
    force = exact.load * ALONG**2 * PRESSURE
    state = pressed.solve(Control(force=force))
    np.testing.assert_allclose(state.force, force, rtol=1e-9)
    found = state.patch_pressure / PRESSURE * (2.0 * half) ** 2 / cells
    return found, exact.strips(np.linspace(-half, half, cells + 1), half)
