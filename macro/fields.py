"""Writes the fields of a pressed block for ParaView."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from dolfinx import fem
from numpy.typing import NDArray
from petsc4py import PETSc

from macro import compat
from macro.contact.law_interface import Interface
from macro.contact.unilateral_problem import UnilateralContactProblem
from macro.contact.unilateral_state import UnilateralContactState
from macro.mesh.contact_face import top_facets

Array = NDArray[np.float64]

_NONE = 1e-9  # of a basis function: rounding


def write_fields(
    path: Path | str, interface: Interface, displacement: Array, pressure: Array
) -> None:
    """Write displacements [mm] and patch pressures [MPa] as XDMF, with an HDF5 file beside it.

    Quadratic displacements are written at the vertices. The pressure of a cell is the mean over
    its facet of the top, to which the patches on it contribute by area; it is zero elsewhere. Where
    dolfinx has ADIOS2, displacements of any degree are also written as VTX, in a folder beside it
    that ends in ``.bp``.

    Args:
        path: File to write, ending in ``.xdmf``.
        interface: Patches and block that were pressed.
        displacement: This rank's owned displacements, dof by dof [mm].
        pressure: Mean pressures of the patches, shape (N,) [MPa].

    Note:
        Collective.
    """
    block = interface.block
    mesh = block.mesh.mesh
    moved = block.function(displacement)
    if compat.HAS_VTX:
        compat.write_vtx(str(Path(path).with_suffix(".bp")), moved)
    if block.degree > 1:
        moved = _interpolated(compat.vector_space(mesh, 1), moved, moved.name)
    pressed = fem.Function(compat.cellwise_space(mesh), name="pressure")
    points, facets = interface.quadrature, top_facets(block.mesh)
    cells = compat.cell_nodes(pressed.function_space)[:, 0]
    force = points.weight * pressure[points.patch]
    total = np.bincount(cells[points.cell], force, minlength=len(pressed.x.array))
    loaded = cells[facets.cell]
    pressed.x.array[loaded] = total[loaded] / facets.area
    pressed.x.scatter_forward()
    compat.write_xdmf(str(path), mesh, [moved, pressed])


def write_rough_fields(
    path: Path | str, obstacle: UnilateralContactProblem, state: UnilateralContactState
) -> None:
    """Write displacements [mm] and contact pressures [MPa] of a rough block as XDMF.

    The pressure of a vertex is the contact force there over the tributary area, to which nodes
    between vertices give their parts; values between vertices are linear. Quadratic displacements
    of straight cells are written at the vertices.

    Args:
        path: File to write, ending in ``.xdmf``; an HDF5 file goes beside it.
        obstacle: The rough block that was pressed.
        state: The load step.

    Note:
        Collective.
    """
    block, mesh = obstacle.block, obstacle.block.mesh.mesh
    # files take functions of the degree that cells are bent by, numbered as the mesh is
    degree = 2 if compat.cell_vertices(mesh).shape[1] == 10 else 1
    moved = _interpolated(
        compat.vector_space(mesh, degree), block.function(state.displacement), "displacement"
    )
    pressed = _interpolated(
        compat.scalar_space(mesh, degree), _vertex_pressures(obstacle, state), "pressure"
    )
    compat.write_xdmf(str(path), mesh, [moved, pressed])


def _vertex_pressures(obstacle: UnilateralContactProblem, state: UnilateralContactState) -> Any:
    """Return contact pressures, linear between vertices, zero away from the top [MPa].

    The nodes of an element of degree 2 do not have pressures of their own: its vertices have no
    area in triangles, and a ninth of the middle's in squares.
    """
    block, top = obstacle.block, obstacle.top
    pressed = fem.Function(compat.scalar_space(block.mesh.mesh, 1))
    vertices, cells = compat.cell_nodes(pressed.function_space), compat.cell_nodes(block.space)
    cell_name = block.mesh.mesh.topology.cell_name()
    shares = compat.lagrange_values(
        cell_name, 1, compat.lagrange_points(cell_name, block.degree)
    )  # of the vertices in the nodes of a cell
    shares[shares < _NONE] = 0.0
    place = np.empty(cells.max(initial=-1) + 1, dtype=np.intp)
    place[cells.ravel()] = np.arange(cells.size)  # any cell of a node
    cell, node = np.divmod(place[top.dofs // 3], cells.shape[1])
    numbers = pressed.function_space.dofmap.index_map
    rows = numbers.local_to_global(vertices[cell].ravel()).astype(PETSc.IntType)
    force, area = (
        PETSc.Vec().createMPI((numbers.size_local, None), comm=block.mesh.comm) for _ in range(2)
    )
    for vector, values in ((force, state.nodal_force), (area, top.area)):
        vector.setValues(rows, (shares[node] * values[:, None]).ravel(), addv=True)
        vector.assemble()
    known = area.array_r > 0.0
    pressed.x.array[: numbers.size_local][known] = force.array_r[known] / area.array_r[known]
    pressed.x.scatter_forward()
    return pressed


def _interpolated(space: Any, function: Any, name: str) -> Any:
    """Return a function in another space."""
    other = fem.Function(space, name=name)
    other.interpolate(function)
    return other
