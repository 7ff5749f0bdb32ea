"""Writes the fields of a pressed block for ParaView."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from dolfinx import fem
from numpy.typing import NDArray

from macro import compat
from macro.interface import Interface
from macro.obstacle import ObstacleBlock
from macro.obstacle_state import ObstacleState

Array = NDArray[np.float64]


def write_fields(
    path: Path | str, interface: Interface, displacement: Array, pressure: Array
) -> None:
    """Write displacements [mm] and patch pressures [MPa] as XDMF, with an HDF5 file beside it.

    Quadratic displacements are written at the vertices. The pressure of a patch colours the cells
    under it; it is zero elsewhere.

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
    if block.degree > 1:
        moved = _interpolated(compat.vector_space(mesh, 1), moved, moved.name)
    pressed = fem.Function(compat.cellwise_space(mesh), name="pressure")
    points = interface.quadrature
    cells = compat.cell_nodes(pressed.function_space)[:, 0]
    pressed.x.array[cells[points.cell]] = pressure[points.patch]
    pressed.x.scatter_forward()
    compat.write_xdmf(str(path), mesh, [moved, pressed])


def write_rough_fields(path: Path | str, obstacle: ObstacleBlock, state: ObstacleState) -> None:
    """Write displacements [mm] and contact pressures [MPa] of a rough block as XDMF.

    The pressure of a node of the top is its contact force over its tributary area. Quadratic
    functions on straight cells are written at the vertices.

    Args:
        path: File to write, ending in ``.xdmf``; an HDF5 file goes beside it.
        obstacle: The rough block that was pressed.
        state: The load step.

    Note:
        Collective.
    """
    block, top = obstacle.block, obstacle.top
    upright = np.zeros(block.owned_dofs)
    upright[top.dofs] = state.pressing / top.area
    mesh, degree = block.mesh.mesh, 1 if block.mesh.shape.hexahedral else block.degree
    moved = _interpolated(
        compat.vector_space(mesh, degree), block.function(state.displacement), "displacement"
    )
    # files take functions numbered as the mesh is, which parts of a vector need not be
    pressed = _interpolated(
        compat.scalar_space(mesh, degree), block.function(upright).sub(2).collapse(), "pressure"
    )
    compat.write_xdmf(str(path), mesh, [moved, pressed])


def _interpolated(space: Any, function: Any, name: str) -> Any:
    """Return a function in another space."""
    other = fem.Function(space, name=name)
    other.interpolate(function)
    return other
