"""What a contact changes with the approach and with its laws, against solutions of their own."""

import numpy as np
import pytest
from helpers.body_meshes import HIGH, SIDE, box, hanging, standing
from helpers.contact_laws import PowerLaw

from patchlaw.geometry import Control, Material, PatchGrid
from patchlaw.macro import FacePair, LawContactProblem, Loads, Traction
from patchlaw.macro.contact.other_elements import carried, face_on, quadratic_dofs

SOFT = Material(young_modulus=431.0, poisson_ratio=0.27)
PATCHES = PatchGrid(grid=(2, 1), lengths=(1.3, 0.9))


def face_of(kind="hexahedron", order=1):
    return standing(box((0, 0, -0.7), (1.3, 0.9, 0), (4, 3, 3), kind), SOFT, PATCHES, order)


def pair():
    above = hanging(box((0, 0, 0), (1.3, 0.9, 0.4), (3, 3, 2), "tetrahedron"), SOFT, PATCHES)
    return FacePair(face_of(), above)


def start_from_elements(problem, known, before, body_state=0.0):
    moved = carried(known.displacement, before, problem.face)
    problem.start_at(moved, known.plane, body_state)


def problem(face, errors=(0.0, 0.0)):
    laws = [
        PowerLaw(3e5 * (1.0 + errors[0]), power=2.0),
        PowerLaw(8e4 * (1.0 + errors[1]), 2.3e-3, 2.0),
    ]
    return LawContactProblem(face, laws, "pointwise")


def force_at(face, approach, tilt, errors=(0.0, 0.0)):
    return problem(face, errors).solve(Control(approach=approach, tilt=tilt)).force


@pytest.mark.slow
@pytest.mark.parametrize("tilt", [(0.0, 0.0), (4.1e-3, -2.7e-3), None], ids=str)
@pytest.mark.parametrize("make", [face_of, pair])
def test_the_response_is_what_solutions_change(make, tilt):
    face, at, step = make(), 9.3e-3, 1e-5
    one = problem(face)
    state = one.solve(Control(approach=at, tilt=tilt))
    response = one.approach_response()
    forces = [force_at(face, at + d, tilt) for d in (-step, step)]
    # central differences of a smooth function
    assert response.stiffness == pytest.approx((forces[1] - forces[0]) / (2 * step), rel=2e-5)
    share = 1e-4
    for law in (0, 1):
        errors = np.eye(2)[law] * share
        changed = [force_at(face, at, tilt, sign * errors) for sign in (-1, 1)]
        found = response.force_changes(share * state.sample_pressure)
        signed = response.sampling.patch_sums(response.closing * share * state.sample_pressure)
        assert signed[law] == pytest.approx(0.5 * (changed[1] - changed[0]), rel=1e-4)
        assert found[law] >= abs(signed[law]) * (1 - 1e-12)


@pytest.mark.parametrize(
    ("make", "approach", "tilt"),
    [(face_of, 9.3e-3, (1.6e-2, -2.7e-3)), (pair, 3e-3, (1.6e-2, -2.7e-3)), (pair, 1.7e-3, None)],
)
def test_more_points_change_the_force_to_first_order(make, approach, tilt):
    # contact ends within facets: the points of a pair are many, and smooth pressures exact to 1e-6
    face, control = make(), Control(approach=approach, tilt=tilt)
    one, finer = problem(face), face_on(face, lambda body: body, finer=True)
    known = one.solve(control)
    response = one.approach_response()
    borne = [each.forces_at(known, 0.0, response)[0][0] for each in (one, problem(finer))]
    expected = problem(finer).solve(control).force - known.force
    assert abs(expected) > 1e-5 * known.force
    assert borne[1] - borne[0] == pytest.approx(expected, rel=0.15)  # where contact ends, too


@pytest.mark.long
@pytest.mark.parametrize("kind", ["hexahedron", "tetrahedron"])
def test_other_elements_give_what_bodies_of_them_give(kind):
    linear, control = face_of(kind), Control(approach=9.3e-3, tilt=(1.1e-3, 0.0))
    known = problem(linear).solve(control)
    finer = face_on(linear, lambda body: body.as_quadratic(), finer=True)
    assert finer.body.linear is linear.body
    assert finer.quadrature_degree == 2 * linear.quadrature_degree + 2
    again = problem(finer)
    start_from_elements(again, known, linear)
    assert len(again.basis) == 1
    found = again.solve(control).force
    quadratic = face_of(kind, 2)
    assert quadratic_dofs(linear.body) == quadratic.body.dofs == finer.body.dofs
    points = face_on(quadratic, lambda body: body, finer=True)
    assert found == pytest.approx(force_at(quadratic, 9.3e-3, (1.1e-3, 0.0)), rel=1e-4)
    assert found == pytest.approx(force_at(points, 9.3e-3, (1.1e-3, 0.0)), rel=3e-4)
    lowered = face_on(quadratic, lambda body: body.linear)
    below = problem(lowered)
    start_from_elements(below, problem(quadratic).solve(control), quadratic)
    assert lowered.quadrature_degree == quadratic.quadrature_degree
    assert below.solve(control).force == pytest.approx(known.force, rel=2e-3)


def test_two_bodies_change_their_elements_together():
    both, control = pair(), Control(approach=9.3e-3)
    known = problem(both).solve(control)
    finer = face_on(both, lambda body: body.as_quadratic())
    again = problem(finer)
    start_from_elements(again, known, both)
    found = again.solve(control).force
    assert finer.body.dofs == sum(quadratic_dofs(each.body) for each in (both.first, both.second))
    assert 0.7 * known.force < found < 0.999 * known.force  # linear elements are too stiff


@pytest.mark.long
def test_solutions_are_carried_to_other_elements_with_their_preload():
    mesh = box((0, 0, -0.7), (1.3, 0.9, 0), (4, 3, 3))
    pulled = (Loads(), Loads(tractions=(Traction(tag=HIGH, stress=(1.4, 0.4, -2.2)),)))
    linear, quadratic = (standing(mesh, SOFT, PATCHES, order, loads=pulled) for order in (1, 2))
    control = Control(approach=9.3e-3, body_state=0.5)
    known = problem(linear).solve(control)
    finer = face_on(linear, lambda body: body.as_quadratic())
    again = problem(finer)
    start_from_elements(again, known, linear, control.body_state)
    expected = problem(face_on(quadratic, lambda body: body)).solve(control).force
    assert abs(expected / known.force - 1.0) > 1e-3
    coarse = face_on(finer, lambda body: linear.body)  # has the quadrature of the linear face
    assert problem(coarse).solve(control).force == pytest.approx(known.force, rel=1e-9)
    # quadrature of another degree
    assert again.solve(control).force == pytest.approx(expected, rel=1e-4)


@pytest.mark.long
def test_bolts_turn_the_plane_to_first_order_too():
    """A plane without their moment would bear 6 % less."""
    bolts = (Loads(pulls=(Traction(tag=SIDE, stress=(0.0, 0.0, 30.0)),)),)
    mesh = box((0, 0, -0.7), (1.3, 0.9, 0), (4, 3, 3))
    linear = standing(mesh, SOFT, PATCHES, loads=bolts)
    lower = problem(linear)
    known = lower.solve(Control(force=40.0, tilt=None))
    finer = face_on(linear, lambda body: body.as_quadratic())
    again, control = problem(finer), lower.same_approach()
    start_from_elements(again, known, linear)
    found = again.first_order_step(control, lower, None).force
    whole = again.solve(control)
    assert abs(found - whole.force) < 0.2 * abs(whole.force - known.force)
    # and back to linear elements
    start_from_elements(lower, whole, finer)
    found = lower.step_on_lines(again.same_approach(), again).force
    assert abs(found - known.force) < 0.25 * abs(whole.force - known.force)
