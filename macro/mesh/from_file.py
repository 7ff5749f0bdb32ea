"""Meshes of a body from the user's files."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from geometry.meshes.gmsh_file import MeshArrays, read_gmsh_file
from macro import compat
from macro.mesh.checks import check_cells, check_connected
from macro.mesh.tagged import TaggedMesh
from macro.mesh.tagging import cell_tags, facet_tags
from macro.mesh.xdmf import read_xdmf
from support.collective import on_root
from support.errors import InputError


def read_mesh(path: str | Path, comm: Any, *, unit: float = 1.0) -> TaggedMesh:
    """Read a body's mesh from a file, distributed over all ranks.

    Two kinds of files are read. Those of gmsh, ``.msh`` of format 2 or 4, text or binary, keep the
    names of their physical groups; gmsh reads them on rank 0. Those of dolfinx, ``.xdmf`` with a
    mesh, tags of facets and tags of cells in one file, have numbers for names; all ranks read them.

    Args:
        path: The file.
        comm: MPI communicator that the mesh will live on.
        unit: Millimetres per unit of length of the file.

    Raises:
        InputError: On all ranks, when the file cannot be read, when it holds no mesh of straight
            tetrahedra or hexahedra alone, when cells are inverted or without volume, when the mesh
            is in several parts, or when a facet or a cell has two tags.

    Note:
        Collective.
    """
    if not (math.isfinite(unit) and unit > 0.0):
        raise InputError("the unit of a mesh is no length", value=unit, allowed="a positive number")
    path = Path(path)
    readers = {".msh": _from_gmsh, ".xdmf": read_xdmf}
    reader = readers.get(path.suffix.lower())
    if reader is None:
        raise InputError(
            "meshes in this format are not read",
            value=path.suffix,
            file=str(path),
            allowed=".msh of gmsh, .xdmf of dolfinx",
        )
    on_root(comm, lambda: _check_there(path))
    try:
        tagged = reader(path, comm)
        tagged.mesh.geometry.x[:] *= unit
        check_cells(tagged)
        check_connected(tagged)
    except InputError as error:
        raise error.located(file=str(path)) from error
    return tagged


def _check_there(path: Path) -> None:
    if not path.is_file():
        raise InputError("there is no such file", file=str(path))


def _from_gmsh(path: Path, comm: Any) -> TaggedMesh:
    """Distribute what gmsh reads on rank 0."""
    whole: list[MeshArrays] = []
    on_root(comm, lambda: whole.append(read_gmsh_file(path)))

    def marks() -> tuple[Any, ...]:
        of = whole[0]
        tables = of.facets, of.facet_tags, of.cell_tags
        return of.cells.shape[1], *tables, of.facet_names, of.cell_names

    corners, facets, tags_of_facets, tags_of_cells, facet_names, cell_names = on_root(comm, marks)
    cells, points = np.empty((0, corners), np.int64), np.empty((0, 3))
    if whole:
        cells, points = whole[0].cells, whole[0].points
    mesh = compat.partitioned_mesh(cells, points, comm)
    return TaggedMesh(
        mesh=mesh,
        facet_tags=facet_tags(mesh, facets, tags_of_facets, facet_names),
        cell_tags=cell_tags(mesh, tags_of_cells),
        facet_names=facet_names,
        cell_names=cell_names,
    )
