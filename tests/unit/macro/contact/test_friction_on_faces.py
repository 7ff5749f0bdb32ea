"""Friction of laws on faces: the law's own shear, balance, memory of load steps, refusals."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import ufl
from dolfinx import fem
from helpers.body_meshes import box as block
from helpers.body_meshes import hanging, standing
from helpers.contact_laws import PowerLaw, RangedLaw
from helpers.user_problems import HEXAHEDRA, LAWS, PATCHES, box, elastic, marked, pressed_face
from petsc4py import PETSc

from patchlaw.geometry import Control, Friction, PatchGrid, RigidPlane, ShearControl
from patchlaw.geometry.materials import mindlin_ratio
from patchlaw.macro import ElasticBody, FacePair, LawContactProblem, LawsAtPoints, Material, compat
from patchlaw.macro.contact import face_sliders
from patchlaw.support import InputError, NotBalanced, NotConverged

MU, NU = 0.41, 0.2
FRICTION = Friction(coefficient=MU, poisson_ratio=NU)


LAW = RangedLaw(3e3)
RANGED = [RangedLaw(law.k, law.touch) for law in LAWS]


def soft_problem(cells=(2, 2, 1)):
    """A soft box under one law with friction."""
    soft = Material(young_modulus=431.0, poisson_ratio=0.27)
    patch = PatchGrid(grid=(1, 1), lengths=(1.3, 0.9))
    face = standing(block((0, 0, -0.5), (1.3, 0.9, 0), cells), soft, patch)
    return LawContactProblem(face, [LAW], "pointwise", friction=FRICTION)


def test_the_path_of_samples_gone_again_is_that_of_the_load_steps():
    problem = soft_problem((3, 3, 2))
    shifts = [(0.0, 0.0), (2e-4, 1e-4), (-1e-4, 2e-4)]
    for force, shift in zip((0.7, 1.7, 1.7), shifts, strict=True):
        problem.solve(Control(force=force, shear=ShearControl(shift=shift)))
    memory, weight = problem.sliders.memory, problem.sampling.weight
    assert memory.path.shape == (len(weight), 3, 3)
    stress, lost = problem.gone_in_parts(1)
    np.testing.assert_allclose(stress, memory.stress, rtol=1e-12, atol=1e-12 * memory.stress.max())
    assert weight @ lost == pytest.approx(memory.dissipated, rel=1e-12)
    fine, _ = problem.gone_in_parts(8)
    apart = np.abs(fine - stress).max() / np.abs(stress).max()
    assert 1e-4 < apart < 0.2
    # what a change of all stresses by a part changes, against laws that bear more by it
    more = 1e-3 * np.column_stack([np.zeros(len(stress)), memory.stress])
    _, shear = problem.changed_by(more)
    assert 0.0 < shear @ memory.shift < 1e-3 * (weight @ memory.stress) @ memory.shift


@pytest.mark.long
def test_energy_errs_by_the_same_part_before_the_remembered_load_steps(monkeypatch):
    """Of three cycles all or the last two are gone again: errors of all the energy are alike."""
    problem = soft_problem()
    for turn in [(2e-4, 1e-4), (1e-4, -2e-4), (-2e-4, 1e-4)] * 3:
        problem.solve(shifted(*turn))
    memory, weight = problem.sliders.memory, problem.sampling.weight
    errors = []
    for remembered in (9, 6):
        problem.sliders.memory = replace(memory, path=memory.path[:, -remembered:])
        monkeypatch.setattr(face_sliders, "MOST_REMEMBERED", remembered)
        whole, fine = (float(weight @ problem.gone_in_parts(parts)[1]) for parts in (1, 8))
        assert whole == pytest.approx(memory.dissipated, rel=1e-12)
        errors.append(fine - whole)
    assert errors[1] == pytest.approx(errors[0], rel=0.1)  # the first way is another


def test_a_refused_load_step_leaves_sliders_and_worn_depths(monkeypatch):
    """That the supports do not bear the contact is seen after Newton's method ends."""
    problem = soft_problem()
    wearing = np.full(len(problem.sampling.weight), 1e-4)
    borne = ElasticBody.borne
    monkeypatch.setattr(ElasticBody, "borne", lambda *given: 1.01 * borne(*given))
    with pytest.raises(NotBalanced):
        problem.solve(shifted(3e-4, 1e-4), wearing)
    assert problem.sliders.memory.dissipated == 0.0
    assert not problem.forces.worn.any()


@pytest.fixture(scope="module")
def body():
    mesh = box(cells=(3, 3, 2), cell=HEXAHEDRA)
    return SimpleNamespace(mesh=mesh, tags=marked(mesh), space=compat.vector_space(mesh, 1))


def problem_on(body, laws=LAW, scale=1.0, **options):
    given = {"indenter": Control(force=1.7), "friction": FRICTION} | options
    work = {"work": lambda u: scale * elastic(u)}
    return pressed_face(body.space, body.tags, laws=laws, **work, **given)


def shifted(x, y, **other):
    return Control(**(other or {"force": 1.7}), shear=ShearControl(shift=(x, y)))


def sheared(x, y, **other):
    return Control(**(other or {"force": 1.7}), shear=ShearControl(force=(x, y)))


def test_an_interface_states_the_error_of_its_springs(body):
    rough, problem = problem_on(body, scale=1e7)
    rough.indenter = shifted(3e-4, 0.0)
    problem.solve()
    share = rough.shear_force_error / (MU * rough.force)
    assert share == pytest.approx(0.015 + 0.06 * NU, abs=0.0011)  # a per mille by their number


@pytest.mark.parametrize("mode", ["pointwise", "patchwise"])
def test_a_stiff_body_shears_as_the_law_does(body, mode):
    rough, problem = problem_on(body, scale=1e7, mode=mode)
    problem.solve()
    closure = rough.patch_closure[0]
    for part in (0.2, 0.7, 1.4):
        slip = part * MU * mindlin_ratio(NU) * closure
        rough.indenter = shifted(0.6 * slip, -0.8 * slip)
        problem.solve()
        lower = LAW.pressure(max(closure * (1.0 - part), 0.0))
        exact = MU * (1.7 - float(lower))  # on 1 mm²
        # springs by error, 0.2 % of the bound
        assert rough.shear_force == pytest.approx([0.6 * exact, -0.8 * exact], abs=4e-3 * MU * 1.7)
    assert np.hypot(*rough.shear_force) == pytest.approx(MU * rough.force, rel=1e-7)
    assert rough.slip_area == pytest.approx(rough.area, rel=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize("mode", ["pointwise", "patchwise"])
@pytest.mark.parametrize("laws", [LAW, RANGED])
def test_forces_are_in_balance_and_no_step_gains_energy(body, mode, laws):
    patches = {"patches": PATCHES} if laws is RANGED else {}
    rough, problem = problem_on(body, laws, mode=mode, **patches)
    lost = [0.0]
    for control in (
        Control(force=1.7),
        shifted(3e-4, 1e-4),
        shifted(2e-3, -1e-3),
        shifted(-4e-3, 3e-3, force=0.9),
        sheared(0.1, 0.2, force=1.1, tilt=None),
        shifted(0.0, 0.0, approach=3e-3),
    ):
        rough.indenter = control
        problem.solve()
        along = np.array([*rough.shear_force, -rough.force])
        assert problem.reaction() == pytest.approx(-along, abs=1e-8 * rough.force)
        stress = np.hypot(*rough.shear_stress.T)
        assert np.all(stress <= (1.0 + 1e-9) * MU * rough.pressure)
        if control.shear and control.shear.force:
            assert rough.shear_force == pytest.approx(control.shear.force, abs=1e-10)
        lost.append(rough.dissipated)
    assert np.all(np.diff(lost) >= 0.0)
    assert lost[-1] > 0.0


@pytest.mark.long
@pytest.mark.parametrize("mode", ["pointwise", "patchwise"])
@pytest.mark.parametrize(
    "control",
    [
        shifted(7e-4, 3e-4, approach=4e-3),
        shifted(7e-4, 3e-4, force=1.7, tilt=None),
        sheared(0.21, 0.05, force=1.7, tilt=None),
    ],
)
def test_tangents_are_the_derivatives_of_residuals(body, mode, control):
    rough, problem = problem_on(body, RANGED, mode=mode, patches=PATCHES)
    problem.solve()
    rough.indenter = control
    vector = compat.petsc_vector(problem.displacement)
    rng = np.random.default_rng(5)
    vector.array[:] += 1e-5 * rng.normal(size=vector.local_size)
    direction, product = vector.duplicate(), vector.duplicate()
    direction.array[:] = rng.normal(size=vector.local_size)

    def residual(part):
        moved, result = vector.copy(), vector.duplicate()
        moved.axpy(part, direction)
        result.set(0.0)
        rough.add_residual(moved, result)
        return result.array.copy()

    width = 1e-8
    change = (residual(width) - residual(-width)) / (2.0 * width)
    product.set(0.0)
    rough.move_tangent(vector)
    rough.add_product(direction, product)
    # differences of forces that a shift is found for have its tolerance besides
    assert product.array == pytest.approx(change, abs=2e-5 * np.abs(change).max())
    if rough.assembles:
        matrix = compat.assemble_matrix(compat.compile_form(_stiffness(body)), [])
        alone = matrix.copy()
        rough.constrain([])
        rough.add_tangent(vector, matrix)
        matrix.axpy(-1.0, alone)
        rough.move_tangent(vector)
        product.set(0.0)
        rough.add_product(direction, product)
        assert (matrix * direction).array == pytest.approx(
            product.array, abs=1e-12 * np.abs(product.array).max()
        )
        assert (matrix - PETSc.Mat().createTranspose(matrix).convert("aij")).norm() > 0.01


def _stiffness(body):
    u = fem.Function(body.space)
    return ufl.derivative(elastic(u), u)


@pytest.mark.slow
def test_only_accepted_steps_move_the_sliders(body):
    rough, problem = problem_on(body)
    rough.indenter = shifted(1e-3, 0.0)
    problem.solve()
    force, before = rough.shear_force, rough.slip_record
    for x in (5e-3, -2e-3):  # tried, and not accepted
        rough.indenter = shifted(x, 1e-3)
        rough.evaluate(problem.displacement)
    with pytest.raises(NotConverged, match="SLIDES"):
        rough.indenter = sheared(0.8, 0.0)
        problem.solve()
    assert np.array_equal(rough.slip_record.sliders.stress, before.sliders.stress)
    rough.indenter = shifted(1e-3, 0.0)
    problem.solve()  # nothing moves, and nothing is lost
    assert rough.shear_force == pytest.approx(force, rel=1e-9)
    assert rough.slip_record.sliders.stress == pytest.approx(
        before.sliders.stress, abs=1e-9 * force[0]
    )
    rough.indenter = shifted(-3e-3, 2e-3)
    problem.solve()
    there = rough.shear_force, rough.dissipated
    rough.slip_record = before  # the step is taken back, and taken in another run
    rough.indenter = shifted(1e-3, 0.0)
    problem.solve()
    other, again = problem_on(body)
    other.slip_record = rough.slip_record
    for interface, one in ((rough, problem), (other, again)):
        interface.indenter = shifted(-3e-3, 2e-3)
        one.solve()
        assert interface.shear_force == pytest.approx(there[0], rel=1e-8)
        assert interface.dissipated == pytest.approx(there[1], rel=1e-7)


def test_beyond_a_law_nothing_is_accepted(body):
    rough, problem = problem_on(body, RangedLaw(3e3, end=8e-3))
    problem.solve()
    before = rough.slip_record
    rough.indenter = shifted(1e-3, 0.0, force=6.0)
    with pytest.raises(NotConverged, match="LAW_RANGE"):
        problem.solve()
    assert np.array_equal(rough.slip_record.sliders.stress, before.sliders.stress)


def test_the_plane_holds_what_expands_below_it(body):
    """A pressed body that grows sideways is held by friction, and sheared towards its middle."""
    rough, problem = problem_on(body, indenter=Control(force=1.7))
    problem.solve()
    x = rough.points[:, 0] - 0.5
    assert np.corrcoef(x, rough.shear_stress[:, 0])[0, 1] < -0.5
    assert rough.shear_force == pytest.approx([0.0, 0.0], abs=1e-6)


def test_without_friction_tangents_stay_symmetric(body):
    _, plain = problem_on(body, friction=None)
    _, rubbed = problem_on(body)
    assert plain._newton.snes.ksp.getType() == "cg"
    assert rubbed._newton.snes.ksp.getType() == "gmres"


@pytest.mark.parametrize(
    ("options", "problem"),
    [
        ({"friction": -0.1}, "greater than or equal to 1e-06"),
        ({"friction": 0.0}, "greater than or equal to 1e-06"),
        ({"friction": "0.3"}, "must be a number or a Friction or a dictionary or None"),
        ({"friction": True}, "must be a number or a Friction or a dictionary or None"),
        ({"friction": 0.3}, "do not know their ratio"),
        ({"laws": PowerLaw(3e3)}, "needs the range of a law"),
        ({"friction": None, "indenter": shifted(1e-3, 0.0)}, "without friction"),
    ],
)
def test_misuse_is_refused_by_key(body, options, problem):
    with pytest.raises(InputError) as error:
        problem_on(body, **options)
    assert problem in str(error.value)
    assert error.value.key == "friction"


def test_an_external_operator_with_friction_is_refused(body):
    rough, _ = problem_on(body)
    with pytest.raises(InputError, match="knows pressures alone") as error:
        LawsAtPoints(rough, np.zeros((1, 1, 3)))
    assert error.value.key == "friction"


def test_a_plane_without_shear_does_not_slide(body):
    rough, problem = problem_on(body, indenter=RigidPlane(approach=4e-3))
    problem.solve()
    assert rough.shift == pytest.approx([0.0, 0.0])
    plain, _ = problem_on(body, friction=None)
    with pytest.raises(InputError, match="has no friction"):
        plain.slip_record  # noqa: B018


@pytest.mark.long
@pytest.mark.parametrize(
    ("mode", "cells", "energy"),
    [
        ("patchwise", (3, 5, 2), 1e-4),
        ("pointwise", (4, 4, 2), 1e-5),
        # at 492 points of common pieces in place of 192: rims of slip lie between other points
        ("pointwise", (3, 5, 2), 4e-3),
    ],
)
def test_a_stiff_counter_body_shears_as_the_plane_does(mode, cells, energy):
    """Its supports shift; the meshes need not match."""
    soft, rigid = (Material(young_modulus=e, poisson_ratio=0.3) for e in (4e3, 4e9))
    below = block((0, 0, -1), (1, 1, 0), (4, 4, 3))
    counter = block((0, 0, 0), (1, 1, 1), cells)
    face = standing(below, soft, PATCHES)
    pair = FacePair(standing(below, soft, PATCHES), hanging(counter, rigid, PATCHES))
    steps = [Control(force=2.0), shifted(4e-4, 2e-4, force=2.0), shifted(-1e-4, 4e-4, force=1.5)]
    states = []
    for one in (face, pair):
        problem = LawContactProblem(one, RANGED, mode, friction=FRICTION)
        states.append([problem.solve(control) for control in steps])
    for plane, body in zip(*states, strict=True):
        # the counter-body is a millionth as soft
        assert body.force == pytest.approx(plane.force, rel=1e-5)
        assert body.shear.force == pytest.approx(plane.shear.force, rel=2e-5, abs=1e-5)
        assert body.shear.dissipated == pytest.approx(plane.shear.dissipated, rel=energy)
        assert body.reaction == pytest.approx(body.force, rel=1e-8)
    assert np.hypot(*states[1][1].shear.force) > 0.2
