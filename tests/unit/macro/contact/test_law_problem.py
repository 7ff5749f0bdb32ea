"""The pressed block's bookkeeping: errors, tilt, restoring after failure, options, files."""

from functools import partial

import numpy as np
import pytest
from helpers.block_cases import block_of, interface_of
from helpers.body_meshes import SIDE, box, standing
from helpers.contact_laws import PowerLaw
from petsc4py import PETSc

from patchlaw.geometry import Control, PatchGrid
from patchlaw.macro import (
    FieldStep,
    LawContactProblem,
    Loads,
    Material,
    Traction,
    compat,
    write_fields,
)
from patchlaw.macro.contact.pressed_plane import first_touch
from patchlaw.support import NotConverged

Spring = partial(PowerLaw, k=1e3, power=1.0)


class Broken(PowerLaw):
    """A law without a solution that Newton's method could find."""

    def pressure(self, closure):
        return np.full_like(closure, np.nan)


@pytest.fixture
def interface():
    return interface_of(block_of(cells=(4, 4, 2), element="Q2"), (2, 2))


def test_open_interface_is_solved_at_once(interface):
    state = LawContactProblem(interface, [Spring(touch=1.0)] * 4).solve(Control(approach=5e-3))
    assert (state.iterations, state.force, state.reaction) == (0, 0.0, 0.0)
    assert np.abs(state.displacement).max() == 0.0
    np.testing.assert_allclose(state.patch_closure, 5e-3, rtol=1e-14)
    assert state.reason == "CONVERGED_FNORM_RELATIVE"


@pytest.mark.parametrize("mode", ["patchwise", "pointwise"])
def test_linear_laws_take_one_newton_step(interface, mode):
    pressed = LawContactProblem(interface, [Spring()] * 4, mode)
    pressed.newton.snes.ksp.setTolerances(rtol=1e-12)
    pressed.newton.forcing = False
    assert pressed.solve(Control(approach=5e-3)).iterations == 1


def test_tilt_is_about_the_middle(interface):
    press = LawContactProblem(interface, [Spring()] * 4).solve
    level, tilted = press(Control(approach=5e-3)), press(Control(approach=5e-3, tilt=(2e-3, 0.0)))
    assert tilted.force == pytest.approx(level.force, rel=1e-7)  # exact for linear laws
    np.testing.assert_array_equal(
        tilted.patch_pressure > level.patch_pressure, [False, False, True, True]
    )


def test_a_plane_that_turns_follows_its_own_moment_and_what_pulls_the_body():
    """Bolts beside the face turn the plane, under a force and where its approach stays."""
    steel, patch = (
        Material(young_modulus=4e3, poisson_ratio=0.2),
        PatchGrid(grid=(1, 1), lengths=(2.0, 1.0)),
    )
    bolts = Loads(pulls=(Traction(tag=SIDE, stress=(0.0, 0.0, 3.0)),))
    mesh = box((0, 0, -1), (2, 1, 0), (4, 2, 2))
    face = standing(mesh, steel, patch, loads=(Loads(), bolts))
    problem = LawContactProblem(face, [PowerLaw(4e3)], "pointwise")
    moment = (0.35, -0.12)
    turned = problem.solve(Control(force=9.0, tilt=None, moment=moment))
    np.testing.assert_allclose(turned.moment, moment, rtol=1e-9)
    before, gap = problem.past, problem.forces.gap
    pulled = problem.solve(Control(force=9.0, tilt=None, moment=moment, body_state=1.0))
    np.testing.assert_allclose(pulled.moment, (0.35 - 3.0, -0.12), rtol=1e-9)
    for control in (
        Control(approach=pulled.approach, tilt=None, moment=moment, body_state=1.0),
        problem.same_approach(),
    ):
        held = problem.solve(control)
        np.testing.assert_allclose(held.tilt, pulled.tilt, rtol=1e-6)
        assert held.force == pytest.approx(9.0, rel=1e-6)
    problem.past = before  # where nothing pulled the body yet
    np.testing.assert_array_equal(problem.forces.gap, gap)
    assert problem.same_approach().moment == moment and not problem.same_approach().body_state


def test_failure_is_named_and_keeps_what_was_known(interface):
    laws = [Spring(k=1e3 * (i + 1), touch=1e-3 * i) for i in range(4)]
    pressed = LawContactProblem(interface, laws)
    before = pressed.solve(Control(approach=2e-3))
    known = len(pressed.basis)
    pressed.newton.snes.setTolerances(max_it=0)  # first steps are done, Newton's are not
    with pytest.raises(NotConverged, match=r"approach 0\.008 mm .* DIVERGED_MAX_IT after 0"):
        pressed.solve(Control(approach=8e-3))
    assert len(pressed.basis) == known
    pressed.newton.snes.setTolerances(max_it=20)
    assert pressed.solve(Control(approach=2e-3)).force == pytest.approx(before.force, rel=1e-9)


@pytest.mark.parametrize("law", [Spring(), Broken(1e3)])
def test_the_block_alone_stays_what_it_is(interface, law):
    pressed = LawContactProblem(interface, [law] * 4)
    if isinstance(law, Broken):
        with pytest.raises(NotConverged):
            pressed.solve(Control(approach=5e-3))
    else:
        pressed.solve(Control(approach=5e-3))
    block, load = interface.body, interface.load(np.arange(4.0))
    found = block.stiffness.createVecRight()
    found.array[:] = block.solve(load.copy()).x.array
    missed = block.stiffness * found - load
    # the linear solver's tolerance; the tangent of these springs is far from the stiffness
    assert missed.norm() < 1.1e-10 * load.norm()


def test_pressure_without_value_is_a_failure(interface):
    with pytest.raises(NotConverged, match="DIVERGED_F"):
        LawContactProblem(interface, [Broken(1e3)] * 4).solve(Control(approach=1e-3))


def test_the_users_tolerances_win(interface):
    options = PETSc.Options("patchlaw_")
    options["snes_rtol"], options["ksp_rtol"] = 1e-4, 1e-3
    try:
        pressed = LawContactProblem(interface, [Spring()] * 4)
        state = pressed.solve(Control(approach=5e-3))
    finally:
        options.delValue("snes_rtol"), options.delValue("ksp_rtol")
    assert 1e-10 < state.residuals[-1] <= 1e-4
    assert pressed.newton.snes.ksp.getTolerances()[0] == 1e-3


@pytest.mark.parametrize("element", ["Q1", "P2"])
def test_fields_are_written_for_paraview(element, tmp_path):
    interface = interface_of(block_of(cells=(2, 2, 2), element=element), (2, 1))
    state = LawContactProblem(interface, [Spring(), Spring(k=5e3)]).solve(Control(approach=1e-3))
    step = FieldStep(0, state.displacement, state.patch_pressure)
    write_fields(tmp_path / "fields.xdmf", interface, [step])
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "fields.h5") as file:
        found = file["Function/pressure/0"][...].ravel()
        displacement = file["Function/displacement/0"][...]
    assert set(found.round(12)) == {0.0, *state.patch_pressure.round(12)}
    assert displacement.shape[1] == 3
    # those of the vertices, which lie at multiples of a half, in both degrees
    nodes = 2.0 * interface.space.tabulate_dof_coordinates()
    at_vertices = np.isclose(nodes, np.rint(nodes)).all(axis=1)
    expected = state.displacement.reshape(-1, 3)[at_vertices]
    assert expected[:, 2].min() < -1e-6
    np.testing.assert_allclose(np.sort(displacement, axis=0), np.sort(expected, axis=0), atol=1e-15)
    # with ADIOS2 also at all nodes: three components of 8 bytes each
    vtx = sum(file.stat().st_size for file in tmp_path.glob("fields.bp/data.*"))
    assert vtx >= 8 * len(state.displacement) if compat.HAS_VTX else vtx == 0


@pytest.mark.parametrize("element", ["Q1", "P1"])
def test_fields_share_cells_that_borders_cut(element, tmp_path):
    """Patches of a third on cells of a quarter: the cells' pressures carry the whole force."""
    h5py = pytest.importorskip("h5py")
    interface = interface_of(block_of(cells=(4, 4, 2), element=element), (3, 1))
    given = np.array([3.0, 5.0, 8.0])
    step = FieldStep(0, np.zeros(interface.body.owned_dofs), given)
    write_fields(tmp_path / "fields.xdmf", interface, [step])
    with h5py.File(tmp_path / "fields.h5") as file:
        found = file["Function/pressure/0"][...].ravel()
    loaded = found[found > 0.0]
    area = 1.0 / len(loaded)
    assert loaded.sum() * area == pytest.approx(given.sum() / 3.0, rel=1e-12)
    if element == "Q1":
        # the second column of cells has a third of its width in the first patch
        expected = [3.0, 3.0 / 3 + 5.0 * 2 / 3, 5.0 * 2 / 3 + 8.0 / 3, 8.0]
        np.testing.assert_allclose(np.unique(loaded.round(9)), np.sort(expected), rtol=1e-8)


class Springs:
    """Springs of all patches, evaluated together."""

    def __init__(self, *stiffness):
        self.laws = [Spring(k=k) for k in stiffness]
        self._k = np.array(stiffness)

    def __len__(self):
        return len(self._k)

    def pressures(self, patch, closure, depth):
        return np.maximum(closure, 0.0) * self._k[patch]

    def stiffnesses(self, patch, closure, depth):
        return np.where(closure > 0.0, self._k[patch], 0.0)

    def rates(self, *at):
        slope = self.stiffnesses(*at)
        return self.pressures(*at), slope, slope


@pytest.mark.parametrize("mode", ["patchwise", "pointwise"])
def test_laws_together_are_the_laws_one_by_one(interface, mode):
    together = Springs(1e3, 2e3, 5e3, 4e3)
    control = Control(force=3.0, tilt=(1e-3, -2e-3))
    one, other = (
        LawContactProblem(interface, laws, mode).solve(control)
        for laws in (together, together.laws)
    )
    assert one.approach == pytest.approx(other.approach, rel=1e-13)
    np.testing.assert_allclose(one.patch_force, other.patch_force, rtol=1e-12)


NO_FORCE = Control(force=0.0)


@pytest.mark.parametrize("at", [-3.0, -1e-9, 0.0, 1e-12, 0.25, 40.0])
def test_first_touch_is_found_to_rounding(at):
    found = first_touch(lambda approach: approach > at, NO_FORCE, 1.0)
    assert found == pytest.approx(at, rel=1e-15, abs=1e-300)


def test_nothing_to_touch():
    with pytest.raises(NotConverged, match=r"NO_CONTACT .*no patch can be touched"):
        first_touch(lambda _approach: False, NO_FORCE, 1.0)
