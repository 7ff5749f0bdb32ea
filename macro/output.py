"""Writes the fields of a pressed block for ParaView."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from dolfinx import fem
from numpy.typing import NDArray

from macro import compat
from macro.interface import Interface

Array = NDArray[np.float64]


def write_fields(
    path: Path | str, interface: Interface, displacement: Array, pressure: Array
) -> None:
    """Write displacements [mm] and patch pressures [MPa] as XDMF, with an HDF5 file beside it.

    Quadratic displacements are written at the vertices. The pressure of a patch colours the cells
    under it; it is zero elsewhere. Where dolfinx has ADIOS2, displacements of any degree are also
    written as VTX, in a folder beside it that ends in ``.bp``.

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
        linear = fem.Function(compat.vector_space(mesh, 1), name=moved.name)
        linear.interpolate(moved)
        moved = linear
    pressed = fem.Function(compat.cellwise_space(mesh), name="pressure")
    points = interface.quadrature
    cells = compat.cell_nodes(pressed.function_space)[:, 0]
    pressed.x.array[cells[points.cell]] = pressure[points.patch]
    pressed.x.scatter_forward()
    compat.write_xdmf(str(path), mesh, [moved, pressed])
