"""Writes displacements and contact pressures of a block for ParaView."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from dolfinx import fem, io
from numpy.typing import NDArray
from petsc4py import PETSc

from macro import compat
from macro.contact.law_interface import Interface
from macro.contact.unilateral_problem import UnilateralContactProblem, UnilateralContactState
from macro.mesh.contact_face import top_facets

Array = NDArray[np.float64]

_FILES_NOT_CLOSED: list[Any] = []
"""XDMF files that could not be closed, referenced so that no destructor runs before exit."""

_ZERO = 1e-9
"""Value below which a basis function counts as zero at a node."""


def write_fields(
    path: Path | str, interface: Interface, displacement: Array, pressure: Array
) -> None:
    """Write displacements [mm] and patch pressures [MPa] as XDMF, with an HDF5 file beside it.

    Quadratic displacements are written at the vertices. The pressure of a cell is the mean pressure
    over its facet on the top, weighted by the areas of the patches there, and zero elsewhere. Where
    dolfinx has ADIOS2, displacements of any degree are also written as VTX, in a folder of the same
    name that ends in ``.bp``.

    Args:
        path: File to write, ending in ``.xdmf``.
        interface: Patches on the block.
        displacement: This rank's owned displacements, dof by dof [mm].
        pressure: Mean pressures of the patches, shape (N,) [MPa].

    Note:
        Collective.
    """
    block = interface.block
    mesh = block.mesh.mesh
    shown = block.function(displacement)
    if compat.HAS_VTX:
        compat.write_vtx(str(Path(path).with_suffix(".bp")), shown)
    if block.degree > 1:
        shown = _interpolated(compat.vector_space(mesh, 1), shown, shown.name)
    pressures = fem.Function(compat.scalar_space(mesh, 0, "DG"), name="pressure")
    points, facets = interface.quadrature, top_facets(block.mesh)
    cells = compat.cell_nodes(pressures.function_space)[:, 0]
    force = points.weight * pressure[points.patch]
    total = np.bincount(cells[points.cell], force, minlength=len(pressures.x.array))
    loaded = cells[facets.cell]
    pressures.x.array[loaded] = total[loaded] / facets.area
    pressures.x.scatter_forward()
    _write_xdmf(str(path), mesh, [shown, pressures])


def write_rough_fields(
    path: Path | str, problem: UnilateralContactProblem, state: UnilateralContactState
) -> None:
    """Write displacements [mm] and contact pressures [MPa] of a rough block as XDMF.

    The pressure of a vertex is its contact force over its tributary area, including its shares of
    the nodes between vertices; the pressure is linear between vertices. Quadratic displacements of
    straight cells are written at the vertices.

    Args:
        path: File to write, ending in ``.xdmf``; an HDF5 file goes beside it.
        problem: The contact problem of the rough block.
        state: The load step.

    Note:
        Collective.
    """
    block, mesh = problem.block, problem.block.mesh.mesh
    # XDMF files hold functions of the degree of the mesh's cells only
    degree = 2 if compat.cell_vertices(mesh).shape[1] == 10 else 1
    displacements = _interpolated(
        compat.vector_space(mesh, degree), block.function(state.displacement), "displacement"
    )
    pressures = _interpolated(
        compat.scalar_space(mesh, degree), _vertex_pressures(problem, state), "pressure"
    )
    _write_xdmf(str(path), mesh, [displacements, pressures])


def _vertex_pressures(problem: UnilateralContactProblem, state: UnilateralContactState) -> Any:
    """Return contact pressures, linear between vertices, zero away from the top [MPa].

    Single nodes of elements of degree 2 have no useful pressures: a vertex of a triangle has no
    tributary area, and one of a square far less than the middle node.
    """
    block, top = problem.block, problem.top
    pressures = fem.Function(compat.scalar_space(block.mesh.mesh, 1))
    vertices, cells = compat.cell_nodes(pressures.function_space), compat.cell_nodes(block.space)
    cell_name = block.mesh.mesh.topology.cell_name()
    shares = compat.lagrange_values(
        cell_name, 1, compat.lagrange_points(cell_name, block.degree)
    )  # weights of the vertices in the nodes of a cell
    shares[shares < _ZERO] = 0.0
    place = np.empty(cells.max(initial=-1) + 1, dtype=np.intp)
    place[cells.ravel()] = np.arange(cells.size)  # one of the cells of each node
    cell, node = np.divmod(place[top.dofs // 3], cells.shape[1])
    numbers = pressures.function_space.dofmap.index_map
    rows = numbers.local_to_global(vertices[cell].ravel()).astype(PETSc.IntType)
    force, area = (
        PETSc.Vec().createMPI((numbers.size_local, None), comm=block.mesh.comm) for _ in range(2)
    )
    for vector, values in ((force, state.nodal_force), (area, top.area)):
        vector.setValues(rows, (shares[node] * values[:, None]).ravel(), addv=True)
        vector.assemble()
    loaded = area.array_r > 0.0
    pressures.x.array[: numbers.size_local][loaded] = force.array_r[loaded] / area.array_r[loaded]
    pressures.x.scatter_forward()
    return pressures


def _interpolated(space: Any, function: Any, name: str) -> Any:
    """Return a function in another space."""
    other = fem.Function(space, name=name)
    other.interpolate(function)
    return other


def _write_xdmf(path: str, mesh: Any, functions: Sequence[Any]) -> None:
    """Write a mesh and functions of its degree, or constant on cells, as XDMF with HDF5."""
    file = io.XDMFFile(mesh.comm, path, "w")
    try:
        file.write_mesh(mesh)
        for function in functions:
            file.write_function(function)
        file.close()
    except RuntimeError:
        # On a full disk it cannot be closed, and its destructor would end the process
        _FILES_NOT_CLOSED.append(file)
        raise
