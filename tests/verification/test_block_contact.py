"""The pressed block: equilibrium, exact tangent, quadratic convergence, closed forms."""

import numpy as np
import pytest
from helpers.block_cases import block_of, interface_of, uneven_laws
from helpers.contact_laws import PowerLaw
from petsc4py import PETSc
from scipy.optimize import brentq

from patchlaw.geometry import Control
from patchlaw.macro import LawContactProblem

MODES = ["patchwise", "pointwise"]
CONTROLS = {
    "approach": Control(approach=8e-3),
    "force": Control(force=5.0, tilt=(1e-3, -2e-3)),
    "free": Control(approach=8e-3, tilt=None),
    "force, free": Control(force=5.0, tilt=None),
}


@pytest.mark.parametrize("mode", MODES)
def test_confined_block_under_one_law_solves_a_scalar_equation(mode):
    block = block_of("roller", height=0.6, cells=(4, 5, 3))
    law = PowerLaw(2e5, touch=1e-3)
    interface = interface_of(block, (3, 2))  # borders cut elements: nothing may change
    state = LawContactProblem(interface, [law] * 6, mode).solve(Control(approach=9e-3))
    stiffness = block.material.confined_modulus / 0.6
    pressure = brentq(lambda p: law.pressure(9e-3 - p / stiffness) - p, 0.0, 100.0, xtol=1e-13)
    # uniform strain is exact; what is left is the tolerance of Newton's method
    np.testing.assert_allclose(state.patch_pressure, pressure, rtol=1e-8)
    np.testing.assert_allclose(state.patch_closure, 9e-3 - pressure / stiffness, rtol=1e-8)


@pytest.mark.long
@pytest.mark.parametrize("control", CONTROLS.values(), ids=CONTROLS)
@pytest.mark.parametrize("mode", MODES)
def test_newton_ends_quadratically(mode, control):
    options = PETSc.Options("patchlaw_")
    options["ksp_rtol"], options["snes_rtol"] = 1e-13, 1e-11
    try:
        interface = interface_of(block_of(cells=(6, 6, 4)), (3, 3))
        pressed = LawContactProblem(interface, uneven_laws(9, k=2e5), mode)
        residuals = pressed.solve(control).residuals
    finally:
        options.delValue("ksp_rtol"), options.delValue("snes_rtol")
    assert len(residuals) <= 7
    # near the solution, and above the rounding of the residual
    tail = np.log(residuals[(residuals < 0.3) & (residuals > 1e-13)])
    orders = tail[1:] / tail[:-1]
    assert len(orders) >= 1
    assert (orders[-2:] > 1.7).all(), residuals  # 2 in the limit


def test_patchwise_pressures_solve_the_condensed_problem():
    """Oracle: compliance by one linear solve per patch, then a dense Newton in the pressures."""
    from scipy.optimize import root

    interface = interface_of(block_of(cells=(5, 5, 3)), (2, 3))
    block, laws = interface.body, uneven_laws(6)
    compliance = []
    for unit in np.eye(6):
        load = interface.load(unit)
        load.array[:] = block.solve(load).x.array[: block.owned_dofs]
        compliance.append(interface.patch_displacements(load))
    tilt = interface.patches.centres @ [1e-3, 2e-3] - 1.5e-3

    def mismatch(p):
        closure = 8e-3 + tilt - np.transpose(compliance) @ p
        return p - [law.pressure(c) for law, c in zip(laws, closure, strict=True)]

    expected = root(mismatch, np.zeros(6), tol=1e-13).x
    state = LawContactProblem(interface, laws).solve(Control(approach=8e-3, tilt=(1e-3, 2e-3)))
    np.testing.assert_allclose(state.patch_pressure, expected, rtol=1e-8)  # two solves of 1e-9
