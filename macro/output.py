"""Writes the fields of a pressed block for ParaView."""

from __future__ import annotations

from pathlib import Path

from dolfinx import fem

from macro import compat
from macro.interface import Interface
from macro.pressed import PressState


def write_fields(path: Path | str, interface: Interface, state: PressState) -> None:
    """Write displacements [mm] and patch pressures [MPa] as XDMF, with an HDF5 file beside it.

    Quadratic displacements are written at the vertices. The pressure of a patch colours the cells
    under it; it is zero elsewhere.

    Args:
        path: File to write, ending in ``.xdmf``.
        interface: Patches and block that were pressed.
        state: Equilibrium to write.

    Note:
        Collective.
    """
    block = interface.block
    mesh = block.mesh.mesh
    displacement = block.function(state.displacement)
    if block.degree > 1:
        linear = fem.Function(compat.vector_space(mesh, 1), name=displacement.name)
        linear.interpolate(displacement)
        displacement = linear
    pressure = fem.Function(compat.cellwise_space(mesh), name="pressure")
    points = interface.quadrature
    cells = compat.cell_nodes(pressure.function_space)[:, 0]
    pressure.x.array[cells[points.cell]] = state.pressure[points.patch]
    pressure.x.scatter_forward()
    compat.write_xdmf(str(path), mesh, [displacement, pressure])
