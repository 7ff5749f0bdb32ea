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


@pytest.mark.long
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("element", ["Q1", "Q2", "P1", "P2"])
def test_bottom_bears_the_force_of_the_interface(mode, element):
    interface = interface_of(block_of(element=element, cells=(4, 4, 3)), (2, 3))
    pressed = LawContactProblem(interface, uneven_laws(6), mode)
    for approach in (2e-3, 8e-3):
        state = pressed.solve(Control(approach=approach, tilt=(1e-3, -2e-3)))
        assert state.force > 0.0
        # residuals of 1e-9 of the load, added up over the nodes
        assert state.reaction == pytest.approx(state.force, rel=1e-9)
        assert state.force == pytest.approx(
            state.patch_pressure.sum() * interface.patches.area, rel=1e-12
        )


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
def test_tangent_is_the_derivative_of_the_residual(mode, control):
    interface = interface_of(block_of(element="P2", cells=(3, 3, 2)), (2, 2))
    laws = [PowerLaw(3e4 * (i + 1), touch=1e-4 * i) for i in range(4)]
    pressed = LawContactProblem(interface, laws, mode)
    at = interface.body.stiffness.createVecRight()
    at.array[:] = pressed.solve(control).displacement
    equations = pressed.equilibrium
    direction, ahead, behind, product = (at.duplicate() for _ in range(4))
    direction.array[:] = 1e-3 * np.random.default_rng(5).normal(size=at.local_size)
    step = 1e-3  # closures of about 3e-3 mm change by 1e-6: truncation 1e-8, rounding 1e-10
    equations.residual(at + step * direction, ahead)
    equations.residual(at - step * direction, behind)
    equations.update_tangent(at)
    equations.tangent.mult(direction, product)
    interface.body.stiffness.mult(direction, at)
    numerical = (ahead.array - behind.array) / (2.0 * step) - at.array
    analytic = product.array - at.array  # the laws' part alone, or K would hide it
    assert np.abs(analytic).max() > 1e-3
    np.testing.assert_allclose(numerical, analytic, atol=1e-6 * np.abs(analytic).max())


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


@pytest.mark.long
@pytest.mark.parametrize("mode", MODES)
def test_default_tolerances_take_few_steps_and_give_the_same_answer(mode):
    interface = interface_of(block_of(cells=(8, 8, 5)), (4, 4))
    laws = uneven_laws(16)
    pressed = LawContactProblem(interface, laws, mode)
    states = [pressed.solve(Control(approach=1e-3 * k)) for k in range(1, 9)]
    assert max(state.iterations for state in states) <= 6
    assert all(state.residuals[-1] <= 1e-9 for state in states)
    alone = LawContactProblem(interface, laws, mode).solve(Control(approach=8e-3))
    # the answer does not depend on the path: laws without hysteresis, residuals below 1e-9
    np.testing.assert_allclose(states[-1].patch_pressure, alone.patch_pressure, rtol=1e-8)


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
