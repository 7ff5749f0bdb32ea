"""Interfaces in a user's problem: what they accept and refuse, tangents, options, failures."""

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest
import ufl
from dolfinx import fem, io
from dolfinx import mesh as dmesh
from helpers.contact_laws import PowerLaw, RangedLaw, Spring
from helpers.faces import at, tagged
from helpers.user_problems import (
    BOTTOM,
    LAWS,
    PATCHES,
    TOP,
    box,
    clamped,
    elastic,
    marked,
    pressed_box,
    pressed_face,
)  # fmt: skip
from mpi4py import MPI
from petsc4py import PETSc

from patchlaw.geometry import Control, Friction, PatchGrid, RigidPlane, ShearControl
from patchlaw.geometry.face_frame import FaceFrame
from patchlaw.macro import ContactProblem, Interface, LawOperator, LawsAtPoints, TaggedMesh, compat
from patchlaw.macro.contact import law_operator
from patchlaw.support import InputError, NotConverged

try:  # before any form is made, for UFL numbers its types when they are imported
    import dolfinx_external_operator as package
except ImportError:
    package = None

LAW, PLANE = PowerLaw(3e3), RigidPlane(approach=6e-3)
TILTED = RigidPlane(approach=8e-3, tilt=(2e-3, -1e-3), centre=(0.5, 0.5))


@dataclass(frozen=True)
class Table:
    """What `Interface` sees of a law table."""

    patches: object
    laws: tuple


@dataclass(frozen=True)
class Tabulated(PowerLaw):
    """A law that knows its area, up to a closure."""

    def at(self, closure, *, extend=False):
        if not extend and np.any(closure > 5e-3):
            raise InputError(
                "closure beyond the end of the patch law", value=float(np.max(closure))
            )
        return SimpleNamespace(contact_area_fraction=np.clip(closure / 0.01, 0.0, 1.0))


@pytest.fixture(scope="module")
def body():
    mesh = box(cells=(4, 4, 2))
    return SimpleNamespace(mesh=mesh, tags=marked(mesh), space=compat.vector_space(mesh, 1))


def on_top(body, **given):
    """The body's top as an interface, and its problem."""
    return pressed_face(body.space, body.tags, **{"laws": LAW, "indenter": PLANE} | given)


def halves_of_top(mesh):
    """Facets of the halves of a top, by tags."""
    return {
        5: at(mesh, 2, 0.0, among=lambda x: x[0] < 0.5 + 1e-9),
        6: at(mesh, 2, 0.0, among=lambda x: x[0] > 0.5 - 1e-9),
    }


def displacement(space, size=1e-3):
    """A field without symmetry."""
    u = fem.Function(space)
    u.interpolate(
        lambda x: size * np.array([np.sin(3 * x[0]), x[1] * x[2], np.cos(2 * x[0]) - x[1] ** 2])
    )
    return u


def test_a_face_is_told_by_number_name_or_facets(body):
    space, tags = body.space, body.tags
    named = TaggedMesh(mesh=body.mesh, facet_tags=tags, facet_names={"pad": TOP, "back": BOTTOM})
    group = SimpleNamespace(dim=2, tag=TOP)
    read = SimpleNamespace(facet_tags=tags, physical_groups={"pad": group})
    ways = [(tags, TOP, {}), (tags, "pad", {"names": {"pad": TOP}}), (None, tags.find(TOP), {})]
    ways += [(named, "pad", {}), (read, "pad", {})]
    forces = []
    for given, tag, options in ways:
        rough = Interface(space, given, tag, laws=LAW, indenter=PLANE, **options)
        forces.append(rough.evaluate(displacement(space)).force)
    assert forces == [forces[0]] * len(ways)
    with pytest.raises(InputError, match=r"no surface of this name; did you mean 'pad'\?"):
        Interface(space, named, "pat", laws=LAW, indenter=PLANE)


def test_facets_in_two_groups_are_refused(body):
    """As in files: which of the two is meant nobody knows."""
    tags, name = body.tags, {"pad": TOP, "every": 77}
    both = np.concatenate([tags.indices, tags.find(TOP)[:3]])
    values = np.append(tags.values, np.full(3, 77)).astype(np.int32)
    order = np.argsort(both, kind="stable")
    twice = dmesh.meshtags(body.mesh, 2, both[order], values[order])
    for tag in (TOP, "every", BOTTOM):
        with pytest.raises(InputError, match=r"3 facets of the mesh are in two groups.* 'every'"):
            Interface(body.space, twice, tag, laws=LAW, indenter=PLANE, names=name)
    # what dolfinx keeps of two groups of gmsh
    with pytest.raises(InputError, match=r"has no facets .* dolfinx keeps the smaller number"):
        Interface(body.space, tags, "every", laws=LAW, indenter=PLANE, names=name)


def test_faces_and_spaces_that_do_not_fit(body):
    around = dmesh.locate_entities_boundary(body.mesh, 2, lambda x: (x[2] > -1e-9) | (x[0] < 1e-9))
    with pytest.raises(InputError, match="given by its facets' is not planar"):
        Interface(body.space, None, around, laws=LAW, indenter=PLANE)
    every = np.arange(body.mesh.topology.index_map(2).size_local)
    with pytest.raises(InputError, match="facets inside the body"):
        Interface(body.space, None, every, laws=LAW, indenter=PLANE)
    scalar = compat.scalar_space(body.mesh, 1)
    square = dmesh.create_unit_square(MPI.COMM_SELF, 2, 2)
    broken = compat.scalar_space(body.mesh, 1, "DG")
    for space in (
        scalar,
        compat.vector_space(body.mesh, 3),
        compat.scalar_space(square, 1),
        broken,
    ):
        with pytest.raises(InputError, match="space of the displacements does not fit"):
            Interface(space, body.tags, TOP, laws=LAW, indenter=PLANE)
    down = FaceFrame(origin=np.zeros(3), axes=np.diag([1.0, -1.0, -1.0]))
    with pytest.raises(InputError, match="frame's normal is not that of the face"):
        Interface(body.space, body.tags, TOP, laws=LAW, indenter=PLANE, frame=down)


def test_a_table_of_one_region_is_a_law_at_points(body):
    table = Table(SimpleNamespace(names=("a",)), (LAW,))
    rough = Interface(body.space, body.tags, TOP, laws=table, indenter=PLANE)
    assert rough.mode == "pointwise"
    with pytest.raises(InputError, match="nothing is solved or evaluated"):
        _ = rough.force


def test_a_smaller_table_lies_in_the_middle_of_the_face(body):
    table = Table(PatchGrid(grid=(2, 2), lengths=(0.5, 0.5)), tuple(LAWS))
    rough = Interface(body.space, body.tags, TOP, laws=table, indenter=PLANE)
    assert rough.mode == "patchwise"
    np.testing.assert_allclose(rough.frame.origin, [0.25, 0.25, 0.0], atol=1e-15)
    state = rough.evaluate(fem.Function(body.space))
    np.testing.assert_allclose(state.patch_closure, PLANE.approach, rtol=1e-12)
    expected = [float(law.pressure(np.array(PLANE.approach))) for law in LAWS]
    assert state.force == pytest.approx(0.0625 * sum(expected), rel=1e-12)


def test_crown_and_centre_are_in_coordinates_of_the_face(body):
    crown = lambda x, y: 1e-3 * (x - 0.5) ** 2  # noqa: E731
    spring = PowerLaw(1e3, power=1.0)
    plane = RigidPlane(approach=5e-3, tilt=(1e-3, 2e-3), centre=(0.2, 0.3))
    rough = Interface(body.space, body.tags, TOP, laws=spring, indenter=plane, crown=crown)
    force = rough.evaluate(fem.Function(body.space)).force
    assert force == pytest.approx(1e3 * (5e-3 + 1e-3 * 0.3 + 2e-3 * 0.2 - 1e-3 / 12.0), rel=1e-12)
    x, y = rough.points.T
    np.testing.assert_allclose(rough.closure, plane.at(x, y) - crown(x, y), rtol=1e-12)


@pytest.mark.parametrize(
    "patches", [None, PatchGrid(grid=(2, 1), lengths=(0.5, 0.3), origin=(0.4, 0.6))]
)
def test_planes_turn_about_the_middle_unless_told(body, patches):
    """A plane and a control of one approach and tilt are one load."""
    spring, tilt = PowerLaw(1e3, power=1.0), (1.3e-3, -2.1e-3)
    laws = {"laws": spring} if patches is None else {"laws": [spring] * 2, "patches": patches}
    x, y = (0.5, 0.5) if patches is None else (0.65, 0.75)
    given = (
        RigidPlane(approach=5e-3, tilt=tilt),
        Control(approach=5e-3, tilt=tilt),
        RigidPlane(approach=5e-3, tilt=tilt, centre=(x, y)),
    )
    area = 1.0 if patches is None else 0.15
    for indenter in given:
        rough = Interface(body.space, body.tags, TOP, mode="pointwise", indenter=indenter, **laws)
        state = rough.evaluate(fem.Function(body.space))
        # springs under a plane through its approach in the middle; about a corner it is 20 % off
        assert state.force == pytest.approx(1e3 * 5e-3 * area, rel=1e-11)
        assert state.plane == RigidPlane(approach=5e-3, tilt=tilt, centre=state.plane.centre)
        assert state.plane.centre == pytest.approx((x, y), rel=1e-12)
        # ∫ k t·(x − xm)² dA by sides
        lx, ly = (1.0, 1.0) if patches is None else (0.5, 0.3)
        expected = 1e3 * area / 12.0 * np.array([tilt[0] * lx**2, tilt[1] * ly**2])
        np.testing.assert_allclose(state.moment, expected, rtol=1e-9)


@pytest.mark.parametrize("mode", ["patchwise", "pointwise"])
@pytest.mark.parametrize(
    "indenter", [TILTED, Control(force=5.0, tilt=None)], ids=["placed", "free"]
)
def test_tangent_is_the_derivative_of_the_residual(body, mode, indenter):
    space, u = body.space, displacement(body.space)
    options = {"mode": mode, "patches": PATCHES, "indenter": indenter}
    rough = Interface(space, body.tags, TOP, laws=LAWS, bcs=[clamped(space, body.tags)], **options)
    form = ufl.derivative(elastic(u), u)
    matrix = compat.assemble_matrix(compat.compile_form(form), [clamped(space, body.tags)])
    shell = rough.tangent(matrix)
    rough.move_tangent(u)
    step = displacement(space)
    step.x.array[:] = np.random.default_rng(3).standard_normal(len(step.x.array))
    direction = compat.petsc_vector(step).copy()
    product, plain = matrix.createVecLeft(), matrix.createVecLeft()
    shell.mult(direction, product)
    matrix.mult(direction, plain)
    product.axpy(-1.0, plain)
    change, residuals, width = direction.duplicate(), [], 1e-9
    for sign in (1.0, -1.0):
        moved = fem.Function(space)
        moved.x.array[:] = u.x.array + sign * width * step.x.array
        residuals.append(matrix.createVecLeft())
        residuals[-1].set(0.0)
        rough.add_residual(moved, residuals[-1])
    change = (residuals[0].array_r - residuals[1].array_r) / (2.0 * width)
    np.testing.assert_allclose(product.array_r, change, atol=2e-5 * np.abs(change).max())
    if rough.assembles:
        rough.add_tangent(u, matrix)
        added = matrix.createVecLeft()
        matrix.mult(direction, added)
        added.axpy(-1.0, plain)
        np.testing.assert_allclose(
            added.array_r, product.array_r, atol=1e-12 * np.abs(change).max()
        )
    else:
        with pytest.raises(InputError, match=r"fits no matrix \(allowed: .*Interface\.tangent"):
            rough.add_tangent(u, matrix)


def test_the_edge_of_a_held_face_is_left_out(body):
    space, u = body.space, displacement(body.space)
    held = clamped(space, body.tags, tag=TOP)
    rough = Interface(space, body.tags, TOP, laws=LAW, indenter=PLANE, bcs=[held])
    residual = compat.petsc_vector(u).duplicate()
    residual.set(0.0)
    rough.add_residual(u, residual)
    assert rough.evaluate(u).force > 0.0
    assert residual.norm() == 0.0
    rough.constrain([])
    rough.add_residual(compat.petsc_vector(u), residual)
    assert -residual.array_r[2::3].sum() == pytest.approx(-rough.force, rel=1e-12)
    other = fem.Function(compat.vector_space(body.mesh, 2))
    with pytest.raises(InputError, match="displacements are those of another space"):
        rough.add_residual(other, residual)


def test_area_and_range_of_laws(body):
    space = body.space
    laws = Tabulated(3e3)
    rough = Interface(space, body.tags, TOP, laws=laws, indenter=RigidPlane(approach=4e-3))
    assert rough.evaluate(fem.Function(space)).contact_area == pytest.approx(0.4)
    rough.check_range()
    rough, problem = on_top(body, laws=laws, indenter=RigidPlane(approach=4e-3))
    problem.solve()
    rough.indenter = RigidPlane(approach=9e-3)
    with pytest.raises(NotConverged, match=r"LAW_RANGE: 0\.00.*larger approach"):
        problem.solve()
    assert rough.closure.max() > 5e-3
    plain = Interface(space, body.tags, TOP, laws=LAW, indenter=PLANE)
    assert plain.evaluate(problem.displacement).contact_area is None


def test_failure_is_named_and_keeps_the_displacement(body):
    rough, problem = on_top(body)
    problem.solve()
    u, support = problem.displacement, clamped(body.space, body.tags)
    known, force = u.x.array.copy(), rough.force
    few = ContactProblem(elastic(u), u, [support], rough, petsc_options={"snes_max_it": 1})
    rough.indenter = RigidPlane(approach=9e-3)
    with pytest.raises(
        NotConverged, match=r"approach 0\.009 mm .*DIVERGED_MAX_IT after 1 .*nearer"
    ):
        few.solve()
    np.testing.assert_array_equal(u.x.array, known)
    rough.indenter = PLANE
    assert problem.solve() == 0
    assert rough.force == pytest.approx(force, rel=1e-12)
    loose = ContactProblem(
        elastic(u), u, [support], rough, petsc_options={"pc_type": "jacobi", "ksp_max_it": 1}
    )
    rough.indenter = RigidPlane(approach=9e-3)
    with pytest.raises(NotConverged, match=r"DIVERGED_LINEAR_SOLVE \(DIVERGED_.*petsc_options"):
        loose.solve()


def test_problems_that_do_not_fit(body):
    u, other = fem.Function(body.space), fem.Function(compat.vector_space(body.mesh, 1))
    rough = Interface(body.space, body.tags, TOP, laws=LAW, indenter=PLANE)
    with pytest.raises(InputError, match="that of another space"):
        ContactProblem(elastic(other), other, [], rough)
    with pytest.raises(InputError, match="does not depend on the displacement"):
        ContactProblem(elastic(displacement(body.space)), u, [], rough)


def test_linear_bodies_keep_their_matrix(body, monkeypatch):
    (rough, problem), made = on_top(body), []
    monkeypatch.setattr(compat, "assemble_matrix_into", lambda *_: made.append(1))
    for approach in (4e-3, 6e-3):
        rough.indenter = RigidPlane(approach=approach)
        problem.solve()
    assert made == []
    assert not PETSc.Options().getAll().keys() & {"patchlaw_pc_type"}


@pytest.mark.parametrize("in_matrix", [False, True])
def test_law_a_hundred_thousand_times_as_stiff_as_the_body(body, in_matrix):
    """The preconditioner smooths with the body's matrix alone, and stays definite."""
    solver = {"petsc_options": {"pc_type": "gamg"}, "in_matrix": in_matrix}
    plane = RigidPlane(approach=8e-3)
    rough, problem = on_top(body, laws=PowerLaw(3e8), indenter=plane, solver=solver)
    assert problem.solve() < 15
    assert problem.reaction()[2] == pytest.approx(rough.force, rel=1e-8)
    rough.indenter = Control(force=10.0, tilt=None)  # whose tangent cannot be assembled
    problem.solve()
    assert rough.force == pytest.approx(10.0, rel=1e-9)


@pytest.mark.long
@pytest.mark.parametrize("indenter", [PLANE, Control(force=500.0, tilt=None)])
def test_laws_at_points_are_known_to_the_preconditioner(indenter):
    mesh = box(cells=(12, 12, 8))
    face, spent, found = (compat.vector_space(mesh, 1), marked(mesh)), {}, {}
    for in_matrix in (True, False):
        given = {"laws": PowerLaw(3e7), "indenter": indenter}
        rough, problem = pressed_face(*face, solver={"in_matrix": in_matrix}, **given)
        steps = problem.solve()
        spent[in_matrix] = problem.report.linear_iterations / steps
        moved = np.linalg.norm(problem.displacement.x.array)
        found[in_matrix] = rough.force, *rough.moment, moved
    assert spent[True] < min(20, 0.6 * spent[False])
    np.testing.assert_allclose(found[True], found[False], rtol=1e-7, atol=1e-7)


def test_springs_in_the_matrix_follow_a_material_that_changes(body):
    """A new modulus has the matrix assembled anew: springs of before must not stay in, or out."""
    modulus = fem.Constant(body.mesh, PETSc.ScalarType(1.0))

    def forces(in_matrix):
        modulus.value, found = 1.0, []
        own = {"work": lambda u: modulus * elastic(u), "solver": {"in_matrix": in_matrix}}
        rough, problem = on_top(body, laws=PowerLaw(3e5), **own)
        for value, plane in ((1.0, PLANE), (3.0, PLANE), (3.0, TILTED), (0.2, TILTED)):
            modulus.value, rough.indenter = value, plane
            assert problem.solve() < 12
            found.append(rough.force)
        return found

    np.testing.assert_allclose(forces(in_matrix=True), forces(in_matrix=False), rtol=1e-8)


def test_one_interface_in_two_problems(body):
    """What one problem's matrix keeps of the laws is nothing to the other's."""
    space, problems, steps, forces = body.space, [], [], []
    rough = Interface(space, body.tags, TOP, laws=PowerLaw(3e6), indenter=PLANE)
    for factor in (1.0, 20.0):
        u = fem.Function(space)
        held = [clamped(space, body.tags)]
        problems.append(ContactProblem(factor * elastic(u), u, held, rough))
    for approach in (4e-3, 6e-3, 8e-3):
        for problem in problems:
            rough.indenter = RigidPlane(approach=approach)
            steps.append(problem.solve())
            forces.append(rough.force)
    assert max(steps) < 10
    for factor, found in zip((1.0, 20.0), (forces[0::2], forces[1::2]), strict=True):
        own = {"work": lambda u, factor=factor: factor * elastic(u), "solver": {"in_matrix": False}}
        alone, problem = on_top(body, laws=PowerLaw(3e6), **own)
        for approach, force in zip((4e-3, 6e-3, 8e-3), found, strict=True):
            alone.indenter = RigidPlane(approach=approach)
            problem.solve()
            assert force == pytest.approx(alone.force, rel=1e-8)


def test_callables_are_what_the_package_of_external_operators_asks_for(body):
    """Values on quadrature points, flat, and their derivative."""
    rough = Interface(
        body.space, body.tags, TOP, laws=LAWS, patches=PATCHES, mode="pointwise", indenter=TILTED
    )
    points = np.random.default_rng(1).uniform(0.0, 1.0, (5, 3, 3)) * [1.0, 1.0, 0.0]
    points[-1, -1, 0] = 1.5  # off the patches
    laws = LawsAtPoints(rough, points)
    outward = np.random.default_rng(2).uniform(-2e-3, 2e-3, (5, 3))
    pressure = laws.external_function((0,))(outward)
    closure = TILTED.at(points[..., 0], points[..., 1]) + outward
    index = 2 * (points[..., 0] > 0.5) + (points[..., 1] > 0.5)
    expected = np.array(
        [LAWS[i].pressure(c) for i, c in zip(index.flat, closure.flat, strict=True)]
    )
    expected[-1] = 0.0
    assert pressure.shape == (15,)
    np.testing.assert_allclose(pressure, expected, rtol=1e-13)
    ends = [laws.external_function((0,))(outward + sign * 1e-8) for sign in (1.0, -1.0)]
    slope = laws.external_function((1,))(outward)
    np.testing.assert_allclose(slope, (ends[0] - ends[1]) / 2e-8, rtol=1e-5, atol=1e-3)
    with pytest.raises(InputError, match="no such derivative"):
        laws.external_function((2,))
    rough.indenter = Control(force=1.0)
    with pytest.raises(InputError, match="needs the plane in its place"):
        laws.external_function((0,))(outward)
    patchwise = Interface(body.space, body.tags, TOP, laws=LAWS, patches=PATCHES, indenter=PLANE)
    with pytest.raises(InputError, match="holds at points"):
        LawsAtPoints(patchwise, points)


def test_external_operators_need_a_package(body, monkeypatch):
    monkeypatch.setattr(law_operator, "PACKAGE", "no_such_package")
    rough = Interface(body.space, body.tags, TOP, laws=LAW, indenter=PLANE)
    with pytest.raises(InputError, match="need the package dolfinx-external-operator"):
        LawOperator(rough, fem.Function(body.space))


def test_external_operator_assembles_the_same(body):
    if package is None or not hasattr(dmesh, "EntityMap"):
        pytest.skip("external operators on a face need their package and dolfinx 0.10")
    space, u = body.space, displacement(body.space)
    rough = Interface(
        space, body.tags, TOP, laws=LAWS, patches=PATCHES, mode="pointwise", indenter=TILTED
    )
    operator = LawOperator(rough, u)
    test = ufl.TestFunction(space)
    term = operator.pressure * ufl.inner(operator.normal, test) * operator.measure
    form, operators = package.replace_external_operators(term)
    compiled = fem.form(form, entity_maps=operator.entity_maps)
    values = package.evaluate_operands(operators, entities=operator.entities)
    package.evaluate_external_operators(operators, values)
    found = compat.assemble_vector(compiled)
    residual = found.duplicate()
    residual.set(0.0)
    rough.add_residual(u, residual)
    residual.axpy(-1.0, found)
    assert residual.norm() < 1e-13 * found.norm()


@pytest.mark.parametrize("mode", ["pointwise", "patchwise"])
@pytest.mark.parametrize("degree", [1, 2])
def test_fields_are_functions_of_the_mesh(mode, degree, tmp_path):
    """On a tilted plane closures are linear over the face, and so are pressures of springs."""
    mesh = box()
    tags, space = marked(mesh), compat.vector_space(mesh, degree)
    law = Spring(3e4)
    law.range = 0.0, 1.0
    plane = RigidPlane(approach=4e-3, tilt=(2e-3, -1e-3))
    rough = Interface(
        space, tags, TOP, laws=[law] * 4, patches=PATCHES, mode=mode, indenter=plane,
        friction=Friction(coefficient=0.3, poisson_ratio=0.2),
    )  # fmt: skip
    rough.evaluate(fem.Function(space))
    fields = rough.fields()
    assert list(fields) == ["pressure", "closure", "stiffness", "slip_x", "slip_y"]
    top = fem.locate_dofs_geometrical(
        fields["closure"].function_space, lambda x: np.isclose(x[2], 0.0)
    )
    x, y, _ = fields["closure"].function_space.tabulate_dof_coordinates()[top].T
    closure = fields["closure"].x.array
    known = 4e-3 + 2e-3 * (x - 0.5) - 1e-3 * (y - 0.5)
    # a vertex has the mean around it, which at the border lies at most one edge inside
    allowed = 3e-3 * 0.25 if mode == "pointwise" else 3e-3 * 0.5
    assert np.abs(closure[top] - known).max() < allowed
    assert closure[top].mean() == pytest.approx(4e-3, rel=0.02)
    assert not np.delete(closure, top).any()
    np.testing.assert_allclose(fields["pressure"].x.array, 3e4 * closure, atol=1e-12)
    np.testing.assert_allclose(fields["stiffness"].x.array[top], 3e4, rtol=1e-12)
    assert not fields["slip_x"].x.array.any()
    if compat.HAS_VTX:
        io.VTXWriter(mesh.comm, str(tmp_path / "face.bp"), [*fields.values()]).write(0.0)


def zoned(friction=None, **options):
    """A box whose top has two zones, and the interface and problem of them."""
    mesh = box(cells=(6, 4, 3))
    tags = tagged(mesh, halves_of_top(mesh) | {BOTTOM: at(mesh, 2, -1.0)})
    names = {"soft": 5, "hard": 6}
    space = compat.vector_space(mesh, 1)
    return pressed_face(space, tags, None, names=names, friction=friction, **options)


SOFT, HARD = RangedLaw(1e4, end=1.0), RangedLaw(4e4, touch=1e-3, end=1.0)
ZONES = {"soft": SOFT, "hard": HARD}


def test_zones_by_name_are_patches_of_the_same_outline():
    crown = {"soft": None, "hard": lambda x, y: 1e-3 * (x - 0.5)}
    indenter = Control(force=3.7, tilt=None)
    rough, problem = zoned(laws=ZONES, crown=crown, indenter=indenter)
    problem.solve()
    known, problem = pressed_box(
        cells=(6, 4, 3), laws=[SOFT, HARD], mode="pointwise", indenter=indenter,
        patches=PatchGrid(grid=(2, 1), lengths=(1.0, 1.0)),
        crown=lambda x, y: 1e-3 * np.maximum(x - 0.5, 0.0),
    )  # fmt: skip
    problem.solve()
    np.testing.assert_allclose(rough.patch_pressure, known.patch_pressure, rtol=1e-8)
    assert rough.plane.approach == pytest.approx(known.plane.approach, rel=1e-8)
    np.testing.assert_allclose(rough.plane.tilt, known.plane.tilt, rtol=1e-7)
    assert rough.area == pytest.approx(known.area, rel=1e-8)


def test_zones_have_friction_of_their_own():
    friction = {"soft": Friction(coefficient=0.1, poisson_ratio=0.2),
                "hard": Friction(coefficient=0.4, poisson_ratio=0.2)}  # fmt: skip
    slides = Control(approach=6e-3, shear=ShearControl(shift=(0.5, 0.0)))
    rough, problem = zoned(laws=ZONES, friction=friction, indenter=slides)
    problem.solve()
    force = 0.5 * rough.patch_pressure
    assert rough.shear_force[0] == pytest.approx(0.1 * force[0] + 0.4 * force[1], rel=1e-6)

    def pushed(sliding):  # what shear stresses follow pressures where the face comes nearer
        matrix = rough.stiffness_matrix(problem.displacement, sliding=sliding)
        near, load = matrix.createVecs()
        near.array[2::3] = 1.0
        matrix.mult(near, load)
        return np.array([load.array[k::3].sum() for k in (0, 2)])

    (alike, normal), (soft, _), (hard, _), (both, _) = map(
        pushed, [(0.3, 0.0), [[0.3, 0], [0, 0]], [[0, 0], [0.3, 0]], [[0.3, 0], [0.6, 0]]]
    )
    assert abs(alike) == pytest.approx(0.3 * abs(normal), rel=1e-9)
    assert soft + hard == pytest.approx(alike, rel=1e-9)
    assert both == pytest.approx(soft + 2.0 * hard, rel=1e-9) and abs(hard) > abs(soft) > 0.0
    same = {name: Friction(coefficient=0.3, poisson_ratio=0.2) for name in ZONES}
    sticks = Control(approach=6e-3, shear=ShearControl(shift=(2e-4, 0.0)))
    found = []
    for given in (same, same["soft"]):
        rough, problem = zoned(laws=ZONES, friction=given, indenter=sticks)
        problem.solve()
        found.append([rough.force, *rough.shear_force, rough.shear_force_error])
    np.testing.assert_allclose(found[0], found[1], rtol=1e-10)


@pytest.mark.parametrize(
    ("options", "problem"),
    [
        ({"laws": SOFT}, "tag = None: an interface without a face"),
        ({"laws": {"soft": SOFT, "harder": HARD}}, "harder"),
        ({"laws": {"soft": SOFT, 5: HARD}}, "zones that share facets"),
        ({"laws": ZONES, "friction": {"soft": 0.3}}, "friction.*soft, hard"),
        ({"laws": ZONES, "crown": {"soft": None}}, "crown.*soft, hard"),
        ({"laws": {"soft": SOFT, "hard": 3.0}}, "interface without a face"),
    ],
)
def test_zones_that_do_not_fit(options, problem):
    with pytest.raises(InputError, match=problem):
        zoned(indenter=PLANE, **options)


def test_a_number_without_facet_tags(body):
    with pytest.raises(InputError, match="without facet tags"):
        Interface(body.space, None, 7, laws=LAW, indenter=PLANE)
