"""Interfaces of plane and axisymmetric problems and of mixed spaces, against blocks and forms."""

import numpy as np
import pytest
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from helpers.contact_laws import Exponential, PowerLaw, RangedLaw
from helpers.plane_problems import (
    POISSON,
    SHEAR,
    UNIAXIAL,
    YOUNG,
    at,
    inner_work,
    mixed_space,
    rectangle,
    rollers,
    strain_of,
    two_rectangles,
)
from scipy.optimize import brentq

from patchlaw import Friction, PatchGrid, ShearControl
from patchlaw.geometry import Control, RigidPlane
from patchlaw.geometry.face_frame import FaceFrame
from patchlaw.macro import ContactProblem, Interface, LawsAtPoints, compat, write_contact_stiffness
from patchlaw.support import InputError

EXACT = {"ksp_rtol": 1e-13, "snes_rtol": 1e-11}
LAW, LINE = PowerLaw(3e3), PowerLaw(400.0, power=1.0)
LEVEL = RigidPlane(approach=5e-3)
RUBS = Friction(coefficient=0.3, poisson_ratio=POISSON)


def in_series(compliance, approach=5e-3, law=LAW):
    """The pressure of a law in series with a body that gives way by so much a pressure."""
    return brentq(lambda p: float(law.pressure(np.array(approach - p * compliance))) - p, 0.0, 1e3)


def block(dimension, indenter, laws=LAW, cell="quadrilateral", degree=1, finer=1, **options):
    """A block, 2 mm long and 1 mm high, on its back, under plane strain; and that as a box."""
    upper, cells = ((2.0, 1.0), (4, 2)) if dimension == 2 else ((2.0, 1.0, 1.0), (4, 1, 2))
    mesh = rectangle((0.0,) * dimension, upper, finer * np.array(cells), cell)
    space, up = compat.vector_space(mesh, degree), dimension - 1
    sides = [(1, 0.0), (1, 1.0)] * (dimension == 3)
    u, v = fem.Function(space), ufl.TestFunction(space)
    rough = Interface(space, None, at(mesh, up, 1.0), laws=laws, indenter=indenter, **options)
    held = rollers(space, (up, 0.0), (0, 0.0), *sides)
    problem = ContactProblem(inner_work(u, v, mesh), u, held, rough, petsc_options=EXACT)
    return problem, rough


def ring(face, held, laws=LAW, indenter=LEVEL, cells=(8, 2), cell="quadrilateral", **options):
    """A ring of the radii 2 and 5 mm, 1 mm high, of quadratic elements."""
    mesh = rectangle((2.0, 0.0), (5.0, 1.0), cells, cell)
    space = compat.vector_space(mesh, 2)
    u, v = fem.Function(space), ufl.TestFunction(space)
    options |= {"laws": laws, "indenter": indenter, "axisymmetric": True}
    rough = Interface(space, None, at(mesh, *face), **options)
    inner = inner_work(u, v, mesh, turned=True)
    return ContactProblem(inner, u, rollers(space, *held), rough, petsc_options=EXACT), rough


def test_plane_strain_is_a_box_between_rollers():
    """Whose cells have one width, so that both have the same displacements, and laws are lines."""
    found, controls = [], [
        LEVEL,
        Control(force=1.0),
        RigidPlane(approach=5e-3, tilt=(2e-3, 0.0)),
        Control(force=1.0, tilt=None, moment=(0.1, 0.0)),
    ]  # fmt: skip
    for dimension, kind in ((2, "quadrilateral"), (3, "hexahedron")):
        problem, rough = block(dimension, LEVEL, LINE, kind)
        for control in controls:
            rough.indenter = control
            assert 0 < problem.solve() <= 4
            across = problem.reaction()[dimension - 1]
            assert across == pytest.approx(rough.force, rel=1e-9)
            found.append([rough.force, rough.moment[0], rough.plane.approach, rough.plane.tilt[0]])
    np.testing.assert_allclose(found[:4], found[4:], rtol=1e-9, atol=1e-12)


@pytest.mark.long
def test_points_of_edges_and_of_faces_differ_with_the_fourth_power_of_the_cells():
    """Under curved laws, whose integrals depend on where the points are."""
    apart = []
    for finer in (1, 2, 4):
        found = []
        for dimension, kind in ((2, "quadrilateral"), (3, "hexahedron")):
            problem, rough = block(dimension, Control(force=4.0, tilt=None), cell=kind, finer=finer,
                                   crown=lambda x, y: 2e-3 * (x - 0.8) ** 2)  # fmt: skip
            problem.solve()
            found.append([rough.plane.approach, rough.plane.tilt[0]])
        apart.append(abs(np.subtract(*found) / found[1]))
    apart = np.array(apart)
    assert (apart[-1] < 1e-5).all() and (apart[:-1] > 10.0 * apart[1:]).all()


@pytest.mark.parametrize(
    ("cell", "laws"), [("triangle", LAW), ("quadrilateral", [LAW] * 3)], ids=["point", "patch"]
)
def test_uniform_strain_of_a_plane_block(cell, laws):
    mode = {"patches": PatchGrid(grid=(3, 1), lengths=(2.0, 4.0))} if laws is not LAW else {}
    problem, rough = block(2, LEVEL, laws, cell, degree=2, **mode)
    problem.solve()
    plane_strain = YOUNG / (1.0 - POISSON**2)
    assert rough.force == pytest.approx(2.0 * in_series(1.0 / plane_strain), rel=1e-10)
    assert rough.fields()["pressure"].x.array.max() == pytest.approx(rough.force / 2.0, rel=1e-9)


@pytest.mark.parametrize("cells", [(4, 2), (4, 7)])
def test_opposite_faces_of_a_plane_mesh(cells):
    """Two bars with a law between them, in series, whether their nodes match or not."""
    mesh = two_rectangles(cells=cells)
    space = compat.vector_space(mesh, 1)
    u, v = fem.Function(space), ufl.TestFunction(space)
    closer = RigidPlane(approach=6e-3)  # by what they are apart, and 5 µm
    faces = at(mesh, 1, 1.0), at(mesh, 1, 1.001)
    held = rollers(space, (1, 0.0), (1, 1.501), (0, 0.0), (0, 2.0))
    for mode in ("pointwise", "patchwise"):
        rough = Interface(
            space, None, faces[0], opposite=faces[1], laws=LAW, indenter=closer, mode=mode
        )
        ContactProblem(inner_work(u, v, mesh), u, held, rough, petsc_options=EXACT).solve()
        assert rough.force == pytest.approx(2.0 * in_series(1.5 / UNIAXIAL), rel=1e-10)
        assert np.ptp(rough.pressure) < 1e-9 * rough.pressure.mean()


def test_zones_of_an_edge_are_patches_of_it():
    found, mesh = [], rectangle((0.0, 0.0), (2.0, 1.0), (4, 2))
    space, top = compat.vector_space(mesh, 1), at(mesh, 1, 1.0)
    left = dmesh.compute_midpoints(mesh, 1, top)[:, 0] < 1.0
    tags = dmesh.meshtags(mesh, 1, top, np.where(left, 1, 2).astype(np.int32))
    u, v = fem.Function(space), ufl.TestFunction(space)
    held, laws = rollers(space, (1, 0.0), (0, 0.0)), [LAW, PowerLaw(1e3)]
    patches = PatchGrid(grid=(2, 1), lengths=(2.0, 1.0))
    plane, depth = RigidPlane(approach=5e-3, tilt=(2e-3, 0.0)), lambda x, y: 1e-3 * x**2
    for face, given in (
        ((tags,), {"laws": dict(enumerate(laws, 1))}),
        ((None, top), {"laws": laws, "patches": patches, "mode": "pointwise"}),
    ):
        rough = Interface(space, *face, indenter=plane, crown=depth, **given)
        ContactProblem(inner_work(u, v, mesh), u, held, rough, petsc_options=EXACT).solve()
        found.append([*rough.patch_pressure, *rough.patch_closure, rough.force, *rough.moment])
    np.testing.assert_allclose(*found, rtol=1e-9, atol=1e-13)


def test_a_ring_under_a_plane_has_its_force_on_the_whole_circle():
    problem, rough = ring((1, 1.0), [(1, 0.0), (0, 2.0), (0, 5.0)])
    assert problem.solve() <= 4
    assert rough.force == pytest.approx(in_series(1.0 / UNIAXIAL) * np.pi * 21.0, rel=1e-10)
    assert problem.reaction()[1] == pytest.approx(rough.force, rel=1e-10)


def test_a_shaft_in_a_bore_is_lames_tube():
    """A rigid shaft presses a tube open; in its length nothing gives way."""
    inner, outer = 2.0, 5.0
    free = (1.0 - 2.0 * POISSON) * inner**2 + outer**2
    compliance = inner * (1.0 + POISSON) / YOUNG * free / (outer**2 - inner**2)
    problem, rough = ring((0, 2.0), [(1, 0.0), (1, 1.0)], cells=(16, 1))
    problem.solve()
    # quadratic elements: 3.8e-6, 2.4e-7, 1.5e-8 on 8, 16, 32 cells
    exact = in_series(compliance) * 2.0 * np.pi * inner
    assert rough.force == pytest.approx(exact, rel=3e-7)


def tangent_error(rough, x, seed):
    """How far a product with the tangent is from the difference of two residuals, over its norm."""
    rng, step = np.random.default_rng(seed), 1e-7
    way = x.duplicate()
    way.array[:] = rng.standard_normal(way.local_size)
    ends = []
    for side in (1.0, -1.0):
        moved, residual = x.copy(), x.duplicate()
        moved.axpy(side * step, way)
        rough.add_residual(moved, residual)
        ends.append(residual.array_r.copy())
    product = x.duplicate()
    rough.move_tangent(x)
    rough.add_product(way, product)
    slope = (ends[0] - ends[1]) / (2.0 * step)
    return np.linalg.norm(product.array_r - slope) / np.linalg.norm(slope)


def test_friction_of_plane_and_turned_bodies():
    """A block that is shoved slides at μ times its force, and takes the shift along x alone."""
    rubs = {"laws": RangedLaw(3e3, end=1.0), "friction": RUBS}
    press = Control(force=1.0, tilt=None, shear=ShearControl(shift=(1e-3, 0.0)))
    problem, rough = block(2, press, **rubs)
    problem.solve()
    held = problem.reaction()
    assert held[0] == pytest.approx(-rough.shear_force[0], rel=1e-8)
    rough.indenter = Control(force=1.0, shear=ShearControl(force=(0.2, 0.0)))
    problem.solve()
    assert rough.shear_force == pytest.approx([0.2, 0.0], abs=1e-10)
    assert set(rough.fields()) == {"pressure", "closure", "stiffness", "slip_x"}
    rough.indenter = Control(force=1.0, shear=ShearControl(shift=(0.1, 0.0)))
    problem.solve()
    assert rough.shear_force == pytest.approx([0.3, 0.0], rel=1e-6)  # all slips
    # a ring that is pressed spreads, and what rubs holds it back
    problem, rough = ring((1, 1.0), [(1, 0.0)], indenter=Control(force=50.0), **rubs)
    problem.solve()
    assert -15.0 < rough.shear_force[0] < -1.0
    assert tangent_error(rough, compat.petsc_vector(problem.displacement).copy(), 1) < 1e-4


def heated(dimension, mixed, indenter, mode):
    """A block whose temperature grows from its back, solved with it or known; see `block`."""
    lengths, cells = (2.0, 1.0, 1.0)[3 - dimension :], (3, 2, 2)[3 - dimension :]
    mesh = rectangle(
        (0.0,) * dimension, lengths, cells, ("quadrilateral", "tetrahedron")[dimension - 2]
    )
    up, expansion = dimension - 1, 1e-5
    if mixed:
        whole = mixed_space(mesh, (1, 1), (1, dimension))
        space, heat = whole.sub(1), whole.sub(0)
        w = fem.Function(whole)
        (temperature, u), (q, v) = ufl.split(w), ufl.TestFunctions(whole)
        conducts = ufl.inner(ufl.grad(temperature), ufl.grad(q)) * ufl.dx
        held = [
            fem.dirichletbc(
                np.float64(value), fem.locate_dofs_topological(heat, up, at(mesh, up, place)), heat
            )
            for place, value in ((0.0, 20.0), (1.0, 80.0))
        ]
    else:
        space = compat.vector_space(mesh, 1)
        w = u = fem.Function(space)
        v, held, conducts = ufl.TestFunction(space), [], 0
        temperature = 20.0 + 60.0 * ufl.SpatialCoordinate(mesh)[up]
    inner = inner_work(u, v, mesh, thermal=expansion * temperature) + conducts
    held += rollers(space, (up, 0.0), *((axis, 0.0) for axis in range(up)))
    patches = PatchGrid(grid=(2, 1), lengths=(lengths[0], 1.0))
    laws = [LAW, PowerLaw(1e3)]
    rough = Interface(
        space, None, at(mesh, up, 1.0), laws=laws, patches=patches, mode=mode, indenter=indenter,
        friction=None, crown=lambda x, y: 1e-4 * x**2,
    )  # fmt: skip
    problem = ContactProblem(inner, w, held, rough, petsc_options=EXACT)
    assert problem.solve() <= 5
    sizes = [fem.assemble_scalar(fem.form(u[k] ** 2 * ufl.dx)) for k in range(dimension)]
    return (
        rough,
        problem,
        [rough.force, *rough.moment, *rough.patch_closure, *problem.reaction(), *sizes],
    )


@pytest.mark.parametrize(
    ("dimension", "indenter", "mode"),
    [(2, Control(force=1.0, tilt=None), "pointwise"), (3, RigidPlane(approach=4e-3), "patchwise")],
)
def test_a_part_of_a_mixed_space_is_as_alone(dimension, indenter, mode):
    """Displacement and temperature in one space; the temperature is linear, exact in both."""
    rough, problem, found = heated(dimension, True, indenter, mode)
    *_, alone = heated(dimension, False, indenter, mode)
    np.testing.assert_allclose(found, alone, rtol=1e-10, atol=1e-10)
    x = compat.petsc_vector(problem.displacement).copy()
    assert tangent_error(rough, x, 2) < 1e-5  # rounding of the differences
    assert rough.fields()["closure"].x.array.max() > 0.0
    matrix = rough.stiffness_matrix(problem.displacement)
    assert matrix.getSize()[0] == x.getSize()


def incompressible_ring(cells, *held, **options):
    """A ring of Taylor and Hood's elements on rollers, under a plane."""
    mesh = rectangle((2.0, 0.0), (5.0, 1.0), cells, "triangle")
    whole = mixed_space(mesh, (2, 2), (1, 1))
    w = fem.Function(whole)
    (u, p), (v, q) = ufl.split(w), ufl.TestFunctions(whole)
    radius = ufl.SpatialCoordinate(mesh)[0]
    strain, virtual = strain_of(u, radius), strain_of(v, radius)
    work = 2.0 * SHEAR * ufl.inner(strain, virtual) - p * ufl.tr(virtual) - q * ufl.tr(strain)
    inner = 2.0 * np.pi * radius * work * ufl.dx
    space = whole.sub(0)
    options = {"laws": LAW, "indenter": LEVEL, "axisymmetric": True} | options
    rough = Interface(space, None, at(mesh, 1, 1.0), **options)
    return ContactProblem(inner, w, rollers(space, (1, 0.0), *held), rough), rough


def test_taylor_hood_of_an_incompressible_ring():
    """Which keeps its volume between rollers: nothing gives way but the law."""
    problem, rough = incompressible_ring((4, 2), (0, 2.0), (0, 5.0))
    problem.solve()
    assert rough.force == pytest.approx(in_series(0.0) * np.pi * 21.0, rel=1e-9)
    assert problem.reaction()[1] == pytest.approx(rough.force, rel=1e-7)  # Newton's tolerance


def test_steep_laws_on_taylor_hood_take_few_newton_steps():
    """Beside a step between laws pressures change over few elements, here as in other spaces."""
    laws = [Exponential(6e-3), Exponential(0.1e-3)]
    halves = PatchGrid(grid=(2, 1), lengths=(3.0, 1.0))
    problem, rough = incompressible_ring(
        (24, 8), (0, 2.0), laws=laws, patches=halves, mode="pointwise", indenter=Control(force=2e4)
    )
    assert problem.solve() <= 5
    assert problem.reaction()[1] == pytest.approx(rough.force, rel=1e-7)


@pytest.mark.parametrize(
    ("options", "problem"),
    [
        ({"indenter": Control(force=1.0, tilt=(0.0, 1e-3))}, "across a plane mesh"),
        ({"indenter": Control(force=1.0, shear=ShearControl(shift=(0.0, 1e-3))), "friction": RUBS},
         "across a plane mesh"),
        ({"patches": PatchGrid(grid=(2, 2), lengths=(2.0, 1.0)), "laws": [LAW] * 4}, "one row"),
        ({"frame": FaceFrame(origin=np.zeros(3), axes=np.eye(3)[[2, 0, 1]])}, "first axis"),
        ({"axisymmetric": True, "indenter": Control(force=1.0, tilt=None)}, "neither tilts"),
        ({"axisymmetric": True, "indenter": RigidPlane(approach=0.0, tilt=(1e-3, 0.0))}, "neither"),
    ],
)  # fmt: skip
def test_what_a_plane_mesh_does_not_know_is_refused(options, problem):
    rubs = {"laws": RangedLaw(3e3, end=1.0)} if "friction" in options else {}
    with pytest.raises(InputError, match=problem):
        block(2, **{"indenter": LEVEL, **rubs, **options})


def test_other_refusals_of_plane_and_mixed_problems(tmp_path):
    for mesh in (
        rectangle((-1.0, 0.0), (1.0, 1.0), (2, 2)),
        rectangle((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (1, 1, 1), "hexahedron"),
    ):
        top = at(mesh, mesh.topology.dim - 1, 1.0)
        with pytest.raises(InputError, match=r"axisymmetric = .* half of a section"):
            Interface(
                compat.vector_space(mesh, 1), None, top, laws=LAW, indenter=LEVEL, axisymmetric=True
            )
    whole = mixed_space(mesh, (1, 3), (1, 1))
    for space in (whole, whole.sub(1), whole.sub(0).sub(0)):
        with pytest.raises(InputError, match="space of the displacements does not fit"):
            Interface(space, None, top, laws=LAW, indenter=LEVEL)
    problem, rough = block(2, LEVEL)
    part = Interface(whole.sub(0), None, top, laws=LAW, indenter=LEVEL)
    for one in (rough, part):
        with pytest.raises(InputError, match="three dimensions"):
            LawsAtPoints(one, np.zeros((1, 1, 3)))
    stiffness = rough.stiffness_matrix(problem.displacement)
    with pytest.raises(InputError, match=r"space = .*three dimensions"):
        write_contact_stiffness(tmp_path / "face.inp", stiffness, rough.space)
    with pytest.raises(InputError, match="no leak"):
        rough.leak(1, 2, viscosity=1e-9, pressures=(1.0, 0.0))
    u = fem.Function(compat.vector_space(mesh, 1))
    inner = inner_work(u, ufl.TestFunction(u.function_space), mesh)
    with pytest.raises(InputError, match="another space"):
        ContactProblem(inner, u, [], part)


def test_edges_inside_a_plane_body_are_refused():
    """They have larger numbers than there are cells, which hid them."""
    mesh = rectangle((0.0, 0.0), (1.0, 1.0), (4, 4))
    mesh.topology.create_connectivity(1, 2)
    both = dmesh.locate_entities(mesh, 1, lambda x: np.isclose(x[1], 1.0) | np.isclose(x[1], 0.5))
    with pytest.raises(InputError, match="4 of 8 facets inside the body"):
        Interface(compat.vector_space(mesh, 1), None, both, laws=LAW, indenter=LEVEL)
