"""A half-space on the other side of a face with laws: against dense matrices of rectangles."""

import numpy as np
import pytest
from helpers.block_cases import block_of

from geometry import Control, PatchGrid
from macro import LawContactProblem, LoadedFace
from macro.contact.opposite_half_space import OppositeHalfSpace
from macro.mesh.contact_face import top_facets
from micro import influence_matrix

COMPLIANCE = 1e-3  # (1 − ν²)/E of the half-space [1/MPa]
APPROACH = 0.01


class Line:
    """Pressure in proportion to the closure."""

    def __init__(self, stiffness):
        self._stiffness = stiffness

    def pressure(self, closure):
        return self._stiffness * np.maximum(closure, 0.0)

    def stiffness(self, closure):
        return self._stiffness * (closure > 0.0)


def face_of(cells, modulus=1e9):
    """Return the whole top of a block as one region."""
    block = block_of(element="Q1", cells=(cells, cells, 3), young_modulus=modulus)
    return LoadedFace.of_regions(block, (top_facets(block.mesh),), (1.0, 1.0))


def pressed(face, stiffness, control, opposite=COMPLIANCE):
    problem = LawContactProblem(face, [Line(stiffness)], "pointwise", opposite=opposite)
    return problem, problem.solve(control)


def test_uniform_pressure_moves_a_square_as_love_says():
    sampling = face_of(16).pointwise
    half_space = OppositeHalfSpace(sampling, (1.0, 1.0), COMPLIANCE)
    moved = half_space.at_samples(half_space.under(np.full(len(sampling.weight), 5.0)))
    mean = sampling.weight @ moved / sampling.weight.sum()
    assert mean == pytest.approx(0.9464 * 5.0 * COMPLIANCE, rel=3e-3)  # of 38 squares a side


def test_its_compliance_is_symmetric():
    sampling, rng = face_of(5).pointwise, np.random.default_rng(2)
    half_space = OppositeHalfSpace(sampling, (1.0, 1.0), COMPLIANCE)
    one, other = rng.random((2, len(sampling.weight)))
    works = [
        sampling.weight * left @ half_space.at_samples(half_space.under(right))
        for left, right in ((one, other), (other, one))
    ]
    assert works[0] == pytest.approx(works[1], rel=1e-12)


@pytest.mark.parametrize(("stiffness", "allowed"), [(500.0, 2.5e-3), (5e4, 0.03)])
def test_rigid_body_on_springs_against_a_dense_matrix(stiffness, allowed):
    """The stiffer the springs, the more the pressures rise towards the edges, beyond 8 cells."""
    patches = PatchGrid(grid=(32, 32), lengths=(1.0, 1.0))
    compliance = influence_matrix(patches) * COMPLIANCE / np.pi + np.eye(1024) / stiffness
    expected = np.linalg.solve(compliance, np.full(1024, APPROACH)).mean()
    problem, state = pressed(face_of(8), stiffness, Control(approach=APPROACH))
    assert state.force == pytest.approx(expected, rel=allowed)
    # the problem is linear
    slope = problem.approach_response().stiffness
    assert slope == pytest.approx(state.force / APPROACH, rel=1e-7)
    _, again = pressed(face_of(8), stiffness, Control(force=state.force, tilt=None))
    assert again.approach == pytest.approx(
        APPROACH, rel=1e-6
    )  # displacements, 45 closures, are met to 1e-8


def test_a_stiff_half_space_is_a_rigid_plane_and_steps_follow_each_other():
    face = face_of(4, modulus=1e3)
    problem, state = pressed(face, 5e3, Control(approach=APPROACH), opposite=1e-12)
    _, rigid = pressed(face, 5e3, Control(approach=APPROACH), opposite=0.0)
    assert state.force == pytest.approx(rigid.force, rel=1e-7)
    assert problem.solve(Control(force=0.0)).force == 0.0
    back = problem.solve(Control(approach=APPROACH))
    assert back.force == pytest.approx(state.force, rel=1e-8)


def test_a_soft_half_space_opens_the_middle_of_the_face():
    """Displacements are a thousand times the closures: steps end where the energy is least."""
    _, state = pressed(face_of(6), 2e5, Control(force=2.0), opposite=5e-3)
    assert state.force == pytest.approx(2.0, rel=1e-9)
    assert state.sample_pressure.min() >= 0.0
    assert state.sample_pressure.max() > 3.0 * state.force  # of a flat punch, at its corners


def test_a_stiff_body_is_solved_a_few_times_alone(monkeypatch):
    """The half-space settles on the body as it is: Newton's method needs no responses of it."""
    responses = []
    whole = LawContactProblem._closed_in

    def counted(problem, *arguments):
        responses.append(whole(problem, *arguments)[1])
        return whole(problem, *arguments)

    monkeypatch.setattr(LawContactProblem, "_closed_in", counted)
    for control in (Control(approach=APPROACH), Control(force=2.0, tilt=None)):
        _, state = pressed(face_of(6, modulus=1e6), 5e3, control)
        assert not responses
        assert state.iterations <= 12
    _, soft = pressed(face_of(6, modulus=1e2), 5e3, Control(approach=APPROACH))
    assert soft.linear_iterations > sum(responses) > 0  # which are counted
