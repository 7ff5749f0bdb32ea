"""Laws much stiffer than the elements under them take few linear iterations."""

import weakref

import numpy as np
import pytest
from helpers.body_meshes import box, hanging, standing
from helpers.contact_laws import Exponential, PowerLaw

from patchlaw.geometry import Control, Friction, PatchGrid, ShearControl
from patchlaw.macro import FacePair, LawContactProblem, Material, displacements_under
from patchlaw.macro.linear_solvers.options import has_hypre

WHOLE = PatchGrid(grid=(1, 1), lengths=(1.0, 1.0))
SOFT = Material(young_modulus=1000.0, poisson_ratio=0.3)


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
