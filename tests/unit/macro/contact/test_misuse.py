"""Interfaces and problems given what they cannot use: an `InputError` before any work."""

import ctypes
from types import SimpleNamespace

import numpy as np
import pytest
from dolfinx import fem
from helpers.contact_laws import PowerLaw, RangedLaw
from helpers.plane_problems import rollers
from helpers.user_problems import (
    BOTTOM,
    LAWS,
    PATCHES,
    TOP,
    box,
    clamped,
    elastic,
    marked,
    pressed_face,
)  # fmt: skip
from petsc4py import PETSc

from patchlaw.geometry import Control, RigidPlane
from patchlaw.macro import ContactProblem, Interface, compat, contact_facets
from patchlaw.support import InputError, NotConverged

LAW, PLANE = PowerLaw(3e3), RigidPlane(approach=6e-3)


def law(pressure, stiffness=None):
    """Return what has the methods of a law."""
    return SimpleNamespace(pressure=pressure, stiffness=stiffness or pressure)


@pytest.fixture(scope="module")
def body():
    mesh = box(cells=(3, 3, 2))
    return SimpleNamespace(mesh=mesh, tags=marked(mesh), space=compat.vector_space(mesh, 1))


def interface(body, tag=TOP, **options):
    given = {"laws": LAW, "indenter": PLANE} | options
    return Interface(body.space, body.tags, tag, **given)


def mask_of(body):
    top = np.zeros(body.mesh.topology.index_map(2).size_local, dtype=bool)
    top[body.tags.find(TOP)] = True
    return top


def test_a_mask_of_facets_is_a_mask(body):
    u = fem.Function(body.space)
    found = interface(body, mask_of(body)).evaluate(u).force
    assert found == interface(body).evaluate(u).force > 0.0
    frame = interface(body).frame
    sides = [contact_facets(body.mesh, of, frame) for of in (mask_of(body), body.tags.find(TOP))]
    np.testing.assert_array_equal(sides[0].cell, sides[1].cell)


FACE = "tag = %s: must be a whole number or a text or a list"
ZONE = {"tag": None, "laws": {TOP: RangedLaw(3e3)}}
REGIONS = SimpleNamespace(patches=SimpleNamespace(names=("a", "b")), laws=(LAW, LAW))
REFUSED = [
    ({"tag": np.array([True, False])}, r"\(2,\): the mask does not fit the facets"),
    ({"tag": True}, FACE % True),
    ({"tag": np.array([0.0, 1.0])}, "facets are no numbers"),
    ({"tag": ["top"]}, FACE % r"\['top'\]"),
    ({"tag": np.array([-1])}, "-1: the facets are not in the mesh"),
    ({"tag": []}, "has no facets"),
    ({"tag": None}, "tag = None: an interface without a face"),
    ({"crown": lambda x, y: np.zeros(3)}, r"crown does not give one value for each of \d+ points"),
    ({"crown": lambda x, y: "deep"}, "the crown gives no numbers"),
    ({"crown": lambda x, y: np.ma.masked_all(x.shape)}, "the crown has depths that are not fini"),
    ({"crown": lambda x, y: np.inf * x}, "the crown has depths that are not finite"),
    ({"crown": 3.0}, "crown = 3.0: must be a function"),
    ({"crown": {}}, "crown"),
    ({"friction": {}}, "friction"),
    *((ZONE | {"friction": {TOP: given}}, "friction") for given in (None, "x", True)),
    ({"patches": (2, 2)}, "must be a PatchGrid"),
    ({"laws": LAWS[:3], "patches": PATCHES}, "every patch needs a law"),
    ({"laws": LAWS}, "laws of patches need the patches"),
    ({"laws": "laws.h5"}, "the interface has no laws"),
    ({"laws": REGIONS}, "a table of several regions"),
    ({"mode": "nodewise"}, r"mode = .* must be one of"),
    ({"indenter": 6e-3}, r"indenter = .* must be a RigidPlane or a Control"),
]
"""What an interface on the top of a box is given, and what is said of it."""


@pytest.mark.parametrize(("options", "problem"), REFUSED)
def test_what_an_interface_cannot_use_is_refused(body, options, problem):
    with pytest.raises(InputError, match=problem):
        interface(body, **options)


@pytest.mark.parametrize(
    ("wrong", "problem"),
    [
        (law(lambda c: np.zeros(3)), r"\(3,\): law 0 does not give one value for each of \d+ poi"),
        (law(lambda c: np.zeros((len(c), 1))), "law 0 does not give one value for each"),
        (law(lambda c: 0.0 * c, lambda c: [1.0, 2.0]), "law 0 does not give one value for each"),
        (law(lambda c: "stiff"), "'stiff': law 0 gives no numbers"),
        (law(lambda c: None), "law 0 gives no numbers"),
        (law(lambda c: 1j * c), "law 0 gives no numbers: not an array of real numbers"),
        (law(lambda c: np.ma.masked_all(c.shape)), "the laws give values that are not finite"),
        (law(lambda c: np.full(c.shape, np.nan)), "the laws give values that are not finite"),
    ],
)
@pytest.mark.parametrize("mode", ["pointwise", "patchwise"])
def test_laws_of_wrong_shape_are_named(body, wrong, problem, mode):
    with pytest.raises(InputError, match=problem):
        interface(body, laws=[wrong, *LAWS[1:]], patches=PATCHES, mode=mode)


def test_a_problem_has_interfaces(body):
    u = fem.Function(body.space)
    with pytest.raises(InputError, match="must be an Interface or a list"):
        ContactProblem(elastic(u), u, [clamped(body.space, body.tags)], [LAW])


@pytest.mark.parametrize("name", ["pc_tpye", "-pc_type", "patchlaw_pc_type", "pc_hypre_type"])
def test_options_that_petsc_does_not_read_are_named(body, name):
    """The last belongs to another preconditioner. The displacement stays; PETSc's table too."""
    u, support = fem.Function(body.space), clamped(body.space, body.tags)
    options = {"snes_rtol": 1e-8, "pc_factor_shift_type": "none", name: "lu"}
    problem = ContactProblem(elastic(u), u, [support], interface(body), petsc_options=options)
    with pytest.raises(InputError, match=rf"petsc_options = \['{name}'\]: .*no such option"):
        problem.solve()
    assert not u.x.array.any()
    assert not [key for key in PETSc.Options().getAll() if key.startswith("patchlaw_")]


@pytest.mark.long
@pytest.mark.parametrize("mode", ["pointwise", "patchwise"])
@pytest.mark.parametrize("options", [
    {"ksp_type": "preonly", "pc_type": "lu"},
    {"ksp_type": "preonly", "pc_type": "cholesky", "pc_factor_mat_solver_type": "mumps"},
    {"ksp_type": "preonly", "pc_type": "lu", "pc_factor_mat_solver_type": "superlu_dist"},
    {"ksp_type": "gmres", "pc_type": "ilu", "pc_factor_mat_solver_type": "petsc"},
], ids=str)  # fmt: skip
def test_direct_solvers_do_not_change_forces(body, mode, options):
    """On a law ten times as stiff as the body, where steps without contact in them diverge."""
    forces = []
    for given in (None, options):
        face = {"laws": [PowerLaw(3e6)] * 4, "patches": PATCHES, "mode": mode, "indenter": PLANE}
        solver = {"petsc_options": given}
        rough, problem = pressed_face(body.space, body.tags, solver=solver, **face)
        problem.solve()
        rough.indenter = Control(force=5.0, tilt=None)
        forces.append([rough.force, *rough.patch_pressure])
    # Newton's method ends at 1e-9 of the contact forces
    np.testing.assert_allclose(forces[1], forces[0], rtol=1e-8)


@pytest.mark.parametrize("degree", [1, 2])
def test_no_force_is_the_last_touch_of_the_deformed_body(degree):
    """A body that grows by a uniform strain: its face rises by the strain times its height."""
    random = np.random.default_rng(28)
    strain, touch = random.uniform(-1e-3, 1e-3), random.uniform(-1e-3, 1e-3)
    mesh = box(cells=(3, 4, 2))
    space, unloaded = compat.vector_space(mesh, degree), Control(force=0.0)
    rough, problem = pressed_face(
        space, marked(mesh), laws=PowerLaw(3e3, touch=touch), indenter=unloaded,
        work=lambda u: elastic(u, thermal=strain), held=rollers(space, (0, 0.0), (1, 0.0), (2, -1)),
    )  # fmt: skip
    for loaded in (False, True):
        if loaded:  # and unloaded again
            rough.indenter = Control(force=7.0)
            problem.solve()
            assert rough.force == pytest.approx(7.0, rel=1e-9)
            rough.indenter = unloaded
        problem.solve()
        assert rough.force == 0.0
        # the linear solver's tolerance
        assert rough.plane.approach == pytest.approx(touch - strain, abs=1e-9 * abs(strain))


def test_laws_that_never_let_go_have_no_last_touch(body):
    sticky = law(lambda c: 1.0 + 0.0 * c, lambda c: 0.0 * c)
    rough = interface(body, laws=sticky, indenter=Control(force=0.0))
    with pytest.raises(NotConverged, match=r"NO_RELEASE .* press however far"):
        rough.evaluate(fem.Function(body.space))


class Heap(ctypes.Structure):
    """What glibc's ``mallinfo2`` returns (malloc.h, from 2.33 on)."""

    _fields_ = [
        (name, ctypes.c_size_t)
        for name in "arena ordblks smblks hblks hblkhd usmblks fsmblks used free keepcost".split()
    ]


def allocated():
    """Return the memory that this process has allocated and not freed [B], without gaps between."""
    mallinfo = ctypes.CDLL(None).mallinfo2
    mallinfo.restype = Heap
    heap = mallinfo()
    return heap.used + heap.hblkhd


@pytest.mark.long
def test_a_hundred_of_everything_leave_no_memory_behind():
    """A vector of the space has 24 kB, its matrix 1.4 MB, its factors 10 MB."""
    mesh = box(cells=(9, 9, 9))
    space, tags = compat.vector_space(mesh, 1), marked(mesh)
    support, u = clamped(space, tags), fem.Function(space)
    body = SimpleNamespace(mesh=mesh, tags=tags, space=space)
    rough = interface(body, bcs=[support])
    matrix = compat.assemble_matrix(compat.compile_form(_derivative(u)), [support])
    x, y = matrix.createVecs()
    kept = ContactProblem(elastic(u), u, [support], rough)
    rough.move_tangent(u)

    def solve():
        rough.indenter = RigidPlane(approach=np.random.default_rng().uniform(4e-3, 6e-3))
        kept.solve()

    def made_anew():
        fresh = fem.Function(space)
        ContactProblem(elastic(fresh), fresh, [support], interface(body)).solve()

    vector = 2.4e4  # bytes
    works = {  # what is done, how often, and what each may leave, such as forms
        "add_product": (lambda: rough.add_product(x, y), 1000, 0.05 * vector),
        "tangent": (lambda: rough.tangent(matrix).mult(x, y), 100, 0.1 * vector),
        "add_tangent": (lambda: rough.add_tangent(u, matrix), 100, 0.1 * vector),
        "constrain": (lambda: rough.constrain([support]), 100, 0.1 * vector),
        "evaluate": (lambda: rough.evaluate(u), 100, 0.1 * vector),
        "solve": (solve, 100, 0.1 * vector),
        "Interface": (lambda: interface(body), 60, 0.1 * vector),
        "ContactProblem": (made_anew, 16, 3.5 * vector),  # of its factors' 10 MB
    }
    for name, (work, count, most) in works.items():
        for _ in range(max(count // 5, 5)):
            work()
        left = [_left_behind(work, -(-count // 4)) for _ in range(4)]
        assert min(left) < most, name  # a leak grows every time


def _left_behind(work, count):
    """Return the memory [B] that one call of `work` leaves behind, the mean of `count`."""
    before = allocated()
    for _ in range(count):
        work()
    return (allocated() - before) / count


def _derivative(u):
    import ufl

    return ufl.derivative(elastic(u), u)


def test_tags_of_both_faces_at_once_are_no_face(body):
    both = np.concatenate([body.tags.find(TOP), body.tags.find(BOTTOM)])
    with pytest.raises(InputError, match="face different ways"):
        interface(body, both)


def test_numbers_of_numpy_are_numbers_of_faces(body):
    u, here = fem.Function(body.space), np.int32(TOP)
    expected = interface(body).evaluate(u).force
    for tag in (here, np.array(TOP)):
        assert interface(body, tag).evaluate(u).force == expected > 0.0
    zone = interface(body, None, laws={here: LAW}, crown={here: lambda x, y: 0.0 * x})
    assert zone.evaluate(u).force == pytest.approx(expected, rel=1e-12)
    with pytest.raises(InputError, match=r"opposite = .*not parallel"):
        interface(body, opposite=np.int64(TOP))
    with pytest.raises(InputError, match="the mask does not fit"):
        interface(body, None, laws={True: LAW})


def test_friction_of_zones_takes_numbers_of_numpy(body):
    class Tangential(RangedLaw):
        stiffness_ratio = 1.2

    laws, given = {TOP: Tangential(3e3)}, {TOP: np.float32(0.25)}
    found = interface(body, None, laws=laws, friction=given)
    assert (found.forces.sliders.coefficient == 0.25).all()


def test_a_crown_of_zones_is_no_crown_of_the_face(body):
    zone = interface(body, None, laws={TOP: LAW}, crown={TOP: lambda x, y: 0.0 * x})
    with pytest.raises(InputError, match="crown"):
        zone.crown_at(np.zeros(2), np.zeros(2))


@pytest.mark.parametrize("sliding", [(0.3,), (0.3, 0.0, 0.0), 0.3, (np.nan, 0.0)])
def test_a_direction_of_sliding_has_two_numbers(body, sliding):
    with pytest.raises(InputError, match="sliding"):
        interface(body).stiffness_matrix(fem.Function(body.space), sliding=sliding)
