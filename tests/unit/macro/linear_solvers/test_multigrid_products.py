"""Matrices of coarser grids against dense Galerkin products, and the blocks they are made from."""

import numpy as np
import pytest
from mpi4py import MPI
from petsc4py import PETSc

from patchlaw.geometry import BlockShape
from patchlaw.macro import Block, Material, block_mesh
from patchlaw.macro.linear_solvers import multigrid
from patchlaw.macro.linear_solvers.multigrid import coarser_grids, galerkin, lattice_of, transfers


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
    step = next(transfers(lattice_of(block.space, block.mesh), block.free))
    free = block.free
    held = np.flatnonzero(free.array_r)[[5, 40, 41, -1]]  # also amid coarse nodes
    free.array[held] = 0.0
    matrix = block.stiffness.copy()
    matrix.zeroRowsColumns(held.astype(PETSc.IntType), 1.0)
    found = dense(galerkin(matrix, step.weights, free, step.coarse_free))
    weights = np.kron(dense(step.weights), np.eye(3)) * free.array_r[:, None]
    expected = weights.T @ dense(matrix) @ weights
    stay = step.coarse_free.array_r > 0.0
    expected[~stay], expected[:, ~stay] = 0.0, 0.0
    expected[~stay, ~stay] = 1.0
    np.testing.assert_allclose(found, expected, atol=1e-13 * expected.max())


def test_rows_are_multiplied_in_any_number_of_pieces(monkeypatch):
    block = make()
    step = next(transfers(lattice_of(block.space, block.mesh), block.free))
    products = block.stiffness, step.weights, step.free, step.coarse_free
    whole = dense(galerkin(*products))
    monkeypatch.setattr(multigrid, "_NODES_AT_ONCE", 7)
    pieces = dense(galerkin(*products))
    np.testing.assert_allclose(pieces, whole, atol=1e-13 * whole.max())  # order of sums
