"""Quadratic tetrahedra over their vertices: transfer, matrix below, and bounds of iterations."""

import numpy as np
import pytest
from helpers.petsc_build import ALGEBRAIC
from mpi4py import MPI
from petsc4py import PETSc

from patchlaw.geometry import RefinedShape, Surface
from patchlaw.macro import Block, Material, block_mesh, rough_block_mesh
from patchlaw.macro.linear_solvers.selection import vertex_transfer

CUBE = {"interface": (1.0, 1.0), "height": 1.0}
CENTRE = np.array([[0.5, 0.5]])


def make(element="P2", sides="free", poisson_ratio=0.15, fine=0.1, coarse=0.4, waves=0.0):
    shape = RefinedShape(**CUBE, places=CENTRE, fine=fine, coarse=coarse, element=element)
    x = (np.arange(32) + 0.5) / 32
    heights = waves * np.outer(np.sin(2 * np.pi * x), np.cos(2 * np.pi * x))
    surface = Surface(heights=heights, lengths=(1.0, 1.0))
    mesh = (
        rough_block_mesh(shape, surface, MPI.COMM_SELF)[0]
        if waves
        else block_mesh(shape, MPI.COMM_SELF)
    )
    return Block(mesh, Material(young_modulus=4e3, poisson_ratio=poisson_ratio), sides)


def test_linear_displacements_come_over_exactly():
    block = make()
    free = block.free
    free.set(1.0)
    linear = block.linear.space
    transfer, points = vertex_transfer(block.space, linear, free), linear.tabulate_dof_coordinates()
    slopes = np.array([[1.0, 2.0, 0.5], [-0.3, 0.7, 4.0], [2.0, 0.0, -1.0]])
    there = transfer.createVecLeft()
    here = PETSc.Vec().createWithArray((points @ slopes + 1.0).ravel(), comm=PETSc.COMM_SELF)
    transfer.mult(here, there)
    nodes = block.space.tabulate_dof_coordinates()
    np.testing.assert_allclose(there.array_r, (nodes @ slopes + 1.0).ravel(), atol=1e-13)


@pytest.mark.parametrize("sides", ["free", "roller"])
def test_the_stiffness_of_linear_tetrahedra_is_galerkins_product(sides):
    block = make(sides=sides)
    transfer = vertex_transfer(block.space, block.linear.space, block.free)
    whole, linear = (of.stiffness.convert("aij", PETSc.Mat()) for of in (block, block.linear))
    product = whole.ptap(transfer)
    every = np.arange(product.size[0], dtype=PETSc.IntType)
    found, exact = (of.getValues(every, every) for of in (linear, product))
    np.testing.assert_allclose(found, exact, atol=1e-11 * exact.max())


CASES = {
    # (element, ν, amplitude of the roughness) and the iterations counted
    "quadratic": (("P2", 0.15, 0.0), 13),
    "curved": (("P2", 0.15, 0.03), 14),
    "quadratic, rubbery": (("P2", 0.4, 0.03), 18),
    "linear": (("P1", 0.15, 0.03), 15),
    "linear, rubbery": (("P1", 0.4, 0.03), 25),
}


@pytest.mark.long
@pytest.mark.parametrize("name", CASES)
def test_iterations_on_tetrahedra(iterations, name):
    (element, ratio, waves), counted = CASES[name]
    fine, coarse = (0.05, 0.3) if element == "P2" else (0.03, 0.2)
    block = make(element, "free", ratio, fine, coarse, waves)
    assert iterations(block) <= counted + 4  # other aggregates with other releases of PETSc
    assert block.solver.method == ("mg" if element == "P2" else ALGEBRAIC)


@pytest.mark.long
def test_iterations_do_not_grow_with_the_mesh(iterations):
    counts = [iterations(make(fine=fine)) for fine in (0.1, 0.03)]
    assert counts[1] <= counts[0] + 3
