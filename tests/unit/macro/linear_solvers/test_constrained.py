"""Solves with held degrees of freedom: against a dense matrix, in few iterations."""

import numpy as np
import pytest
from mpi4py import MPI
from petsc4py import PETSc

from patchlaw import NotConverged
from patchlaw.geometry import BlockShape
from patchlaw.macro import Block, Material, block_mesh
from patchlaw.macro.linear_solvers.constrained import (
    TOLERANCE,
    ConstrainedSolver,
    contact_tolerance,
)

RANDOM = np.random.default_rng(4)


@pytest.fixture(scope="module")
def block():
    shape = BlockShape(interface=(1.0, 1.0), height=1.0, cells=(3, 3, 2))
    return Block(block_mesh(shape, MPI.COMM_SELF), Material(young_modulus=4e3, poisson_ratio=0.2))


def vector_of(values):
    return PETSc.Vec().createWithArray(values.copy(), comm=PETSc.COMM_SELF)


def test_what_is_free_solves_and_what_is_held_stays(block):
    count = block.dofs
    every = np.arange(count, dtype=PETSc.IntType)
    matrix = block.stiffness.getValues(every, every)
    held = RANDOM.choice(count, count // 4, replace=False)
    start, right = RANDOM.standard_normal((2, count))
    solver, found = ConstrainedSolver(block.stiffness, block.solver.pc), vector_of(start)
    solver.constrain(np.arange(5))  # forgotten by the next
    solver.constrain(held)
    assert solver.improve(found, vector_of(right - matrix @ start), 1e-8) > 0
    residual = right - matrix @ found.array_r
    free = np.setdiff1d(np.arange(count), held)
    assert np.array_equal(found.array_r[held], start[held])
    assert np.linalg.norm(residual[free]) <= 1.1e-8  # what rounding adds to the recursion
    assert solver.improve(found, vector_of(residual), 1e-7) == 0


def test_numbers_that_are_none_do_not_converge(block):
    solver, found = (
        ConstrainedSolver(block.stiffness, block.solver.pc),
        block.stiffness.createVecRight(),
    )
    residual = found.duplicate()
    residual.set(np.inf)
    with pytest.raises(NotConverged, match="the linear solve of the rough block"):
        solver.improve(found, residual, 1e-8)


def test_held_degrees_of_freedom_move_together(block):
    count = block.dofs
    every = np.arange(count, dtype=PETSc.IntType)
    matrix = block.stiffness.getValues(every, every)
    held = np.sort(RANDOM.choice(count, count // 4, replace=False))
    motions = np.linalg.qr(RANDOM.standard_normal((len(held), 2)))[0]
    start, right = RANDOM.standard_normal((2, count))
    solver, found = ConstrainedSolver(block.stiffness, block.solver.pc), vector_of(start)
    solver.constrain(held, motions)
    solver.improve(found, vector_of(right - matrix @ start), 1e-8)
    free = np.setdiff1d(np.arange(count), held)
    ways = np.zeros((count, len(free) + 2))
    ways[free, np.arange(len(free))] = 1.0
    ways[held, -2:] = motions
    step = np.linalg.solve(ways.T @ matrix @ ways, ways.T @ (right - matrix @ start))
    # residuals of 1e-8 over the smallest stiffness
    np.testing.assert_allclose(found.array_r, start + ways @ step, atol=1e-9)


MATERIAL = Material(young_modulus=4e3, poisson_ratio=0.2)


def block_of(cells, **options):
    shape = BlockShape(interface=(1.0, 1.0), height=1.0, cells=cells, **options)
    return Block(block_mesh(shape, MPI.COMM_SELF), MATERIAL)


def pressed_dofs(block, half):
    """Return the vertical dofs of the top within a square in its middle."""
    places = block.space.tabulate_dof_coordinates()
    held = (places[:, 2] > -1e-9) & (np.abs(places[:, :2] - 0.5).max(axis=1) < half)
    return 3 * np.flatnonzero(held) + 2


@pytest.mark.long
@pytest.mark.parametrize(
    ("cells", "options", "layers"),
    [((20, 20, 8), {"grading": 6.0}, 2), ((8, 8, 4), {"element": "P2"}, 1)],
)
def test_held_unknowns_cost_few_iterations(cells, options, layers):
    block = block_of(cells, **options)
    dofs = pressed_dofs(block, 0.26)

    def iterations(held, reach):
        solver = ConstrainedSolver(block.stiffness, block.solver.pc, layers=reach)
        solver.constrain(held)
        sag, load = (block.stiffness.createVecRight() for _ in range(2))
        sag.array[dofs] = -1.0
        block.stiffness.mult(sag, load)
        load.scale(-1.0)
        return solver.improve(sag.duplicate(), load, 1e-9 * load.norm())

    none, cut, mended = iterations(dofs[:0], 0), iterations(dofs, 0), iterations(dofs, layers)
    # measured 9, 15, 11 and 10, 17, 12
    assert mended <= none + 3
    assert mended <= cut - 3


def test_users_say_how_well_contacts_are_solved_for():
    options = PETSc.Options("patchlaw_")
    assert contact_tolerance() == TOLERANCE
    options["ksp_rtol"] = 1e-5
    try:
        assert contact_tolerance() == 1e-5
    finally:
        options.delValue("ksp_rtol")
