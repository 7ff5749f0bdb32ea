"""Natural modes about a loaded state against closed forms, and against CalculiX."""

import numpy as np
import pytest
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from helpers import body_meshes, calculix
from helpers.block_cases import block_of, interface_of
from helpers.contact_laws import PowerLaw, RangedLaw, Spring
from helpers.faces import tagged
from helpers.plane_problems import rollers
from helpers.user_problems import (
    BOTTOM,
    HEXAHEDRA,
    PATCHES,
    TOP,
    box,
    clamped,
    elastic,
    marked,
    pressed_face,
)  # fmt: skip
from petsc4py import PETSc
from scipy.io import mmread
from scipy.linalg import block_diag, cholesky, eig, eigh, eigvals, eigvalsh, solve_triangular
from scipy.optimize import brentq
from scipy.spatial import KDTree

from patchlaw.geometry import Control, Friction, PatchGrid, RigidPlane
from patchlaw.macro import (
    FacePair,
    Interface,
    LawContactProblem,
    Material,
    MeshedBody,
    Support,
    TaggedMesh,
    compat,
    natural_modes,
    write_contact_stiffness,
)
from patchlaw.macro.contact import face_vibration
from patchlaw.macro.contact.contact_forces import face_springs
from patchlaw.macro.contact.face_vibration import FaceVibration, mass_matrix
from patchlaw.support import InputError, NotConverged

YOUNG, DENSITY = 4000.0, 1.3e-9
SPEED = np.sqrt(YOUNG / DENSITY)


def matrices(space, poisson=0.0):
    """Stiffness and mass as users assemble them, conditions left out."""
    u, v, w = fem.Function(space), ufl.TestFunction(space), ufl.TrialFunction(space)
    forms = ufl.derivative(elastic(u, YOUNG, poisson), u), DENSITY * ufl.inner(v, w) * ufl.dx
    return (compat.assemble_matrix(compat.compile_form(one), []) for one in forms)


def with_contact(stiffness, contact):
    whole = stiffness.copy()
    whole.axpy(1.0, contact, PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN)
    return whole


def held(space, axis, where):
    """Hold a displacement at the nodes of a place."""
    part = space.sub(axis), space.sub(axis).collapse()[0]
    nodes = fem.locate_dofs_geometrical(part, where)
    return fem.dirichletbc(fem.Function(part[1]), nodes, part[0])


def on_plane(mesh, law, degree=1, approach=1e-3, **more):
    """A box's top under a plane, by a law; the space and the facets' tags."""
    x = mesh.geometry.x
    lengths = *x[:, :2].max(axis=0), -x[:, 2].min()
    tags, space = marked(mesh, lengths), compat.vector_space(mesh, degree)
    plane = RigidPlane(approach=approach)
    return Interface(space, tags, TOP, laws=law, **{"indenter": plane} | more), space, tags


def test_bar_on_a_law_vibrates_as_in_closed_form():
    draw = np.random.default_rng(51)
    length, side, approach = draw.uniform([3.0, 0.3, 1e-3], [5.0, 0.7, 4e-3])
    law = PowerLaw(draw.uniform(2e4, 4e4), power=draw.uniform(1.4, 1.6))
    mesh = box(cells=(1, 1, 56), cell=HEXAHEDRA, lengths=(side, side, length))
    rough, space, tags = on_plane(mesh, law, 2, approach)
    across = [(axis, place) for axis in (0, 1) for place in (0.0, side)]
    bcs = [clamped(space, tags), *rollers(space, *across)]
    stiffness, mass = matrices(space)
    contact = rough.stiffness_matrix(fem.Function(space))
    found = natural_modes(with_contact(stiffness, contact), mass, 3, bcs=bcs)

    def off(slope):
        """Frequencies over those of u = sin βz from the clamp on: E β cos βL = −k sin βL."""
        roots = [
            brentq(
                lambda beta: YOUNG * beta * np.cos(beta * length) + slope * np.sin(beta * length),
                (n + 0.5) * np.pi / length,
                (n + 1.0) * np.pi / length,
                xtol=1e-14,
            )
            for n in range(3)
        ]
        return abs(2.0 * np.pi * found.frequencies / (SPEED * np.array(roots)) - 1.0)

    slope = law.power * law.k * approach ** (law.power - 1.0)
    # quadratic elements err by (β h)⁴/1440: 2e-9, 4e-8, 3e-7 of the frequency
    assert (off(slope) < 5e-7).all() and off(slope)[0] < 5e-9
    assert off(1.00001 * slope).max() > 5e-7
    assert not found.damping.any() and found.residuals.max() < 1e-8


def test_beam_on_springs_heaves_and_pitches_as_a_rigid_body_and_bends_by_a_shift():
    lengths, law = (24.0, 1.0, 1.5), 0.02
    mesh = box(cells=(24, 1, 2), cell=HEXAHEDRA, lengths=lengths)
    rough, space, _ = on_plane(mesh, Spring(law), 2)
    plane = rollers(space, (1, 0.0), (1, 1.0))
    stiffness, mass = matrices(space)
    whole = with_contact(stiffness, rough.stiffness_matrix(fem.Function(space)))
    alone, found = (natural_modes(one, mass, 5, bcs=plane) for one in (stiffness, whole))
    assert alone.frequencies[:3] == pytest.approx([0.0, 0.0, 0.0], abs=1e-9)
    heave = law / (DENSITY * lengths[2])
    pitch = heave * lengths[0] ** 2 / (lengths[0] ** 2 + lengths[2] ** 2)
    squares = (2.0 * np.pi * found.frequencies) ** 2
    # the beam is not quite rigid: its first bending mode is 1e3 times as stiff
    assert squares[:3] == pytest.approx([0.0, pitch, heave], rel=2e-3)
    # a bending mode w gains k/(ρ h); cross-sections turn: less by their share of the inertia
    before = (2.0 * np.pi * alone.frequencies[3:]) ** 2
    turning = (np.array([4.73, 7.853]) * lengths[2] / lengths[0]) ** 2 / 12.0
    assert squares[3:] - before == pytest.approx(heave / (1.0 + turning), rel=3e-2)


def test_free_body_has_six_rigid_motions_and_none_of_them_grows():
    space = compat.vector_space(box(), 1)
    stiffness, mass = matrices(space, 0.3)
    found = natural_modes(stiffness, mass, 8)
    assert not found.frequencies[:6].any() and not found.damping.any()
    assert found.frequencies[6] > 1e5
    with pytest.raises(InputError, match="there are not as many modes"):
        natural_modes(stiffness, mass, 10_000)


def test_free_cube_has_its_modes_as_often_as_its_symmetry_says():
    """Beside rigid motions a shifted matrix loses half of its digits; the modes must not."""
    space = compat.vector_space(box(cells=(2, 2, 2), cell=HEXAHEDRA), 1)
    found = natural_modes(*matrices(space, 0.3), 23).frequencies
    for start, size in ((6, 2), (8, 3), (11, 5), (16, 3), (19, 3), (22, 1)):
        # rounding of the stiffness, whose largest eigenvalue is 40 times the first one here
        assert np.ptp(found[start : start + size]) < 1e-12 * found[start]
        assert found[start] > 1.01 * found[start - 1]


def test_no_mode_of_a_symmetric_cube_is_left_out():
    """One vector leads to no second mode of a pair: Krylov's methods leave some out, by chance."""
    space = compat.vector_space(box(cells=(3, 3, 3), cell=HEXAHEDRA), 1)
    pair = [*matrices(space, 0.3)]
    nodes = fem.locate_dofs_geometrical(space, lambda x: x[2] < -0.99)
    bcs = [fem.dirichletbc(np.zeros(3), nodes, space)]
    free = np.setdiff1d(np.arange(3 * 64), (3 * nodes[:, None] + np.arange(3)).ravel())
    whole = [one.convert("dense", PETSc.Mat()).getDenseArray()[np.ix_(free, free)] for one in pair]
    squares = eigh(*whole, eigvals_only=True)
    for count in (11, 23):
        found = natural_modes(*pair, count, bcs=bcs).frequencies
        assert found == pytest.approx(np.sqrt(squares[:count]) / (2.0 * np.pi), rel=1e-10)


@pytest.mark.parametrize("seed", range(3))
def test_slender_bodies_under_a_face_that_slides_vibrate_as_dense_matrices(seed):
    """Their lowest squares are 1e-9 of the largest, and mere accuracy of shapes leaves 2e-5."""
    draw = np.random.default_rng(seed)
    lengths = (*draw.uniform(0.1, 0.3, 2), draw.uniform(7.0, 8.0))
    mesh = box(cells=(2, 1, 2), lengths=lengths)
    patch = PatchGrid(grid=(1, 1), lengths=lengths[:2])
    more = {"mode": "patchwise", "patches": patch}
    rough, space, tags = on_plane(mesh, Spring(draw.uniform(0.1, 10.0)), 2, **more)
    stiffness, mass = matrices(space, 0.3)
    sliding = tuple(draw.uniform(0.1, 1.0, 2))
    contact = rough.stiffness_matrix(fem.Function(space), sliding=sliding)
    stiffness.axpy(1.0, contact, PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN)
    found = natural_modes(stiffness, mass, 8, bcs=[clamped(space, tags)])
    nodes = fem.locate_dofs_topological(space, 2, tags.find(BOTTOM))
    free = np.setdiff1d(np.arange(stiffness.size[0]), (3 * nodes[:, None] + [0, 1, 2]).ravel())
    whole = (one.convert("dense", PETSc.Mat()).getDenseArray() for one in (stiffness, mass))
    squares = np.sort(eig(*(one[np.ix_(free, free)] for one in whole), right=False).real)
    # rounding of the dense matrices is 1e-16 of squares 1e9 times as large
    assert found.frequencies == pytest.approx(np.sqrt(squares[:8]) / (2.0 * np.pi), rel=1e-6)
    assert found.residuals.max() < 1e-5


def assembled(*arrays):
    return [PETSc.Mat().createDense(one.shape, array=one).convert("aij") for one in arrays]


def turned(whole, draw):
    """K = Q A Qᵀ with a drawn Q, and M = 1."""
    turn = np.linalg.qr(draw.standard_normal(whole.shape))[0]
    return assembled(turn @ whole @ turn.T, np.eye(len(whole)))


def test_modes_that_are_repeated_beside_rigid_motions_are_all_found():
    """A correction raises rigid motions by 1e8, beside which half of nine copies got lost."""
    draw = np.random.default_rng(164)
    squares = np.repeat([0.0, 1.0, 2.0, 3.0], [3, 9, 9, 3]) * draw.uniform(0.5, 2.0)
    found = natural_modes(*turned(np.diag(squares), draw), 9)
    assert found.eigenvalues.imag**2 == pytest.approx(squares[:12], rel=1e-12)  # all nine copies


@pytest.mark.parametrize("seed", range(4))
def test_modes_that_just_merge_are_found_with_nearly_all_others(seed):
    """The shapes of a, c under couplings b to and −b fro are parallel at b = |a − c|/2."""
    draw = np.random.default_rng(seed)
    pairs, share = draw.uniform(1.0, 100.0, (8, 2)), np.where(np.arange(8) < 3, 0.5, 0.3)
    couplings = share * abs(pairs[:, 0] - pairs[:, 1])
    blocks = [[[a, b], [-b, c]] for (a, c), b in zip(pairs, couplings, strict=True)]
    found = natural_modes(*turned(block_diag(*blocks), draw), 15)
    apart = np.sqrt(0.25 - share**2) * abs(pairs[:, 0] - pairs[:, 1])
    squares = np.sort((pairs.mean(axis=1) + np.array([[-1.0], [1.0]]) * apart).ravel())
    count = len(found.frequencies)  # a pair of rounding comes as a whole
    assert count in (15, 16)
    # what just merges is known to the root of rounding
    assert np.sort(-(found.eigenvalues**2).real) == pytest.approx(squares[:count], rel=1e-6)


def test_modes_about_to_merge_have_no_damping_of_rounding():
    """A defective pair splits by the root of rounding, along λ or across, by chance."""
    draw = np.random.default_rng(77)
    squares = np.sort(draw.uniform(1e10, 1e12, 9))
    blocks = [[[a, draw.uniform(0.1, 1.0) * a], [0.0, a]] for a in squares]
    found = natural_modes(*turned(block_diag(*blocks), draw), 6)
    # the root of rounding: 9e-9 in the median of sixty draws, 2e-7 at most
    assert not found.damping.any() and found.residuals.max() < 1e-6
    expected = np.repeat(np.sqrt(squares[:3]), 2)
    assert found.eigenvalues.imag == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("light", [0.0, 1e-10, 1e-12])
def test_unknowns_without_a_mass_follow_the_others(light):
    draw = np.random.default_rng(30)
    stiff = np.diag(draw.uniform(0.1, 10.0, 25)) + np.ones((25, 25))
    mass = np.diag(np.where(np.arange(25) % 3 > 0, 1.0, light))
    found = natural_modes(*assembled(stiff, mass), 14)
    squares = 1.0 / eigh(mass, stiff, eigvals_only=True)[::-1][:14]
    assert found.frequencies == pytest.approx(np.sqrt(squares) / (2.0 * np.pi), rel=1e-8)
    if not light:
        with pytest.raises(InputError, match="there are not as many modes"):
            natural_modes(*assembled(stiff, mass), 18)


def test_what_has_no_modes_is_refused():
    spaces = [compat.vector_space(box(cells=(n, 1, 1)), 1) for n in (1, 2)]
    (stiffness, mass), (_, other) = map(matrices, spaces)
    with pytest.raises(InputError, match="not of one size"):
        natural_modes(stiffness, other, 2)
    loose = PETSc.Mat().createAIJ(mass.getSize(), comm=PETSc.COMM_SELF)
    with pytest.raises(InputError, match="not assembled"):
        natural_modes(stiffness, loose, 2)
    mass.setValue(0, 3, DENSITY)
    mass.assemble()
    with pytest.raises(InputError, match="the mass is not symmetric"):
        natural_modes(stiffness, mass, 2)


@pytest.mark.parametrize("scale", [0.0, np.nan])
def test_a_preconditioner_that_finds_nothing_is_told(scale):
    class Fails:
        def apply(self, _owner, _x, y):
            y.set(scale)

    space = compat.vector_space(box(), 1)  # matrices need its communicator
    with pytest.raises(NotConverged, match="returns zeros, or what is no number"):
        natural_modes(*matrices(space), 2, preconditioner=Fails())


def test_mass_of_the_plane_adds_to_the_bar():
    """One element of a bar is a spring and masses; the plane's on the law's springs beside it."""
    law, plane = 900.0, 3e-9
    face = interface_of(block_of("roller", YOUNG, 0.0, density=DENSITY, cells=(1, 1, 1)), (1, 1))
    problem = LawContactProblem(face, [Spring(law)], "pointwise")
    state = problem.solve(Control(approach=1e-3))
    tangents = problem.forces.vibration_tangents(state)
    found, shares, _ = FaceVibration(face, "pointwise", plane).modes(tangents, 2)
    # rollers leave four nodes that move down alike, and modes that warp the top: ν = 0
    stiffness = np.array([[YOUNG + law, -law], [-law, law]])
    mass = np.diag([DENSITY / 3.0, plane])
    low = np.linalg.eigvals(np.linalg.solve(mass, stiffness)).min()
    assert found.frequencies[0] == pytest.approx(np.sqrt(low) / (2.0 * np.pi), rel=1e-10)
    assert 0.0 < shares[0] < 1.0


@pytest.mark.parametrize("factorised", [10_000, 0])
@pytest.mark.parametrize("friction", [None, 0.37])
def test_a_heavy_plane_on_a_soft_law_swings_far_below_all_other_modes(friction, factorised):
    """Its square is 1e-17 of the largest, which was once taken for zero."""
    draw = np.random.default_rng(7)
    law, plane = draw.uniform(0.5, 2.0) * np.array([1e-3, 1.0])
    block = block_of("roller", YOUNG, 0.0, density=DENSITY, cells=(3, 2, 4))
    (width, depth), height = block.mesh.shape.interface, block.mesh.shape.height
    face = interface_of(block, (1, 1))
    problem = LawContactProblem(face, [Spring(law)], "pointwise")
    along = None if friction is None else np.array([friction, 0.1])
    state = problem.solve(Control(approach=1e-3))
    tangents = problem.forces.vibration_tangents(state, along)
    found, shares, _ = FaceVibration(face, "pointwise", plane, factorised).modes(tangents, 3)
    series = width * depth / (1.0 / law + height / YOUNG)
    expected = np.sqrt(series / plane) / (2.0 * np.pi)
    # the block's mass is 1e-9 of the plane's
    assert found.frequencies[0] == pytest.approx(expected, rel=2e-9)
    assert found.frequencies[1] > 1e6 * expected and not found.damping.any()
    assert shares[0] == pytest.approx(1.0, abs=1e-5)


def test_slepc_finds_the_same_modes_of_a_face_that_slides():
    SLEPc = pytest.importorskip("slepc4py.SLEPc")
    mesh = box(cells=(3, 2, 2), cell=HEXAHEDRA)
    rough, space, _ = on_plane(mesh, Spring(3e4))
    stiffness, mass = matrices(space, 0.3)
    contact = rough.stiffness_matrix(fem.Function(space), sliding=(1.0, 0.5))
    whole = with_contact(stiffness, contact)
    whole.axpy(1e11, mass)  # as a bed below, on which the free cube has no rigid motions
    found = natural_modes(whole, mass, 8)
    solver = SLEPc.EPS().create(PETSc.COMM_SELF)
    solver.setOperators(whole, mass)
    solver.setProblemType(SLEPc.EPS.ProblemType.GNHEP)
    solver.setDimensions(len(found.frequencies), 60)
    solver.setTarget(0.0)
    solver.setWhichEigenpairs(SLEPc.EPS.Which.TARGET_MAGNITUDE)
    solver.getST().setType("sinvert")
    solver.setTolerances(1e-13)
    solver.solve()
    squares = [solver.getEigenvalue(k) for k in range(len(found.frequencies))]
    values = np.sqrt(-np.array(squares, complex))
    values = np.where(values.imag < 0.0, -values, values)
    expected = values[np.lexsort((-values.real, values.imag))]
    # modes are accurate to 1e-10, and eigenvalues of a matrix that is not symmetric no further
    assert found.eigenvalues == pytest.approx(expected, rel=1e-9)
    assert found.damping.min() < -1e5 and 0.0 < found.frequencies.min()  # two have merged


def face_and_tangents(friction):
    """Return the face of a block under one linear law, and the stiffnesses of its samples."""
    block = block_of(young_modulus=YOUNG, poisson_ratio=0.3, density=DENSITY, cells=(5, 4, 3))
    face, law = interface_of(block, (1, 1)), Spring(0.0 if friction is None else 9e4)
    forces = LawContactProblem(face, [law], "pointwise").forces
    closure = np.full(len(forces.sampling.weight), 1e-3)
    along = None if friction is None else np.array([friction, 0.0])
    return face, forces.vibration_tangents(forces.state(closure), along)


@pytest.mark.parametrize("friction", [None, 0.7, pytest.param(0.0, marks=pytest.mark.long)])
def test_modes_by_multigrid_are_those_by_factors(friction):
    """Without friction the plane is out of contact."""
    face, tangents = face_and_tangents(friction)
    (one, share, _), (other, same, _) = (
        FaceVibration(face, "pointwise", 3e-9, most).modes(tangents, 8) for most in (10_000, 0)
    )
    # modes are accurate to 1e-10, and eigenvalues of a matrix that is not symmetric no further
    size = abs(one.eigenvalues).max()
    assert other.eigenvalues == pytest.approx(one.eigenvalues, rel=1e-9, abs=1e-9 * size)
    assert same == pytest.approx(share, rel=1e-8, abs=1e-8)
    assert (one.frequencies[0] == 0.0) == (friction is None)
    assert (one.damping.min() < 0.0) == (friction == 0.7)


@pytest.mark.long
@pytest.mark.parametrize("friction", [0.0, 0.7])
def test_modes_start_from_those_at_the_load_before(monkeypatch, friction):
    face, tangents = face_and_tangents(friction)
    cycles, made = [], face_vibration.corrections

    def counted(solver):
        cycle = made(solver)

        def result(columns):
            cycles.extend(columns.T)
            return cycle(columns)

        return result

    monkeypatch.setattr(face_vibration, "corrections", counted)
    vibration, found = FaceVibration(face, "pointwise", None, 0), []
    vibration.modes(0.98 * tangents, 8)
    for one in (vibration, FaceVibration(face, "pointwise", None, 0)):
        cycles.clear()
        found.append((one.modes(tangents, 8)[0].eigenvalues, len(cycles)))
    (near, fewer), (afresh, usual) = found
    size = abs(afresh).max()  # accurate as above
    assert near == pytest.approx(afresh, rel=1e-9, abs=1e-9 * size)
    assert fewer < 0.8 * usual


@pytest.mark.slow
@pytest.mark.parametrize(
    ("cells", "friction", "plane"), [((14, 10, 8), None, 1e-9), ((12, 10, 7), (0.9, 0.4), None)]
)
def test_modes_of_thousands_of_unknowns_are_those_of_dense_matrices(cells, friction, plane):
    """Of 3961 unknowns with a plane that moves, and of 3003 of which six modes grow."""
    draw = np.random.default_rng(51)
    height = draw.uniform(0.4, 0.8)
    block = block_of("free", YOUNG, 0.3, density=DENSITY, cells=cells, height=height)
    laws = [PowerLaw(k, power=1.5) for k in draw.uniform(1e4, 8e5, 4)]
    face = interface_of(block, (2, 2))
    problem = LawContactProblem(face, laws, "pointwise")
    state = problem.solve(Control(approach=5e-3))
    along = None if friction is None else np.array(friction)
    tangents = problem.forces.vibration_tangents(state, along)
    vibration = FaceVibration(face, "pointwise", plane, 0)  # by multigrid
    found, *_ = vibration.modes(tangents, 25)
    springs = face_springs(face, "pointwise", tangents, plane is not None)
    bodies = vibration._stiffness.copy()
    bodies.axpy(1.0, springs, PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN)
    free = np.flatnonzero(vibration._free.array_r)
    stiffness, mass = (
        one.convert("dense", PETSc.Mat()).getDenseArray()[np.ix_(free, free)]
        for one in (bodies, vibration.mass)
    )
    lower = cholesky(mass, lower=True)
    half = solve_triangular(lower, stiffness, lower=True)
    whole = solve_triangular(lower, half.T, lower=True).T
    squares = eigvalsh(whole) if friction is None else eigvals(whole, overwrite_a=True)
    squares = squares[np.argsort(abs(squares))][: len(found.eigenvalues)]
    apart = abs(-(found.eigenvalues[:, None] ** 2) - squares)
    apart = np.minimum(apart, abs(-(found.eigenvalues[:, None].conj() ** 2) - squares))
    # rounding of the dense matrices, whose largest squares are 1e3 times these
    assert (apart.min(axis=0) < 1e-10 * abs(squares)).all()
    assert (apart.min(axis=1) < 1e-10 * abs(squares).max()).all()
    assert (found.damping.min() < 0.0) == (friction is not None)


@pytest.mark.parametrize("factorised", [10_000, 0])
@pytest.mark.parametrize("mode", ["pointwise", pytest.param("patchwise", marks=pytest.mark.long)])
def test_two_mirrored_bodies_vibrate_as_one_on_twice_the_law(mode, factorised):
    """Modes are alike in both, and the law is halved, or opposite, and contacts slip alone."""
    draw = np.random.default_rng(5)
    material = Material(young_modulus=YOUNG, poisson_ratio=0.3, density=DENSITY)
    meshes = (body_meshes.box((0, 0, z), (1, 1, z + 1), (2, 3, 2)) for z in (-1, 0))
    one = body_meshes.standing(next(meshes), material, PATCHES)
    both = FacePair(one, body_meshes.hanging(next(meshes), material, PATCHES))

    def frequencies(face, *stiffness):
        weight = face.sampling(mode).weight
        tangents = np.ones((len(weight), 1, 1)) * np.diag(stiffness)
        return FaceVibration(face, mode, None, factorised).modes(tangents, 8)[0].frequencies

    normal, along = draw.uniform(5e3, 3e4, 2)
    halves = frequencies(one, 2 * normal, 0, 0), frequencies(one, 0, 2 * along, 2 * along)
    found = frequencies(both, normal, along, along)
    assert found == pytest.approx(np.sort(np.concatenate(halves))[:8], rel=1e-12)


def test_masses_are_those_of_the_volumes():
    mesh = box(cells=(2, 3, 4))
    tags, cells = marked(mesh), np.arange(mesh.topology.index_map(3).size_local, dtype=np.int32)
    above = dmesh.compute_midpoints(mesh, 3, cells)[:, 2] > -0.5
    volumes = dmesh.meshtags(mesh, 3, cells, np.where(above, 1, 2).astype(np.int32))
    whole = TaggedMesh(mesh=mesh, facet_tags=tags, cell_tags=volumes)
    elastic_constants = {"young_modulus": YOUNG, "poisson_ratio": 0.3}
    materials = {tag: Material(density=tag * DENSITY, **elastic_constants) for tag in (1, 2)}
    for order in (1, 2):
        body = MeshedBody(whole, materials, [Support(tag=BOTTOM)], order=order)
        assert total(mass_matrix(body)) / 3.0 == pytest.approx(1.5 * DENSITY, rel=1e-12)


@pytest.mark.parametrize("friction", [0.2, 1.04, 1.06, 2.5])
def test_two_degrees_of_freedom_flutter_through_one_patch_as_in_closed_form(friction):
    """A corner of one cube moves along x and z, all else is held: its matrices are integrals."""
    side, poisson, law = 0.7, 0.3, 2e4
    lengths = (side, side, side)
    mesh = box(cells=(1, 1, 1), cell=HEXAHEDRA, lengths=lengths)
    patch = PatchGrid(grid=(1, 1), lengths=(side, side))
    rough, space, _ = on_plane(mesh, Spring(law), patches=patch, mode="patchwise")
    corner = np.array([side, side, 0.0])
    bcs = [held(space, axis, lambda x: ~np.isclose(x.T, corner).all(axis=1)) for axis in (0, 2)] + [
        held(space, 1, lambda x: np.ones(x.shape[1], bool))
    ]
    stiffness, mass = matrices(space, poisson)
    contact = rough.stiffness_matrix(fem.Function(space), sliding=(friction, 0.0))
    whole = stiffness.copy()
    whole.axpy(1.0, contact, PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN)
    found = natural_modes(whole, mass, 2, bcs=bcs)
    lame = YOUNG * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson))
    shear = YOUNG / (2.0 * (1.0 + poisson))
    alone, both = side / 9.0, side / 12.0  # ∫ N,x² and ∫ N,x N,z of the corner
    small = np.array(
        [
            [(lame + 4.0 * shear) * alone, (lame + shear) * both],
            [(lame + shear) * both, (lame + 4.0 * shear) * alone],
        ]
    )
    small[1, 1] += law * side**2 / 16.0  # the patch closes by a quarter of what the corner moves
    small[0, 1] -= friction * law * side**2 / 16.0
    squares = np.linalg.eigvals(small).astype(complex) / (DENSITY * side**3 / 27.0)
    values = np.sqrt(-squares)
    values = np.where(values.imag < 0.0, -values, values)
    expected = values[np.lexsort((-values.real, values.imag.round()))]
    assert found.eigenvalues == pytest.approx(expected, rel=1e-8)
    # the square root of the discriminant, which nears 0 where modes merge, loses half the digits
    merges = (small[0, 0] - small[1, 1]) ** 2 < -4.0 * small[0, 1] * small[1, 0]
    assert merges == (friction > 1.05)
    assert (found.damping[0] < 0.0 < found.damping[1]) == merges
    assert found.residuals.max() < 1e-10


@pytest.mark.long
@pytest.mark.skipif(calculix.PROGRAM is None, reason="CalculiX is not installed")
@pytest.mark.parametrize("sticks", [False, True])
def test_calculix_finds_our_frequencies_with_our_springs(tmp_path, sticks):
    poisson = 0.3
    mesh = box(cells=(4, 3, 3), cell=HEXAHEDRA)
    tags, space = marked(mesh), compat.vector_space(mesh, 1)
    bcs = [clamped(space, tags)]
    rough, problem = pressed_face(
        space, tags, laws=RangedLaw(3e4), indenter=RigidPlane(approach=8e-3, tilt=(2e-3, -1e-3)),
        friction=Friction(coefficient=0.3, poisson_ratio=poisson) if sticks else None,
        held=bcs, work=lambda u: elastic(u, YOUNG, poisson),
    )  # fmt: skip
    problem.solve()
    stiffness, mass = matrices(space, poisson)
    contact = rough.stiffness_matrix(problem.displacement)
    found = natural_modes(with_contact(stiffness, contact), mass, 6, bcs=bcs)
    for ending in ("inp", "mtx"):
        write_contact_stiffness(tmp_path / f"contact.{ending}", contact, space)
    frequencies = calculix.frequencies(tmp_path, space, "contact.inp", YOUNG, poisson, DENSITY, 6)
    # seven digits are printed; CalculiX integrates the masses of C3D8 as we do
    assert frequencies == pytest.approx(found.frequencies, rel=1e-6)
    written = mmread(tmp_path / "contact.mtx").toarray()
    assert written.sum() == pytest.approx(total(contact), rel=1e-12)


def test_springs_of_zones_under_a_tilted_plane_are_those_of_a_form(tmp_path):
    """Each of the two zones has its law; UFL assembles the same stiffness from the closures."""
    draw = np.random.default_rng(17)
    lengths = tuple(draw.uniform(0.7, 1.4, 3))
    mesh = box(cells=(4, 3, 2), lengths=lengths)
    facets = dmesh.locate_entities_boundary(mesh, 2, lambda x: np.isclose(x[2], 0.0))
    beyond = dmesh.compute_midpoints(mesh, 2, facets)[:, 0] > 0.5 * lengths[0]
    tags = tagged(mesh, {n: facets[beyond == n] for n in (0, 1)})
    space = compat.vector_space(mesh, 1)
    laws = [PowerLaw(draw.uniform(1e4, 5e4), power=2.0 + n) for n in (0, 1)]
    approach, tilt = draw.uniform(5e-3, 8e-3), tuple(draw.uniform(-2e-3, 2e-3, 2))
    plane = RigidPlane(approach=approach, tilt=tilt)
    names, own = {"a": 0, "b": 1}, dict(zip("ab", laws, strict=True))
    rough = Interface(space, tags, laws=own, names=names, indenter=plane)
    u = fem.Function(space)
    u.x.array[:] = draw.uniform(0.0, 1e-3, len(u.x.array))
    v, w, x = ufl.TestFunction(space), ufl.TrialFunction(space), ufl.SpatialCoordinate(mesh)
    closure = approach + u[2] + sum(t * (x[i] - 0.5 * lengths[i]) for i, t in enumerate(tilt))
    ds = ufl.Measure(
        "ds",
        domain=mesh,
        subdomain_data=tags,
        metadata={"quadrature_degree": rough.quadrature_degree},
    )
    form = sum(
        law.power * law.k * closure ** (law.power - 1.0) * v[2] * w[2] * ds(n)
        for n, law in enumerate(laws)
    )
    expected = compat.assemble_matrix(compat.compile_form(form), [])
    expected = expected.convert("dense", PETSc.Mat()).getDenseArray()
    for ending in ("inp", "mtx"):
        write_contact_stiffness(tmp_path / f"c.{ending}", rough.stiffness_matrix(u), space)
    places, tree = space.tabulate_dof_coordinates(), KDTree(space.tabulate_dof_coordinates())
    for ending in ("inp", "mtx"):
        path = tmp_path / f"c.{ending}"
        number, place = nodes_of(path)
        row = tree.query(place)[1]
        assert abs(places[row] - place).max() < 1e-8
        dofs = (3 * row[:, None] + np.arange(3)).ravel()
        written = mmread(path).toarray() if ending == "mtx" else springs(path, number)
        found = np.zeros_like(expected)
        found[np.ix_(dofs, dofs)] = written
        # 14 digits of a spring are written, of which some cancel
        assert abs(found - expected).max() < 1e-12 * abs(expected).max()


def nodes_of(path):
    """Return numbers and places of the nodes of a written stiffness."""
    lines = path.read_text().splitlines()
    lines = [line.lstrip("*% ") for line in lines if line[:2] in ("**", "% ")]
    rows = np.array([line.split(",") for line in lines if line[0].isdigit()], float)
    return rows[:, 1].astype(int), rows[:, 2:]


def springs(path, numbers):
    """Return the sum of the springs of a file, by rows of its nodes."""
    lines = [line for line in path.read_text().splitlines() if not line.startswith("**")]
    row_of = {int(number): row for row, number in enumerate(numbers)}
    whole = np.zeros((3 * len(numbers),) * 2)
    for _, nodes, _, axes, value in zip(*(lines[k::5] for k in range(5)), strict=True):
        ends = zip(nodes.split(",")[1:], axes.split(","), strict=True)
        dofs = [3 * row_of[int(node)] + int(axis) - 1 for node, axis in ends]
        signs = np.array([1.0, -1.0])[: len(dofs)]
        whole[np.ix_(dofs, dofs)] += float(value) * np.outer(signs, signs)
    return whole


def total(matrix):
    """Return the sum of all entries."""
    ones, sums = matrix.createVecs()
    ones.set(1.0)
    matrix.mult(ones, sums)
    return sums.sum()


def test_springs_of_a_face_that_slides_are_refused(tmp_path):
    rough, space, _ = on_plane(box(cells=(1, 1, 1), cell=HEXAHEDRA), Spring(1e3))
    sliding = rough.stiffness_matrix(fem.Function(space), sliding=(0.3, 0.0))
    with pytest.raises(InputError, match="is not symmetric"):
        write_contact_stiffness(tmp_path / "contact.inp", sliding, space)
    with pytest.raises(InputError, match=r"\.inp or \.mtx"):
        write_contact_stiffness(tmp_path / "contact.txt", sliding, space)
    assert not list(tmp_path.iterdir())
    write_contact_stiffness(tmp_path / "contact.mtx", sliding, space)
    assert mmread(tmp_path / "contact.mtx").shape == (12, 12)


@pytest.mark.parametrize("ending", ["inp", "mtx"])
def test_out_of_contact_there_are_no_springs(tmp_path, ending):
    rough, space, _ = on_plane(box(cells=(1, 1, 1)), RangedLaw(3e3), approach=-1e-3)
    path = tmp_path / f"free.{ending}"
    write_contact_stiffness(path, rough.stiffness_matrix(fem.Function(space)), space)
    text = path.read_text()
    assert "stiffness of the contact" in text and "SPRING" not in text
    if ending == "mtx":
        assert mmread(path).shape == (0, 0)
