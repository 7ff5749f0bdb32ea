"""The concurrent coupling against one dense complementarity problem, and path independence."""

import numpy as np
import pytest
from numpy.polynomial import legendre

from patchlaw.geometry import Control, PatchGrid, Spectrum, patch_means, synthesise
from patchlaw.micro import BodyModes, HalfSpaceModel
from patchlaw.multiscale import CellContact

MODULUS = 4000.0
CELLS = 16
SCENE = PatchGrid(grid=(2, 2), lengths=(1.0, 1.0))
SURFACE = synthesise(
    Spectrum(hurst=0.95, waves=(2, 6), rms_slope=0.215, seed=3),
    grid=(CELLS, CELLS),
    lengths=(1.0, 1.0),
)
MEANS = patch_means(SURFACE, SCENE)


def body(scale):
    """Return a soft body of 3 × 3 modes; ``scale`` 1 gives about as much as the half-space."""
    random = np.random.default_rng(4).normal(size=(9, 9))
    softness = np.diag([1.0, 0.3, 0.05, 0.3, 0.1, 0.02, 0.05, 0.02, 0.01])
    coupled = softness + 0.01 * random @ random.T
    return BodyModes((1.0, 1.0), scale * 0.946 / MODULUS * coupled)


def coupling(scale):
    """Return a coupling of the surface with the made-up body."""
    model = HalfSpaceModel(
        surface=SURFACE, contact_modulus=MODULUS, tolerance=1e-11, body=body(scale)
    )
    return CellContact(model, SCENE, MEANS)


def dense_forces(scale, approach, tilt):
    """Return the forces of all cells from one linear complementarity problem, shape (n, n) [N].

    Love's corner sum and the correction make one matrix; active sets are changed until the
    pressures are positive and the gaps not negative.
    """
    centres = (np.arange(CELLS) + 0.5) / CELLS
    x, y = (a.ravel() for a in np.meshgrid(centres, centres, indexing="ij"))
    matrix = np.zeros((CELLS**2, CELLS**2))
    for i in (1, -1):
        for j in (1, -1):
            u = x[:, None] - x + 0.5 * i / CELLS
            v = y[:, None] - y + 0.5 * j / CELLS
            matrix += i * j * (u * np.arcsinh(v / np.abs(u)) + v * np.arcsinh(u / np.abs(v)))
    matrix *= CELLS**2 / (np.pi * MODULUS)
    # means of Legendre's polynomials over cells, by another quadrature than the project's
    nodes, weights = legendre.leggauss(4)
    places = 2.0 * (centres[:, None] + 0.5 * nodes / CELLS) - 1.0
    means = np.array([legendre.Legendre.basis(k)(places) @ weights / 2.0 for k in range(3)])
    means *= np.sqrt(2.0 * np.arange(3) + 1.0)[:, None]
    modes = np.einsum("ki,lj->klij", means, means).reshape(9, CELLS**2)
    matrix += modes.T @ body(scale).matrix @ modes
    wanted = approach + tilt[0] * (x - 0.5) + tilt[1] * (y - 0.5)
    wanted = wanted - (SURFACE.highest - SURFACE.heights.ravel())
    on, forces = wanted > 0.0, np.zeros_like(x)
    for _ in range(500):
        forces = np.zeros_like(x)
        forces[on] = np.linalg.solve(matrix[np.ix_(on, on)], wanted[on])
        if forces.min() < 0.0:
            on = on & (forces > 0.5 * forces.min())
            continue
        gap = matrix @ forces - wanted
        if gap[~on].min() >= 0.0:
            return forces.reshape(CELLS, CELLS)
        on = on | (gap < np.where(on, -np.inf, 0.5 * gap[~on].min()))
    raise AssertionError("the oracle did not end")


CONTROLS = {
    "level": Control(approach=0.02),
    "tilted": Control(approach=0.02, tilt=(0.01, -0.004)),
    "force": Control(force=4.0),
    "balanced": Control(approach=0.02, tilt=None),
    "force, balanced": Control(force=4.0, tilt=None),
}
HALF = 0.5 * np.sqrt(2.0)


@pytest.mark.parametrize("scale", [-0.3, 1.0, 10.0])
@pytest.mark.parametrize("name", CONTROLS)
def test_the_coupling_finds_the_solution_of_the_whole_problem(name, scale):
    control = CONTROLS[name]
    step = coupling(scale).press(control)
    dense = dense_forces(scale, step.approach_mm, step.tilt)
    half = CELLS // 2
    patches = dense.reshape(2, half, 2, half).sum(axis=(1, 3)).ravel()
    force = dense.sum()
    # the residual of the complementarity problem is 1e-11
    np.testing.assert_allclose(step.force_N, force, rtol=1e-9)
    np.testing.assert_allclose(step.patches.pressure_MPa * 0.25, patches, atol=1e-9 * force)
    if control.force:
        np.testing.assert_allclose(force, control.force, rtol=1e-9)
    if control.tilt is None:
        centres = (np.arange(CELLS) + 0.5) / CELLS - 0.5
        moments = np.array([dense.sum(axis=1) @ centres, dense.sum(axis=0) @ centres])
        np.testing.assert_allclose(moments, 0.0, atol=1e-9 * force * HALF)
    else:
        assert step.tilt == control.tilt


def test_loading_and_unloading_end_in_the_same_state():
    up = coupling(3.0)
    loaded = [up.press(Control(approach=a)) for a in (0.01, 0.015, 0.02, 0.015)]
    first, again = loaded[1], loaded[3]
    # no iteration over the body is left, which ended at 1e-8
    np.testing.assert_allclose(again.force_N, first.force_N, rtol=1e-9)
    np.testing.assert_allclose(
        again.patches.pressure_MPa,
        first.patches.pressure_MPa,
        atol=1e-9 * first.patches.pressure_MPa.max(),
    )
