"""Products and cycles for many vectors at once, against PETSc's for one."""

import numpy as np
import pytest
from mpi4py import MPI
from petsc4py import PETSc

from patchlaw.geometry import BlockShape
from patchlaw.macro import BOTTOM, Block, Material, MeshedBody, Support, TaggedMesh, block_mesh
from patchlaw.macro.linear_solvers.many_vectors import corrections, one_by_one, products
from patchlaw.macro.linear_solvers.options import PREFIX


def body(element, ratio, *, lattice=True):
    shape = BlockShape(interface=(3.0, 2.0), height=2.0, cells=(8, 7, 6), element=element)
    mesh, material = (
        block_mesh(shape, MPI.COMM_SELF),
        Material(young_modulus=4000.0, poisson_ratio=ratio),
    )
    if lattice:
        return Block(mesh, material)
    tagged = TaggedMesh(mesh=mesh.mesh, facet_tags=mesh.facet_tags)
    return MeshedBody(tagged, material, [Support(tag=BOTTOM)], order=int(element[1]))


def columns(body):
    drawn = np.random.default_rng(6).standard_normal((body.owned_dofs, 19))
    return drawn * body.free.array_r[:, None]


@pytest.mark.parametrize(
    ("element", "ratio", "lattice", "single"),
    # Jacobi's smoother; blocks of nodes with more steps; algebraic; matrices of symmetric blocks
    [
        ("Q1", 0.3, True, 0),
        pytest.param("P2", 0.4, True, 0, marks=pytest.mark.long),
        ("P1", 0.3, False, 1),
        ("P2", 0.3, False, 1),
    ],
)
def test_a_cycle_for_many_vectors_is_that_for_one(element, ratio, lattice, single):
    one = body(element, ratio, lattice=lattice)
    solver, given = one.solver, columns(one)
    matrix, found = solver.getOperators()[0], corrections(one.solver)
    assert found.__qualname__.startswith("one_by_one") == bool(single)
    expected = one_by_one(matrix, solver.pc.apply)(given)
    # the same operations in another order: rounding
    np.testing.assert_allclose(found(given), expected, rtol=0, atol=1e-12 * abs(expected).max())
    expected = one_by_one(matrix, matrix.mult)(given)
    np.testing.assert_allclose(
        products(matrix, given), expected, rtol=0, atol=1e-13 * abs(expected).max()
    )
    assert products(matrix, given[:, :0]).shape == (len(given), 0)


def test_a_users_smoother_is_taken():
    options = PETSc.Options(PREFIX)
    options["mg_levels_ksp_type"] = "richardson"
    try:
        one = body("Q1", 0.3)
        found, given = corrections(one.solver), columns(one)
        expected = one_by_one(one.solver.getOperators()[0], one.solver.pc.apply)(given)
        np.testing.assert_array_equal(found(given), expected)
    finally:
        options.delValue("mg_levels_ksp_type")
