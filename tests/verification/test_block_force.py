"""The block under a force and under a plane free to turn, against approaches found otherwise."""

import numpy as np
import pytest
from helpers.block_cases import block_of, interface_of, uneven_laws
from helpers.contact_laws import PowerLaw
from petsc4py import PETSc
from scipy.optimize import root

from patchlaw.geometry import Control, PatchGrid
from patchlaw.macro import LawContactProblem, LoadedFace
from patchlaw.support import NotConverged

MODES = ["patchwise", "pointwise"]
HALF = 0.5 * np.sqrt(2.0)
TILTS = {"level": (0.0, 0.0), "tilted": (3e-3, -2e-3), "free": None}


def uneven_block(mode, grid=(3, 3), **given):
    interface = interface_of(block_of(cells=(6, 6, 4)), grid)
    return LawContactProblem(interface, uneven_laws(np.prod(grid), **given), mode)


@pytest.mark.long
@pytest.mark.parametrize("mode", MODES)
def test_column_under_a_force_has_a_closed_form(mode):
    block = block_of("roller", height=0.6, cells=(4, 5, 3))
    interface = interface_of(block, (3, 2))
    pressed = LawContactProblem(interface, [PowerLaw(2e5, touch=1e-3)] * 6, mode)
    stiffness = block.material.confined_modulus / 0.6
    for force in (3.0, 40.0, 1e-3):
        for tilt in ((0.0, 0.0), None):
            state = pressed.solve(Control(force=force, tilt=tilt))
            # uniform strain: the column and the law in series; residuals of 1e-10 of the load
            approach = force / stiffness + 1e-3 + (force / 2e5) ** (2 / 3)
            assert state.approach == pytest.approx(approach, rel=1e-9)
            np.testing.assert_allclose(state.tilt, 0.0, atol=1e-9 * approach)
            np.testing.assert_allclose(state.patch_pressure, force, rtol=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("tilt", TILTS.values(), ids=TILTS)
def test_force_and_moment_are_met(mode, tilt):
    pressed = uneven_block(mode)
    for force in (0.2, 20.0, 1e-3, 5.0):  # far up and far down
        state = pressed.solve(Control(force=force, tilt=tilt))
        assert abs(state.force - force) <= 1e-10 * force
        if tilt is None:
            assert np.abs(state.moment).max() <= 1e-10 * force * HALF
        else:
            assert state.tilt == tilt
        assert state.reaction == pytest.approx(force, rel=1e-9)  # residuals of 1e-10 of the load
        # the plane that was found, prescribed: the same state without any border
        again = pressed.solve(Control(approach=state.approach, tilt=state.tilt))
        assert again.force == pytest.approx(force, rel=1e-8)
        np.testing.assert_allclose(again.patch_pressure, state.patch_pressure, atol=1e-8 * force)
        np.testing.assert_allclose(again.moment, state.moment, atol=1e-8 * force * HALF)


@pytest.mark.slow
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("given", [{"approach": 9e-3}, {"force": 4.0}], ids=["approach", "force"])
def test_free_plane_is_that_of_another_solver(mode, given):
    """Oracle: MINPACK on planes that are prescribed."""
    state = uneven_block(mode).solve(Control(**given, tilt=None))
    other = uneven_block(mode)

    def loads(plane):
        found = other.solve(Control(approach=plane[0], tilt=tuple(plane[1:])))
        first = found.force - 4.0 if "force" in given else 1e3 * (plane[0] - 9e-3)
        return np.array([first, *found.moment])

    solved = root(loads, np.array([1e-2, 0.0, 0.0]), tol=1e-12)
    assert np.abs(solved.fun).max() < 1e-9 * state.force
    np.testing.assert_allclose([state.approach, *state.tilt], solved.x, rtol=1e-7)  # MINPACK's end
    assert min(np.abs(state.tilt)) > 1e-4  # laws that differ: the plane does turn


@pytest.mark.long
@pytest.mark.parametrize("mode", MODES)
def test_no_force_is_first_touch(mode):
    """As the laws tell it: where the first of the samples meets its law's touch."""
    pressed = uneven_block(mode)
    touch = np.array([law.touch for law in uneven_laws(9)])
    sampling = pressed.sampling
    for tilt in ((0.0, 0.0), (3e-3, -2e-3), None):
        if tilt is None:
            turned = pressed.solve(Control(force=2.0, tilt=None)).tilt
        state = pressed.solve(Control(force=0.0, tilt=tilt))
        assert state.tilt == (turned if tilt is None else tilt)
        lean = np.column_stack((sampling.x - 0.5, sampling.y - 0.5)) @ state.tilt
        assert state.approach == pytest.approx(np.min(touch[sampling.patch] - lean), abs=1e-17)
        assert (state.force, np.abs(state.displacement).max()) == (0.0, 0.0)


@pytest.mark.long
@pytest.mark.parametrize("mode", MODES)
def test_a_touch_that_is_rounding_holds_no_plane(mode):
    """From a few units of the last digit past first touch, the plane is that from any other."""
    pressed = uneven_block(mode)
    pressed.solve(Control(force=1.0, tilt=None))  # turned
    released = pressed.solve(Control(force=0.0, tilt=None))
    forces, rest = pressed.forces, np.zeros(len(pressed.sampling.weight))
    touched, ends = [], []
    for units in range(-2, 9):
        approach = released.approach + units * np.spacing(released.approach)
        forces.prescribe(Control(force=8.0, tilt=None), np.array([approach, *released.tilt]))
        touched.append(forces.loads(forces.pressure(forces.levers.matrix @ forces.plane))[0])
        forces.closure_of(rest)
        ends.append(forces.plane)
    assert (touched[2], touched[-1] > 0.0) == (0.0, True)
    assert max(touched) < 1e-20  # of 8 N
    # residuals of 1e-10 of the load are accepted
    np.testing.assert_allclose(ends, np.broadcast_to(ends[0], (11, 3)), rtol=1e-9)


def test_one_patch_under_a_force_is_one_linear_solve():
    """Its pressure is the force over its area, wherever the block goes."""
    interface = interface_of(block_of(), (1, 1))
    options = PETSc.Options("patchlaw_")
    options["ksp_rtol"] = 1e-12
    try:
        pressed = LawContactProblem(interface, [PowerLaw(3e4)])
    finally:
        options.delValue("ksp_rtol")
    state = pressed.solve(Control(force=3.0))
    assert state.iterations == 1
    assert pressed.solve(Control(force=30.0)).iterations == 0  # ten times as much


def test_what_nothing_holds_is_told_and_changes_nothing():
    interface = interface_of(block_of(cells=(4, 4, 3)), (2, 2))
    right = [PowerLaw(3e4, touch=np.inf)] * 2 + [PowerLaw(3e4), PowerLaw(6e4)]
    pressed = LawContactProblem(interface, right)
    before = pressed.solve(Control(force=2.0))
    known = len(pressed.basis)
    with pytest.raises(NotConverged, match=r"NO_SUPPORT .*prescribe its tilt \(load.tilt\)"):
        pressed.solve(Control(force=3.0, tilt=None))
    assert len(pressed.basis) == known
    np.testing.assert_array_equal(
        pressed.patch_means(lambda patch, closure: closure),
        before.patch_closure,  # still of the latest equilibrium
    )
    assert pressed.solve(Control(force=2.0)).approach == pytest.approx(before.approach, rel=1e-9)
    nothing = LawContactProblem(interface, [PowerLaw(3e4, touch=np.inf)] * 4)
    for force in (1.0, 0.0):
        with pytest.raises(NotConverged, match="NO_CONTACT"):
            nothing.solve(Control(force=force))


def test_free_plane_at_an_approach_swings_clear_of_what_lies_on_one_side():
    interface = interface_of(block_of(cells=(4, 4, 3)), (2, 1))
    right = [PowerLaw(3e4, touch=np.inf), PowerLaw(3e4)]
    state = LawContactProblem(interface, right).solve(Control(approach=4e-3, tilt=None))
    assert (state.force, state.approach) == (0.0, 4e-3)
    assert state.tilt[0] <= -4e-3 / 0.25  # down to the patch's touch at its centre


def test_moments_are_about_the_middle_of_the_patches():
    """Patches on a part of the top: their own middle counts."""
    block = block_of(cells=(4, 4, 3))
    interface = LoadedFace.of_block(
        block, PatchGrid(grid=(1, 1), lengths=(0.5, 0.5), origin=(0.5, 0.0))
    )
    state = LawContactProblem(interface, [PowerLaw(3e4)]).solve(Control(force=1.0))
    np.testing.assert_allclose(state.moment, 0.0, atol=1e-15)
