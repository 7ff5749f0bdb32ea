"""Supports, solves and reactions of the block."""

import numpy as np
import pytest
from mpi4py import MPI

from patchlaw.geometry import BlockShape, PatchGrid
from patchlaw.macro import Block, LoadedFace, Material, block_mesh
from patchlaw.support import InputError, NotConverged

STEEL = Material(young_modulus=2e5, poisson_ratio=0.3)


def make(sides="free", **changes):
    shape = {"interface": (1.0, 1.0), "height": 1.0, "cells": (3, 3, 3)} | changes
    return Block(block_mesh(BlockShape(**shape), MPI.COMM_SELF), STEEL, sides)


def test_unknown_sides_are_refused():
    with pytest.raises(
        InputError, match=r"'glued': unknown support of the sides \(allowed: free, roller\)"
    ):
        make("glued")


@pytest.mark.parametrize("sides", ["free", "roller"])
def test_supports_hold(sides):
    block = make(sides, margin=0.5, margin_cells=1, cells=(2, 2, 2))
    interface = LoadedFace.of_block(block, PatchGrid(grid=(1, 1), lengths=(1.0, 1.0)))
    u = block.solve(interface.load(np.array([100.0]))).x.array.reshape(-1, 3)
    x, y, z = block.space.tabulate_dof_coordinates().T
    assert np.abs(u[np.isclose(z, -1.0)]).max() == 0.0
    on_x, on_y = np.isclose(np.abs(x - 0.5), 1.0), np.isclose(np.abs(y - 0.5), 1.0)
    for axis, side in ((0, on_x), (1, on_y)):
        normal = np.abs(u[side, axis]).max() / np.abs(u).max()
        # multigrid touches constrained rows and leaves them to the solver's 1e-10
        assert normal < 1e-9 if sides == "roller" else normal > 1e-3
        assert np.abs(u[side & np.isclose(z, 0.0), 2]).max() > 0.0  # the sides slide


def test_failed_solve_names_the_reason():
    block = make()
    load = block.stiffness.createVecLeft()
    load.array[-1] = 1.0
    block.solver.setTolerances(max_it=1)
    with pytest.raises(NotConverged, match=r"linear solve .* DIVERGED_(MAX_)?ITS? after 1 iter"):
        block.solve(load)
