"""Plane and mixed problems as users write them in dolfinx, without any part of patchlaw."""

from __future__ import annotations

import numpy as np
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI
from petsc4py import PETSc

from helpers.faces import at

YOUNG, POISSON = 4000.0, 0.3
LAME = YOUNG * POISSON / ((1.0 + POISSON) * (1.0 - 2.0 * POISSON))
SHEAR = YOUNG / (2.0 * (1.0 + POISSON))
UNIAXIAL = LAME + 2.0 * SHEAR
"""Stress over strain where nothing gives way aside."""


def rectangle(lower, upper, cells, cell="quadrilateral", comm=MPI.COMM_SELF):
    """A rectangle of the plane, or with three coordinates a box."""
    corners = [np.array(lower, float), np.array(upper, float)]
    make = dmesh.create_rectangle if len(cells) == 2 else dmesh.create_box
    return make(comm, corners, list(cells), getattr(dmesh.CellType, cell))


def rollers(space, *planes):
    """Conditions that hold the displacements along axes on planes across them."""
    found = []
    for axis, value in planes:
        part, facets = space.sub(axis), at(space.mesh, axis, value)
        dofs = fem.locate_dofs_topological(part, space.mesh.topology.dim - 1, facets)
        found.append(fem.dirichletbc(PETSc.ScalarType(0.0), dofs, part))
    return found


def mixed_space(mesh, *parts):
    """The space of several Lagrange fields, each given by its degree and number of components."""
    if hasattr(fem, "functionspace"):
        from basix.ufl import element, mixed_element  # not there with the oldest dolfinx

        cell = mesh.basix_cell()
        kinds = [
            element("Lagrange", cell, degree, **({"shape": (size,)} if size > 1 else {}))
            for degree, size in parts
        ]
        return fem.functionspace(mesh, mixed_element(kinds))
    cell = mesh.ufl_cell()
    kinds = [
        (ufl.VectorElement if size > 1 else ufl.FiniteElement)("Lagrange", cell, degree)
        for degree, size in parts
    ]
    return fem.FunctionSpace(mesh, ufl.MixedElement(kinds))


def strain_of(u, radius=None):
    """The strain, three by three of a body of revolution."""
    if radius is None:
        return ufl.sym(ufl.grad(u))
    grad, hoop = ufl.sym(ufl.grad(u)), u[0] / radius
    return ufl.as_tensor([[grad[0, 0], grad[0, 1], 0], [grad[0, 1], grad[1, 1], 0], [0, 0, hoop]])


def inner_work(u, v, mesh, *, turned=False, thermal=0.0):
    """The virtual work of linear elasticity in v; of a body of revolution on its whole circle."""
    radius = ufl.SpatialCoordinate(mesh)[0] if turned else None
    strain, virtual = strain_of(u, radius), strain_of(v, radius)
    size = strain.ufl_shape[0]
    elastic = strain - thermal * ufl.Identity(size)
    trace = ufl.tr(elastic) - (0 if size == 3 else thermal)  # none across a plane
    stress = LAME * trace * ufl.Identity(size) + 2.0 * SHEAR * elastic
    return ufl.inner(stress, virtual) * (2.0 * np.pi * radius if turned else 1.0) * ufl.dx


def two_rectangles(width=2.0, heights=(1.0, 0.5), apart=1e-3, cells=(4, 2), comm=MPI.COMM_SELF):
    """A rectangle over another, apart by a little, in one mesh; few nodes match."""
    points, quads = [], []
    bases = 0.0, heights[0] + apart
    for base, height, count in zip(bases, heights, cells, strict=True):
        x, y = np.meshgrid(np.linspace(0, width, count + 1), base + np.array([0.0, height]))
        lower = sum(map(len, points)) + np.arange(count)
        quads.append(np.column_stack([lower, lower + 1, lower + count + 1, lower + count + 2]))
        points.append(np.column_stack([x.ravel(), y.ravel()]))
    points, quads = np.vstack(points), np.vstack(quads).astype(np.int64)
    if comm.rank:
        points, quads = points[:0], quads[:0]
    if hasattr(fem, "functionspace"):
        from basix.ufl import element  # not there with the oldest dolfinx

        shape = {"e": element("Lagrange", "quadrilateral", 1, shape=(2,))}
    else:
        cell = ufl.Cell("quadrilateral", geometric_dimension=2)
        shape = {"domain": ufl.Mesh(ufl.VectorElement("Lagrange", cell, 1))}
    return dmesh.create_mesh(comm, cells=quads, x=points, **shape)
