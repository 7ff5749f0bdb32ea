"""A half-space on the other side of a face with laws: against dense matrices of rectangles."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.block_cases import block_of
from scipy.linalg import lu_factor, lu_solve

from patchlaw.geometry import Control, Friction, Material, MaterialPair, PatchGrid, ShearControl
from patchlaw.macro import LawContactProblem, LoadedFace
from patchlaw.macro.contact.opposite_half_space import OppositeHalfSpace
from patchlaw.macro.mesh.contact_face import top_facets
from patchlaw.micro import influence_matrix
from patchlaw.micro.friction.tangential_grid import CrossCompliance, cerruti_kernels
from patchlaw.support.errors import NotConverged

COMPLIANCE = 1e-3  # (1 − ν²)/E of the half-space [1/MPa]
NU = 0.3
APPROACH = 0.01


class Line:
    """Pressure in proportion to the closure."""

    def __init__(self, stiffness):
        self._stiffness = stiffness

    def pressure(self, closure):
        return self._stiffness * np.maximum(closure, 0.0)

    def stiffness(self, closure):
        return self._stiffness * (closure > 0.0)


def half_space_of(compliance):
    return Material(young_modulus=(1.0 - NU**2) / compliance, poisson_ratio=NU)


def face_of(cells, modulus=1e9):
    """Return the whole top of a block as one region."""
    block = block_of(element="Q1", cells=(cells, cells, 3), young_modulus=modulus)
    return LoadedFace.of_regions(block, (top_facets(block.mesh),), (1.0, 1.0))


def pressed(face, stiffness, control, opposite=COMPLIANCE, law=None):
    other = half_space_of(opposite) if opposite else None
    problem = LawContactProblem(face, [law or Line(stiffness)], "pointwise", opposite=other)
    return problem, problem.solve(control)


def test_uniform_pressure_moves_a_square_as_love_says():
    sampling = face_of(16).pointwise
    half_space = OppositeHalfSpace(sampling, (1.0, 1.0), half_space_of(COMPLIANCE), 0.0)
    moved = half_space.at_samples(
        half_space.moved(half_space.spread(np.full(len(sampling.weight), 5.0)))
    )
    mean = sampling.weight @ moved / sampling.weight.sum()
    assert mean == pytest.approx(0.9464 * 5.0 * COMPLIANCE, rel=3e-3)  # of 38 squares a side


def test_its_compliance_is_symmetric():
    """Its three directions together: by pressures and by shear stresses, and across."""
    sampling, rng = face_of(5).pointwise, np.random.default_rng(2)
    half_space = OppositeHalfSpace(sampling, (1.0, 1.0), half_space_of(COMPLIANCE), 0.0)

    def moved(stress):
        forces = half_space.spread(stress)
        along = half_space.moved_along(forces[1:])
        own = np.concatenate([half_space.moved(forces[0])[None], along])
        across = half_space.across(forces[0], forces[1:])
        across[0] *= -1.0  # the half-space bears the opposite of stresses along the face
        own[1:] *= -1.0
        return half_space.at_samples(own + across)

    one, other = rng.random((2, len(sampling.weight), 3))
    signs = np.array([1.0, -1.0, -1.0])
    works = [
        float(np.sum(sampling.weight[:, None] * left * signs * moved(right)))
        for left, right in ((one, other), (other, one))
    ]
    assert works[0] == pytest.approx(works[1], rel=1e-12)


def test_shear_forces_move_an_oblong_grid_as_sums_over_squares_say():
    half_space = OppositeHalfSpace(face_of(2).pointwise, (1.0, 0.4), half_space_of(COMPLIANCE), 0.0)
    nx, ny = half_space.spread(np.zeros(len(half_space._sampling.weight))).shape
    assert nx > ny
    side = half_space._side
    kernels = cerruti_kernels((nx, ny), (side, side), NU) * COMPLIANCE / side**2
    xx, yy, mixed = kernels
    along = np.random.default_rng(5).normal(size=(2, nx, ny))
    expected = np.zeros_like(along)
    for i, j in np.ndindex(nx, ny):
        di, dj = np.arange(nx)[:, None] - i, np.arange(ny)[None, :] - j
        place, sign = (np.abs(di), np.abs(dj)), np.sign(di) * np.sign(dj)
        x, y = along[:, i, j]
        expected += [
            xx[place] * x + sign * mixed[place] * y,
            sign * mixed[place] * x + yy[place] * y,
        ]
    assert half_space.moved_along(along) == pytest.approx(expected, rel=1e-11, abs=1e-13)


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


def test_a_step_whose_conjugate_gradients_do_not_end_says_so(monkeypatch):
    monkeypatch.setattr("patchlaw.macro.contact.opposite_half_space._MOST_PRODUCTS", 2)
    with pytest.raises(NotConverged, match="DIVERGED_LINEAR_SOLVE") as error:
        pressed(face_of(4), 5e4, Control(approach=APPROACH))
    assert error.value.iterations == 2


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


def punch_on_springs(compliance, stiffness, n=32):
    """Return the force of a rigid square on springs on a half-space, by an active set."""
    patches = PatchGrid(grid=(n, n), lengths=(1.0, 1.0))
    matrix = influence_matrix(patches) * compliance / np.pi + np.eye(n * n) / stiffness
    loaded = np.ones(n * n, bool)
    while True:
        pressure = np.zeros(n * n)
        pressure[loaded] = np.linalg.solve(
            matrix[np.ix_(loaded, loaded)], np.full(loaded.sum(), APPROACH)
        )
        now = (pressure > 0.0) | (~loaded & (matrix @ pressure < APPROACH))
        if np.array_equal(now, loaded):
            return pressure.mean()
        loaded = now


def test_a_flat_punch_on_a_half_space_that_is_far_softer_than_springs():
    """Springs are 5·10⁴ times as stiff as the half-space: a rigid punch."""
    expected = punch_on_springs(5e-3, 1e7)
    assert expected == pytest.approx(1.15 * APPROACH / 5e-3, rel=0.01)  # E* L δ / 0.868 of a square
    errors = [
        pressed(face_of(cells), 1e7, Control(approach=APPROACH), opposite=5e-3)[1].force / expected
        - 1
        for cells in (2, 4)
    ]
    assert 0.0 < errors[1] < 0.5 * errors[0]  # squares of the border reach beyond the face
    assert errors[1] < 0.065


RATIOS = {1e-4: 0.134014784, 1.0: 521.210092, 1e4: 916.844654}
"""Forces on steep springs by moduli of the half-space over that of the body. From 1 on they are
those that Newton's method on the displacements of the half-space found, another algorithm."""


@pytest.mark.parametrize("ratio", RATIOS)
def test_a_body_is_solved_for_a_few_times_whatever_the_moduli(ratio):
    face, opposite = face_of(6, modulus=1e5), (1.0 - NU**2) / (1e5 * ratio)
    problem, state = pressed(face, 1e6, Control(approach=APPROACH), opposite=opposite)
    assert state.force == pytest.approx(RATIOS[ratio], rel=1e-7)
    assert state.iterations <= 16
    assert state.linear_iterations <= 5 * state.iterations  # each corrects the one before
    slope = problem.approach_response().stiffness
    step = problem.solve(Control(approach=APPROACH * (1.0 + 1e-4)))
    assert step.iterations <= 16
    assert (step.force - state.force) / (1e-4 * APPROACH) == pytest.approx(slope, rel=1e-3)
    _, again = pressed(face, 1e6, Control(force=state.force, tilt=None), opposite=opposite)
    assert again.approach == pytest.approx(APPROACH, rel=5e-4)  # the free plane turns by 2e-4
    assert again.iterations <= 16


class Explosive:
    """A law that leaves all numbers behind at the closures of a first guess."""

    def pressure(self, closure):
        return 1e-2 * np.expm1(np.clip(closure / 4e-4, 0.0, 200.0))

    def stiffness(self, closure):
        return np.where(closure > 0.0, 25.0 * np.exp(np.clip(closure / 4e-4, 0.0, 200.0)), 0.0)


def test_a_law_that_leaves_all_numbers_behind_is_a_rigid_punch_less_its_closure():
    face = face_of(4, modulus=2e5)
    _, state = pressed(face, None, Control(approach=0.05), opposite=5e-3, law=Explosive())
    closure = float(state.sample_closure.mean())
    rigid = pressed(face, 1e7, Control(approach=0.05 - closure), opposite=5e-3)[1].force
    assert state.force == pytest.approx(rigid, rel=0.01)  # closures vary by a third of the mean
    assert state.iterations <= 10


# --- with friction

SHIFT, STIFF, RATIO = 1e-3, 500.0, 1.7 / 1.4
"""Shift [mm], stiffness of the springs [MPa/mm] and Mindlin's ratio at ν = 0.3."""


class Springs(Line):
    """A line that friction takes for a bed of springs."""

    range = (0.0, 0.1)


def rubbed(face, control, *, opposite=COMPLIANCE, nu=NU, friction=10.0):
    """Return a problem on springs with friction, its state, and the tangential stiffness."""
    modulus = (1.0 - nu**2) / opposite if opposite else 1.0
    other = Material(young_modulus=modulus, poisson_ratio=nu) if opposite else None
    rubs = Friction(coefficient=friction, poisson_ratio=NU)
    problem = LawContactProblem(face, [Springs(STIFF)], "pointwise", friction=rubs, opposite=other)
    state = problem.solve(Control(approach=APPROACH))
    state = problem.solve(control)
    return state, problem.tangential_stiffness()[0]


def rigid_square_on_springs(nu, compliance, n=24):
    """Return normal and shear force of a rigid square on springs on a half-space, by squares.

    Pressures and tractions in turn until they agree, each by a dense matrix.
    """
    material = Material(young_modulus=(1.0 - nu**2) / compliance, poisson_ratio=nu)
    pair, spacing = MaterialPair(first=material), (1.0 / n, 1.0 / n)
    patches = PatchGrid(grid=(n, n), lengths=(1.0, 1.0))
    normal = influence_matrix(patches) * compliance / np.pi + np.eye(n * n) / STIFF
    kernels = cerruti_kernels((n, n), spacing, nu) * compliance
    i, j = (index.ravel() for index in np.indices((n, n)))
    di, dj = (np.subtract.outer(one, one) for one in (i, j))
    xx, yy, xy = (kernel[np.abs(di), np.abs(dj)] for kernel in kernels)
    xy = xy * np.sign(di) * np.sign(dj)
    along = np.block([[xx, xy], [xy, yy]]) + RATIO / STIFF * np.eye(2 * n * n)
    cross = CrossCompliance((n, n), spacing, pair, periodic=False)
    normal, along = lu_factor(normal), lu_factor(along)
    traction = np.zeros((2, n, n))
    for _ in range(12):
        # the half-space bears the opposite traction, and its sideways displacement adds to the slip
        across = -cross.across(traction).ravel()
        pressure = lu_solve(normal, APPROACH - across).reshape(n, n)
        slip = np.array([SHIFT, 0.0])[:, None, None] + cross.sideways(pressure)
        traction = lu_solve(along, slip.ravel()).reshape(2, n, n)
    return pressure.mean(), traction[0].mean()


@pytest.mark.parametrize(("nu", "opposite"), [(0.0, 1e-3), (0.49, 1e-3), (0.3, 0.02)])
def test_a_rigid_body_shears_a_half_space_as_dense_matrices_say(nu, opposite):
    control = Control(approach=APPROACH, shear=ShearControl(shift=(SHIFT, 0.0)))
    state, stiffness = rubbed(face_of(8), control, nu=nu, opposite=opposite)
    force, shear = rigid_square_on_springs(nu, opposite)
    allowed = 3e-3 if opposite == COMPLIANCE else 0.02  # of 8 linear cells a side, and its edges
    assert state.force == pytest.approx(force, rel=allowed)
    assert state.shear.force[0] == pytest.approx(shear, rel=allowed)
    assert state.shear.force[1] == pytest.approx(0.0, abs=1e-4 * shear)
    # everything sticks
    assert stiffness == pytest.approx(state.shear.force[0] / SHIFT, rel=3e-3)
    _, rigid = rubbed(face_of(8), control, opposite=None)
    assert stiffness < 0.9 * rigid


@pytest.mark.parametrize("ratio", [1e-3, 1e3])
def test_with_friction_too_a_body_is_solved_for_a_few_times(ratio):
    """The solutions of both load steps together."""
    opposite, control = (1.0 - NU**2) / (STIFF * 10.0 * ratio), Control(approach=APPROACH)
    face = face_of(4, modulus=STIFF * 10.0)
    state, _ = rubbed(
        face,
        replace(control, shear=ShearControl(shift=(SHIFT, 0.0))),
        opposite=opposite,
        friction=0.3,
    )
    assert 0.0 < state.shear.force[0] < 0.3 * state.force
    assert state.iterations <= 12


def test_sliding_on_a_half_space_far_softer_than_springs_is_that_of_a_punch_without_springs():
    """Stiff springs close by less and less of the approach: forces grow as the half-space's."""
    scaled = []
    for softer in (300.0, 1e3):  # than springs under the whole face
        control = Control(approach=APPROACH, shear=ShearControl(shift=(SHIFT, 0.0)))
        state, _ = rubbed(face_of(1), control, opposite=softer / STIFF, friction=0.3)
        scaled.append(softer * np.array([state.force, state.shear.force[0]]))
        assert 0.0 < state.shear.force[0] < 0.3 * state.force
    np.testing.assert_allclose(*scaled, rtol=0.02)  # the springs' share


def test_a_shear_force_finds_the_shift_that_makes_it_and_sliding_is_the_coefficient():
    face = face_of(4)
    control = Control(approach=APPROACH, shear=ShearControl(shift=(SHIFT, 2e-4)))
    state, _ = rubbed(face, control, friction=0.3)
    again, _ = rubbed(
        face, Control(approach=APPROACH, shear=ShearControl(force=state.shear.force)), friction=0.3
    )
    assert again.shear.shift == pytest.approx((SHIFT, 2e-4), rel=1e-6)
    far = Control(approach=APPROACH, shear=ShearControl(shift=(0.1, 0.0)))
    state, stiffness = rubbed(face, far, friction=0.3)
    # directions differ by what pressures pull sideways, a hundredth of the shift
    assert state.shear.force[0] == pytest.approx(0.3 * state.force, rel=1e-4)
    assert abs(stiffness) < 1e-4 * STIFF  # as directions go on turning
