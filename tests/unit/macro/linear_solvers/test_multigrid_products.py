"""Matrices of coarser grids against dense Galerkin products."""

import numpy as np
import pytest
from mpi4py import MPI
from petsc4py import PETSc

from patchlaw.geometry import BlockShape
from patchlaw.macro import Block, Material, block_mesh
from patchlaw.macro.linear_solvers.multigrid import coarser_grids, lattice_of
from patchlaw.macro.linear_solvers.node_matrices import dofs_of, node_submatrix


def make(sides="free", **changes):
    shape = BlockShape(**{"interface": (1.0, 0.8), "height": 0.9, "cells": (6, 5, 4)} | changes)
    material = Material(young_modulus=4e3, poisson_ratio=0.3)
    return Block(block_mesh(shape, MPI.COMM_SELF), material, sides)


def dense(matrix):
    rows, columns = (np.arange(size, dtype=PETSc.IntType) for size in matrix.getSize())
    return matrix.getValues(rows, columns)


def grids_of(block):
    return coarser_grids(lattice_of(block.space, block.mesh), block.stiffness, block.free)


@pytest.mark.parametrize("sides", ["free", "roller"])
@pytest.mark.parametrize("element", ["Q1", "P1", "Q2"])
def test_every_grid_has_the_galerkin_product(element, sides):
    cells = (3, 3, 2) if element == "Q2" else (6, 5, 4)
    block = make(sides, element=element, cells=cells, grading=3.0)
    finer = dense(block.stiffness)
    for grid in grids_of(block):
        interpolation = dense(grid.interpolation)
        expected = interpolation.T @ finer @ interpolation
        # rounding of sums of some hundred terms
        np.testing.assert_allclose(dense(grid.matrix), expected, atol=1e-13 * expected.max())
        finer = expected


def test_single_unknowns_may_be_held_anywhere():
    block = make()
    free = block.free
    held = np.flatnonzero(free.array_r)[[5, 40, 41, -1]]  # also amid coarse nodes
    free.array[held] = 0.0
    matrix = block.stiffness.copy()
    matrix.zeroRowsColumns(held.astype(PETSc.IntType), 1.0)
    grid = coarser_grids(lattice_of(block.space, block.mesh), matrix, free)[0]
    weights, found = dense(grid.interpolation), dense(grid.matrix)
    expected = weights.T @ dense(matrix) @ weights
    held = np.isclose(np.diag(found), 1.0, atol=0.0)
    assert held.any()
    assert (found[held].sum(axis=1) == 1.0).all()
    np.testing.assert_allclose(found, expected, atol=1e-13 * expected.max())


def test_parts_are_those_of_the_matrix():
    matrix = make("roller").stiffness
    rows, columns = np.array([0, 3, 40]), np.array([1, 2, 3, 41])
    expected = dense(matrix)[np.ix_(dofs_of(rows), dofs_of(columns))]
    np.testing.assert_array_equal(node_submatrix(matrix, rows, columns).toarray(), expected)
