"""Steep and stiff laws: few Newton steps from nothing, few linear iterations."""

import weakref

import numpy as np
import pytest
from helpers.body_meshes import HIGH, LOW, box, hanging, standing
from helpers.contact_laws import Exponential, PowerLaw
from helpers.user_problems import clamped, elastic, pressed_face
from mpi4py import MPI
from scipy.optimize import brentq

from patchlaw.geometry import Control, Friction, PatchGrid, ShearControl
from patchlaw.geometry.rigid_plane import plane_failure
from patchlaw.macro import FacePair, LawContactProblem, Material, compat, displacements_under
from patchlaw.macro.contact import pressed_plane
from patchlaw.macro.contact.face_layer import FaceLayer
from patchlaw.macro.contact.pressed_plane import law_lines
from patchlaw.macro.linear_solvers.options import has_hypre

HALVES = PatchGrid(grid=(2, 1), lengths=(3.0, 1.0))
SOFT = Material(young_modulus=1000.0, poisson_ratio=0.3)


def problem(laws):
    face = standing(box((0, 0, -1), (3, 1, 0), (9, 4, 4)), SOFT, HALVES)
    return LawContactProblem(face, laws, "pointwise")


class Forces:
    """What `law_lines` asks of contact forces."""

    comm, wearing = MPI.COMM_SELF, None

    def __init__(self, law):
        self.pressure, self.stiffness = law.pressure, law.stiffness
        self.asked = []

    def pressure_of(self, some, closure):
        self.asked.append(len(some))
        return self.pressure(closure[some])


def test_lines_touch_the_law_where_the_bodys_stiffness_leads():
    law, stiffness = Exponential(0.4e-3), 37.0
    rng = np.random.default_rng(8)
    closure = rng.uniform(-2e-3, 30e-3, 40)  # up to e⁷⁵ of pressure
    pressure = rng.uniform(-5.0, 20.0, 40)
    lines = law_lines(Forces(law), closure, pressure, stiffness)
    for at, c, p in zip(lines.closure, closure, pressure, strict=True):
        exact = brentq(
            lambda x, c=c, p=p: float(law.pressure(x)) - p + stiffness * (x - c), -3.0, 40e-3,
            xtol=1e-15,
        )  # fmt: skip
        assert at == pytest.approx(exact, abs=1e-5)
    np.testing.assert_array_equal(lines.pressure, law.pressure(lines.closure))
    np.testing.assert_array_equal(lines.stiffness, law.stiffness(lines.closure))
    np.testing.assert_allclose(
        lines.at(lines.closure + 1e-4), lines.pressure + 1e-4 * lines.stiffness
    )


def test_open_samples_stay_where_they_are_and_are_asked_for_once():
    forces = Forces(Exponential(0.4e-3))
    closure, pressure = np.array([-1e-3, -2e-4, 3e-3, -5e-4]), np.array([0.0, 0.0, 4.1, 2.3])
    lines = law_lines(forces, closure, pressure, 37.0)
    np.testing.assert_array_equal(lines.closure[:2], closure[:2])
    assert (lines.closure[2:] != closure[2:]).all()
    assert set(forces.asked) == {2}


def test_a_layer_that_is_the_whole_body_leads_to_the_solution():
    laws = [Exponential(6e-3), Exponential(0.4e-3)]
    small = standing(box((0, 0, -1), (3, 1, 0), (4, 2, 1)), SOFT, HALVES)
    control = Control(approach=21.3e-3)
    known = LawContactProblem(small, laws, "pointwise").solve(control)
    fresh, sampling = LawContactProblem(small, laws, "pointwise"), small.pointwise
    fresh.forces.prescribe(control, np.zeros(3))
    layer = FaceLayer(fresh.equilibrium)
    at_rest = np.zeros(len(sampling.weight))
    lines = layer.lines(at_rest, fresh.forces.closure_of(at_rest), at_rest, 40.0)
    # steps on the layer end at changes of 1 % of the pressures, and so do its linear solves
    largest = known.sample_pressure.max()
    np.testing.assert_allclose(lines.pressure, known.sample_pressure, atol=0.03 * largest)


@pytest.mark.long
@pytest.mark.parametrize("lengths", [(6e-3, 6e-3), (0.4e-3, 0.4e-3)])
@pytest.mark.parametrize("tilt", [(0.0, 0.0), None])
def test_any_load_takes_few_newton_steps(lengths, tilt):
    laws = [Exponential(length) for length in lengths]
    state = problem(laws).solve(Control(force=17.3, tilt=tilt))
    assert state.force == pytest.approx(17.3, rel=1e-9)
    assert state.reaction == pytest.approx(state.force, rel=1e-7)
    assert state.iterations <= 4
    again = problem(laws).solve(Control(approach=state.approach, tilt=state.tilt))
    assert again.force == pytest.approx(17.3, rel=1e-7)
    assert again.iterations <= 4


def test_one_step_is_where_a_path_leads():
    laws = [Exponential(6e-3), Exponential(0.4e-3)]
    path = problem(laws)
    counts = []
    for share in (0.25, 0.5, 0.75, 1.0, 0.6):
        state = path.solve(Control(force=22.9 * share, tilt=None))
        counts.append(state.iterations)
    single = problem(laws).solve(Control(force=22.9 * 0.6, tilt=None))
    assert state.approach == pytest.approx(single.approach, rel=1e-8)
    np.testing.assert_allclose(state.patch_pressure, single.patch_pressure, rtol=1e-7)
    assert max(counts) <= 5
    assert max(counts[2:]) <= 3


def test_a_body_softer_than_its_laws_by_orders_is_solved():
    # a soft foot on a stiff law: 9 µm of body for a newton, e-folds of 0.1 µm
    laws = [Exponential(0.1e-3)] * 2
    state = problem(laws).solve(Control(approach=30e-3))
    assert state.reaction == pytest.approx(state.force, rel=1e-7)
    assert state.iterations <= 4


@pytest.mark.parametrize("tilt", [(0.0, 0.0), None])
def test_a_step_between_laws_takes_few_newton_steps(tilt):
    # pressures rise and fall within two elements of the step between the laws
    laws = [Exponential(6e-3), Exponential(0.4e-3)]
    state = problem(laws).solve(Control(force=31.7, tilt=tilt))
    assert state.reaction == pytest.approx(state.force, rel=1e-7)
    assert state.iterations <= 5


@pytest.mark.parametrize(
    ("lengths", "approaches"), [((1e-3, 0.1e-3), [60.0]), ((1e-3, 0.3e-3, 0.6e-3), [0.7, 60.0])]
)
def test_a_plane_that_comes_down_by_more_than_the_body_takes_few_newton_steps(lengths, approaches):
    # single points of a facet on soft laws are held by the others of it, on stiff ones
    tagged, patches = box((0, 0, 0), (20, 10, 5), (6, 3, 2), "tetrahedron"), (len(lengths), 1)
    space = compat.vector_space(tagged.mesh, 2)
    rough, problem = pressed_face(
        space, tagged.facet_tags, LOW, laws=[Exponential(length) for length in lengths],
        patches=PatchGrid(grid=patches, lengths=(20.0, 10.0)), mode="pointwise",
        indenter=Control(approach=approaches[0]), work=lambda u: elastic(u, 4000.0, 0.3),
        held=[clamped(space, tagged.facet_tags, tag=HIGH)],
    )  # fmt: skip
    for approach in approaches:
        rough.indenter = Control(approach=approach)
        assert problem.solve() <= 5
    assert np.abs(problem.reaction()[2]) == pytest.approx(rough.force, rel=1e-7)


THIRDS = PatchGrid(grid=(3, 1), lengths=(3.0, 1.0))


@pytest.mark.long
@pytest.mark.parametrize("mode", ["pointwise", "patchwise"])
@pytest.mark.parametrize("friction", [None, 0.3])
def test_steep_laws_in_a_users_problem_take_few_newton_steps(mode, friction):
    """From nothing, between loads that are far apart, by approach and force: e-folds to 0.1 µm."""
    laws = [Exponential(length) for length in (2e-3, 0.1e-3, 0.5e-3)]
    tagged = box((0, 0, -1), (3, 1, 0), (9, 4, 4))
    space = compat.vector_space(tagged.mesh, 1)
    rough, problem = pressed_face(
        space, tagged.facet_tags, HIGH, laws=laws, patches=THIRDS, mode=mode,
        indenter=Control(approach=10e-3), friction=friction and Friction(
            coefficient=friction, poisson_ratio=0.3),
        work=lambda u: elastic(u, 1000.0, 0.3), held=[clamped(space, tagged.facet_tags, tag=LOW)],
    )  # fmt: skip
    forces = []
    for control in (
        Control(approach=10e-3),
        Control(approach=20e-3),
        Control(force=1.3, tilt=None),
        Control(force=61.7, tilt=None),
        Control(approach=10e-3),
    ):
        rough.indenter = control
        # what slips and what sticks is found besides, in one to four steps more
        assert problem.solve() <= (6 if friction is None else 10), control
        forces.append(rough.force)
        assert problem.reaction()[2] == pytest.approx(rough.force, rel=1e-7)
    if friction is None:  # no path
        assert forces[-1] == pytest.approx(forces[0], rel=1e-6)


def test_a_guess_without_equilibrium_of_the_plane_does_not_end_a_load_step(monkeypatch):
    """As on the undeformed ring of benchmarks/body_errors.py, seed 9303, under a steep law."""
    face = standing(box((0, 0, -1), (3, 1, 0), (3, 2, 1)), SOFT, HALVES)
    laws, control = [Exponential(6e-5), Exponential(3e-5)], Control(approach=1e-3, tilt=None)
    expected = LawContactProblem(face, laws, "pointwise").solve(control)
    own, planes = pressed_plane.find_equilibrium, []

    def failing(respond, control, start, half):
        planes.append(start)
        if len(planes) == 1:
            raise plane_failure(control, "NO_EQUILIBRIUM")
        return own(respond, control, start, half)

    monkeypatch.setattr(pressed_plane, "find_equilibrium", failing)
    found = LawContactProblem(face, laws, "pointwise").solve(control)
    assert len(planes) > 1
    assert found.force == pytest.approx(expected.force, rel=1e-8)
    assert found.plane.motion == pytest.approx(expected.plane.motion, rel=1e-6)


WHOLE = PatchGrid(grid=(1, 1), lengths=(1.0, 1.0))


def pressed(cell, order, k):
    """Return iterations per Newton step, and the state, under a crowned face."""
    face = standing(box((0, 0, -0.5), (1, 1, 0), (6, 6, 3), cell), SOFT, WHOLE, order)
    crown = lambda x, y: 2e-3 * ((x - 0.5) ** 2 + (y - 0.5) ** 2)  # noqa: E731
    problem = LawContactProblem(face, [PowerLaw(k, power=2.0)], "pointwise", crown=crown)
    state = problem.solve(Control(approach=1e-3))
    return state.linear_iterations / state.iterations, state


@pytest.mark.long
@pytest.mark.parametrize(
    ("cell", "order"), [("tetrahedron", 1), ("hexahedron", 1), ("tetrahedron", 2)]
)
def test_stiff_laws_take_few_iterations(cell, order):
    stiff, state = pressed(cell, order, 1e10)
    # 7 and 8 a Newton step on linear elements and 14 on quadratic ones; smoothed aggregation 18.3
    # and 17.0 on linear ones. Laws of 1e5 take 6 to 8 a step, in steps that gain fewer digits.
    assert stiff <= (15.0 if order == 2 else 9.0 if has_hypre() else 20.0)
    assert state.reaction == pytest.approx(state.force, rel=1e-7)


@pytest.mark.long
@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("bodies", [1, 2])
def test_laws_take_the_place_of_the_multigrid_of_bodies_alone(bodies, order):
    face = standing(box((0, 0, -0.5), (1, 1, 0), (4, 4, 2), "tetrahedron"), SOFT, WHOLE, order)
    if bodies == 2:
        above = box((0, 0, 0), (1, 1, 0.5), (3, 3, 2))
        face = FacePair(face, hanging(above, SOFT, WHOLE, order))
    parts = [side.body for side in face.sides]
    alone = [weakref.ref(each.solver) for each in (face.body, *parts)]
    before = displacements_under(face, np.eye(1))
    problem = LawContactProblem(face, [PowerLaw(1e7, power=2.0)], "pointwise")
    assert problem.solve(Control(approach=1e-3)).force > 0.0
    assert [each() for each in alone] == [None] * len(alone)  # half of the memory
    assert displacements_under(face, np.eye(1)) == pytest.approx(before, rel=1e-8)  # made again


def test_the_answer_does_not_depend_on_the_preconditioner(monkeypatch):
    _, with_laws = pressed("tetrahedron", 1, 1e9)
    monkeypatch.setattr("patchlaw.macro.contact.contact_forces._MOVED", np.inf)  # the body alone
    alone, without = pressed("tetrahedron", 1, 1e9)
    assert with_laws.force == pytest.approx(without.force, rel=1e-8)
    assert alone > 6.0


@pytest.mark.long
def test_friction_takes_few_steps_more():
    """Guesses know what slides: with springs that stick they took 4 steps in place of 3 and 2."""
    face = standing(box((0, 0, -0.5), (1, 1, 0), (6, 6, 3), "tetrahedron"), SOFT, WHOLE, 1)
    friction, steps = Friction(coefficient=0.3, poisson_ratio=0.3), {}
    law = Exponential(4e-4, reach=8.0)
    for rubs in (None, friction):
        problem = LawContactProblem(face, [law], "pointwise", friction=rubs)
        loads = [Control(force=force) for force in (2.5, 5.0, 7.5, 10.0)]
        steps[rubs] = [problem.solve(load).iterations for load in loads]
    shears = [ShearControl(force=(part * 3.0, 0.0)) for part in (0.25, 0.5, 0.75, 0.25)]
    sheared = [problem.solve(Control(force=10.0, shear=shear)).iterations for shear in shears]
    assert sum(steps[friction]) <= sum(steps[None]) + 3
    assert max(steps[None][1:]) <= 2
    assert max(steps[friction][2:]) <= 3
    assert max(sheared) <= 5 and sum(sheared) <= 15
