"""A stiffness with springs at few nodes, without a second matrix: the same as the sum assembled."""

import re

import numpy as np
import pytest
from helpers.body_meshes import box, hanging, standing
from petsc4py import PETSc
from scipy.linalg import eigh

from patchlaw.geometry import PatchGrid
from patchlaw.macro import FacePair, Material
from patchlaw.macro.linear_solvers import solvers
from patchlaw.macro.linear_solvers.node_matrices import Stiffened, springs_at
from patchlaw.macro.linear_solvers.options import has_hypre, largest_eigenvalue
from patchlaw.macro.linear_solvers.selection import PREFIX

SOFT = Material(young_modulus=1000.0, poisson_ratio=0.3)
WHOLE = PatchGrid(grid=(1, 1), lengths=(1.0, 1.0))


@pytest.fixture(scope="module")
def face():
    return standing(box((0, 0, -0.5), (1, 1, 0), (2, 2, 1), "tetrahedron"), SOFT, WHOLE, 2)


@pytest.fixture(scope="module")
def stiffened(face):
    points = face.points_by_dofs
    springs = points.transposeMatMult(points)
    springs.scale(1e6)
    return Stiffened(face.body.stiffness, face.body.stiffnesses, springs)


def test_diagonal_blocks_are_those_of_the_sum(stiffened):
    every = np.arange(stiffened.product.size[0], dtype=PETSc.IntType)
    blocks, whole = (
        of.convert("aij", PETSc.Mat()).getValues(every, every)
        for of in (stiffened.block_diagonal(), stiffened.assembled())
    )
    same_node = every[:, None] // 3 == every // 3
    np.testing.assert_allclose(blocks, np.where(same_node, whole, 0.0), atol=1e-11 * whole.max())


@pytest.mark.long
@pytest.mark.parametrize("cell", ["tetrahedron", "hexahedron"])
def test_springs_at_points_do_not_raise_the_largest_smoothed_eigenvalue(cell):
    face = standing(box((0, 0, -0.5), (1, 1, 0), (4, 4, 2), cell), SOFT, WHOLE, 2)
    body, scaled = face.body, face.points_by_dofs.copy()
    factors = scaled.createVecLeft()
    factors.array[:] = np.random.default_rng(4).uniform(0.0, 1.0, factors.local_size)
    scaled.diagonalScale(L=factors)
    springs = scaled.transposeMatMult(scaled)
    springs.scale(1e8)
    largest = []
    for stiffened in (None, Stiffened(body.stiffness, body.stiffnesses, springs)):
        matrix = body.stiffness.convert("aij", PETSc.Mat())
        whole = matrix if stiffened is None else stiffened.assembled().convert("aij", PETSc.Mat())
        dense = whole.convert("dense", PETSc.Mat()).getDenseArray()
        blocks = np.kron(np.eye(len(dense) // 3), np.ones((3, 3))) * dense
        largest.append(float(eigh(dense, blocks, eigvals_only=True)[-1]))
    estimate = largest_eigenvalue(body.solver.pc.getMGSmoother(1))
    assert largest[1] <= 1.001 * largest[0]
    assert 0.95 * largest[0] <= estimate <= largest[0] * (1 + 1e-9)  # the smoother adds a tenth


@pytest.mark.parametrize("cell", ["tetrahedron", "hexahedron"])
def test_a_few_stiff_points_leave_the_preconditioner_definite(cell):
    """They couple all nodes of their facet, more than the elements do."""
    face = standing(box((0, 0, -0.5), (1, 1, 0), (4, 4, 2), cell), SOFT, WHOLE, 2)
    body, points = face.body, face.points_by_dofs
    slope = np.zeros(points.getLocalSize()[0])
    slope[:: len(slope) // 7] = 1e12
    _ = body.spectrum
    stiffened = Stiffened(body.stiffness, body.stiffnesses, springs_at(points, slope))
    solver = body.solver_of(stiffened)
    assert iterations(solver, stiffened.product) > 0


@pytest.mark.skipif(not has_hypre(), reason="PETSc without hypre has its own grids")
def test_springs_come_onto_the_grids_that_a_body_has():
    """Of linear elements: no matrix changes, and stiff springs cost few iterations."""
    face = standing(box((0, 0, -0.5), (1, 1, 0), (9, 8, 7), "tetrahedron"), SOFT, WHOLE)
    body, points = face.body, face.points_by_dofs
    grids, before = body.coarser_grids, body.coarser_grids[-1].matrix.norm()
    springs = springs_at(points, np.full(points.getLocalSize()[0], 1e7))
    stiffened = Stiffened(body.stiffness, body.stiffnesses, springs)
    solver = body.solver_of(stiffened)
    assert body.coarser_grids is grids
    assert grids[-1].matrix.norm() == before
    solver.setOperators(stiffened.product)
    solver.setTolerances(rtol=1e-8)
    load, moved = body.stiffness.createVecs()
    load.array[:] = np.random.default_rng(7).standard_normal(load.local_size)
    load.pointwiseMult(load, body.free)
    solver.solve(load, moved)
    assert 0 < solver.its <= 25
    left = stiffened.assembled() * moved - load
    assert left.norm() <= 1.01e-8 * load.norm()


@pytest.mark.skipif(not has_hypre(), reason="PETSc without hypre has its own grids")
@pytest.mark.parametrize("bodies", [1, 2])
def test_where_hypre_makes_no_grids_its_own_sweeps_solve(bodies):
    """Nodes of one layer of flat cells hang on their support alone: no coarser grid serves them."""
    cells, thin, hexahedra = (23, 23, 1), 1e-3, "hexahedron"
    face = standing(box((0, 0, -thin), (1, 1, 0), cells, hexahedra), SOFT, WHOLE)
    if bodies == 2:
        other = box((0, 0, 0), (1, 1, thin), cells, hexahedra)
        face = FacePair(face, hanging(other, SOFT, WHOLE))
    body, points = face.body, face.points_by_dofs
    springs = springs_at(points, np.full(points.getLocalSize()[0], 1.0))
    stiffened = Stiffened(body.stiffness, body.stiffnesses, springs)
    solver = body.solver_of(stiffened)
    assert solver.method == "hypre"
    assert 0 < iterations(solver, stiffened.product) <= 12  # 25 by our smoother alone


@pytest.mark.skipif(not has_hypre(), reason="PETSc without hypre has its own grids")
@pytest.mark.parametrize(
    ("option", "value", "method"),
    [
        ("pc_type", "mg", "mg"),
        ("pc_hypre_type", "euclid", "hypre"),
        ("pc_hypre_boomeramg_nodal_coarsen", "0", "mg"),
    ],
)
def test_the_users_options_choose_the_multigrid_of_linear_elements(
    option, value, method, monkeypatch
):
    monkeypatch.setattr(solvers, "COARSEST", 100)  # several grids
    face = standing(box((0, 0, -0.5), (1, 1, 0), (9, 8, 7), "tetrahedron"), SOFT, WHOLE)
    PETSc.Options(PREFIX)[option] = value
    try:
        solver = face.body.solver
        assert solver.method == method
        assert 0 < iterations(solver, face.body.stiffness) <= 25
    finally:
        PETSc.Options(PREFIX).delValue(option)


@pytest.mark.parametrize(
    ("option", "value", "ends"),
    [("eigenvalues", "0.123,4.5", (0.123, 4.5)), ("esteig", "0,0.2,0,1.6", (None, None))],
)
def test_the_users_range_of_a_smoother_stays(option, value, ends, tmp_path):
    face = standing(box((0, 0, -0.5), (1, 1, 0), (2, 2, 1), "tetrahedron"), SOFT, WHOLE, 2)
    points = face.points_by_dofs
    springs = springs_at(points, np.ones(points.getLocalSize()[0]))
    name = f"{PREFIX}mg_levels_ksp_chebyshev_{option}"
    PETSc.Options()[name] = value
    try:
        found = [
            smoothed(solver, tmp_path / "view")
            for solver in (
                face.body.solver,
                face.body.solver_of(Stiffened(face.body.stiffness, face.body.stiffnesses, springs)),
            )
        ]
    finally:
        PETSc.Options().delValue(name)
    for low, high in found:
        assert (low, high) == ends or high / low == pytest.approx(8.0, rel=1e-3)


def smoothed(solver, file):
    """Return the range that the smoother on all nodes smooths, as PETSc shows it."""
    viewer = PETSc.Viewer().createASCII(str(file), "w", comm=PETSc.COMM_SELF)
    solver.pc.getMGSmoother(1).view(viewer)
    viewer.destroy()
    return tuple(map(float, re.search(r"used: +min ([^,]+), max (\S+)", file.read_text()).groups()))


def iterations(solver, matrix):
    """Return the iterations to 1e-8 under random forces; 0 where they fail."""
    solver.setOperators(matrix)
    solver.setTolerances(rtol=1e-8)
    load, moved = matrix.createVecs()
    load.array[:] = np.random.default_rng(7).standard_normal(load.local_size)
    solver.solve(load, moved)
    return solver.its if solver.reason > 0 else 0
