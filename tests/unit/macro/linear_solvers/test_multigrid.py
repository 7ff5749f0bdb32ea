"""Geometric multigrid: grids, transfers against closed forms, and bounds of iterations."""

import numpy as np
import pytest
from helpers.petsc_build import ALGEBRAIC
from mpi4py import MPI
from petsc4py import PETSc

from patchlaw.geometry import BlockShape, RefinedShape, Surface
from patchlaw.macro import Block, Material, block_mesh, rough_block_mesh
from patchlaw.macro.linear_solvers.multigrid import (
    Lines,
    coarsenings,
    coarser_grids,
    lattice_of,
    transfers,
)

CUBE = {"interface": (1.0, 1.0), "height": 1.0}
MARGIN = {"margin": 0.7, "margin_cells": 3, "margin_grading": 4.0}


def make(sides="free", poisson_ratio=0.15, **changes):
    shape = BlockShape(**(CUBE | {"cells": (6, 5, 4)} | changes))
    material = Material(young_modulus=4e3, poisson_ratio=poisson_ratio)
    return Block(block_mesh(shape, MPI.COMM_SELF), material, sides)


def lines(*sizes, degree=1):
    return Lines.of_elements(np.concatenate([[0.0], np.cumsum(sizes)]), degree)


def free_of(block):
    """Return 1 for every unknown of a block without supports."""
    free = block.stiffness.createVecRight()
    free.set(1.0)
    return free


def test_flat_cells_become_thick_first_and_layers_even():
    flat = [lines(*np.full(16, 8.0)), lines(*np.full(16, 8.0)), lines(*np.ones(16))]
    sizes = [tuple(len(of) for of in kept) for kept in coarsenings(flat, coarsest=300)]
    assert sizes[:4] == [(17, 17, 9), (17, 17, 5), (17, 17, 3), (9, 9, 2)]
    graded = [lines(*1.5 ** np.arange(12)), lines(*np.full(4, 40.0)), lines(*np.full(4, 40.0))]
    thin = graded[0]
    for kept in coarsenings(graded, coarsest=300):
        thin = thin.only(kept[0])
    lengths = np.diff(thin.ticks)
    assert lengths.max() / lengths.min() < 0.2 * 1.5**11  # what it was between the first and last


@pytest.mark.parametrize("element", ["Q1", "P1", "Q2", "P2"])
def test_transfers_reproduce_trilinear_displacements(element):
    block = make(element=element, grading=5.0, **MARGIN)
    x, y, z = block.space.tabulate_dof_coordinates().T
    functions = np.stack([1 + x * y * z, 2 * x - y * z + 3, x * y - z], axis=1)
    lattice = lattice_of(block.space, block.mesh)
    places = [of.ticks[lattice.nodes[:, k]] for k, of in enumerate(lattice.grid)]
    np.testing.assert_allclose(places, [x, y, z], atol=1e-8)  # gmsh's own tolerance
    steps = [transfer.interpolation for transfer in transfers(lattice, free_of(block))]
    assert len(steps) > 1
    values, seen = functions.ravel(), []
    for step in steps:
        # a coarse unknown is the fine one that it takes with weight 1 and alone
        indptr, indices, data = step.getValuesCSR()
        alone = np.flatnonzero(np.diff(indptr) == 1)
        coarse = np.empty(step.getSize()[1])
        coarse[indices[indptr[alone]]] = values[alone]
        assert np.array_equal(data[indptr[alone]], np.ones(len(alone)))
        assert len(alone) == len(coarse)
        result = step.createVecLeft()
        step.mult(PETSc.Vec().createWithArray(coarse, comm=PETSc.COMM_SELF), result)
        np.testing.assert_allclose(result.array_r, values, atol=1e-8)
        values = coarse
        seen.append(len(coarse))
    assert seen == sorted(seen, reverse=True)


@pytest.mark.parametrize("sides", ["free", "roller"])
def test_held_unknowns_stay_apart_on_every_grid(sides):
    block = make(sides, cells=(8, 8, 4))
    held = np.flatnonzero(block.free.array_r == 0.0)
    coarse = coarser_grids(block.lattice, block.stiffness, block.free)[0].matrix
    dense = dense_of(coarse)
    np.testing.assert_allclose(dense, dense.T, atol=1e-12 * dense.max())
    one = np.flatnonzero((dense.diagonal() == 1.0) & (np.count_nonzero(dense, axis=1) == 1))
    # the bottom, and above it two planes across x and two across y; layers stay on this grid
    on_planes = 5 * 5 * 3 + (2 * 2 * 5 * 4 if sides == "roller" else 0)
    assert len(one) == on_planes < len(held)
    assert np.linalg.eigvalsh(dense).min() > 0.0


def dense_of(matrix):
    every = np.arange(matrix.getSize()[0], dtype=PETSc.IntType)
    return matrix.getValues(every, every)


SHAPES = {
    "uniform": {"cells": (16, 16, 12)},
    "graded": {"cells": (20, 20, 12), "grading": 30.0},
    "flat": {"cells": (12, 12, 24), "height": 0.16},
    "tall": {"cells": (20, 20, 12), "height": 4.8},
    "long": {"cells": (12, 12, 12), "interface": (8.0, 1.0)},
    "pancake": {"interface": (50.0, 50.0), "cells": (24, 24, 6), "grading": 4.0},
    "column": {"interface": (0.02, 0.02), "cells": (4, 4, 50)},
    "margin": {"cells": (10, 10, 8), "grading": 10.0} | MARGIN | {"margin_grading": 10.0},
    "tetrahedra": {"cells": (14, 14, 10), "grading": 10.0, "element": "P1"},
    "quadratic tetrahedra": {"cells": (7, 7, 5), "grading": 10.0, "element": "P2"},
    "quadratic": {"cells": (8, 8, 6), "grading": 10.0, "element": "Q2"},
}


@pytest.mark.slow
@pytest.mark.parametrize("name", SHAPES)
def test_iterations_do_not_depend_on_the_shape(iterations, name):
    block = make("roller" if name in ("tall", "margin") else "free", **SHAPES[name])
    count = iterations(block)
    assert block.solver.pc.getType() == "mg"
    # 9 … 15 were counted, 8 … 10 with tetrahedra; eigenvalues are estimated from a random start
    assert count <= (14 if "tetrahedra" in name else 18)


def test_iterations_stay_on_a_rough_block(iterations):
    x = (np.arange(32) + 0.5) / 32
    heights = 0.02 * np.outer(np.sin(2 * np.pi * x), np.cos(4 * np.pi * x))
    surface = Surface(heights=heights, lengths=(1.0, 1.0))
    shape = BlockShape(**CUBE, cells=(16, 16, 10), grading=10.0)
    mesh, _ = rough_block_mesh(shape, surface, MPI.COMM_SELF)
    block = Block(mesh, Material(young_modulus=4e3, poisson_ratio=0.3))
    assert iterations(block) <= 18


@pytest.mark.long
@pytest.mark.parametrize(
    ("element", "ratio", "bound"),
    [("Q1", 0.46, 14), ("Q1", 0.49, 15), ("P1", 0.49, 18), ("Q2", 0.49, 22), ("Q1", 0.495, 17)],
)
def test_nearly_incompressible_blocks_take_more_smoothing(iterations, element, ratio, bound):
    # 9, 10, 13, 17 and 12 were counted; twice to four times as many with two steps of smoothing
    cells = (6, 6, 4) if element == "Q2" else (12, 12, 8)
    block = make(poisson_ratio=ratio, cells=cells, element=element, grading=4.0)
    assert block.solver.pc.getType() == "mg"
    assert iterations(block) <= bound


def test_meshes_without_planes_have_no_lattice():
    shape = RefinedShape(**CUBE, places=np.array([[0.5, 0.5]]), fine=0.3, coarse=0.5)
    block = Block(block_mesh(shape, MPI.COMM_SELF), Material(young_modulus=1.0, poisson_ratio=0.3))
    assert lattice_of(block.space, block.mesh) is None
    assert block.solver.method == ALGEBRAIC
