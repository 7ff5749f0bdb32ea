"""Small blocks and closed-form laws that the tests of the block share."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from helpers.contact_laws import PowerLaw
from patchlaw.geometry import BlockShape, PatchGrid
from patchlaw.macro import (
    Block,
    LoadedFace,
    Material,
    UnilateralContactProblem,
    block_mesh,
    rough_block_mesh,
)


def uneven_laws(count, k=3e4):
    """Laws of different stiffness and height, some of which stay open at first."""
    random = np.random.default_rng(7)
    return [PowerLaw(k * random.uniform(0.2, 2.0), random.uniform(0.0, 6e-3)) for _ in range(count)]


def block_of(sides="free", young_modulus=4000.0, poisson_ratio=0.15, comm=MPI.COMM_SELF,
             density=None, **shape):  # fmt: skip
    """Mesh a block; the paper's material unless told otherwise."""
    shape = {"interface": (1.0, 1.0), "height": 1.0, "cells": (6, 6, 4)} | shape
    constants = {"young_modulus": young_modulus, "poisson_ratio": poisson_ratio}
    material = Material(**constants, density=density)
    return Block(block_mesh(BlockShape(**shape), comm), material, sides=sides)


def interface_of(block, grid):
    """Put patches over the whole interface of a block."""
    return LoadedFace.of_block(block, PatchGrid(grid=grid, lengths=block.mesh.shape.interface))


def rough_contact(shape, surface, material, sides="free", **options):
    """Put a rough surface on top of a block of one process, as a problem of its contact."""
    mesh, _ = rough_block_mesh(shape, surface, MPI.COMM_SELF)
    highest = surface.highest - surface.mean_height
    return UnilateralContactProblem(Block(mesh, material, sides), highest, **options)
