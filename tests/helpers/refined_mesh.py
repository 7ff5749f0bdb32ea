"""Uniform refinement of meshes as arrays: every cell into eight, every facet into four."""

from dataclasses import replace

import numpy as np

from macro import TaggedMesh, compat
from macro.mesh.from_file import cell_tags, facet_tags

# the octahedron that is left of a tetrahedron is cut along the middles of (0, 2) and (1, 3)
_TETRAHEDRA = [
    ["0", "01", "02", "03"], ["01", "1", "12", "13"], ["02", "12", "2", "23"],
    ["03", "13", "23", "3"], ["01", "02", "03", "13"], ["01", "02", "12", "13"],
    ["02", "03", "13", "23"], ["02", "12", "13", "23"],
]  # fmt: skip
_TRIANGLES = [["0", "01", "02"], ["01", "1", "12"], ["02", "12", "2"], ["01", "12", "02"]]
_QUADRILATERALS = [
    ["0", "01", "0123", "03"], ["1", "12", "0123", "01"],
    ["2", "23", "0123", "12"], ["3", "03", "0123", "23"],
]  # fmt: skip


def _hexahedra():
    """Return the corners of the eight parts by the corners of the cell that they lie between."""

    def name(place):
        chosen = [[0] if at == 0 else [1] if at == 2 else [0, 1] for at in place]
        return "".join(
            str(i + 2 * j + 4 * k) for k in chosen[2] for j in chosen[1] for i in chosen[0]
        )

    corners = [(i, j, k) for k in (0, 1) for j in (0, 1) for i in (0, 1)]
    return [[name(np.add(part, corner)) for corner in corners] for part in corners]


def refined(mesh):
    """Return `MeshArrays` refined once; edges stay straight."""
    cells, facets = (_TETRAHEDRA, _TRIANGLES), (_hexahedra(), _QUADRILATERALS)
    cells, facets = cells if mesh.cells.shape[1] == 4 else facets
    keys = [_keys(mesh.cells, cells), _keys(mesh.facets, facets)]
    nodes, which = np.unique(np.concatenate(keys), axis=0, return_inverse=True)
    which = which.ravel()
    used = nodes >= 0
    points = np.einsum("nk,nkj->nj", used, mesh.points[nodes]) / used.sum(axis=1)[:, None]
    count = len(keys[0])
    return replace(
        mesh,
        points=points,
        cells=which[:count].reshape(-1, mesh.cells.shape[1]),
        cell_tags=np.repeat(mesh.cell_tags, len(cells)),
        facets=which[count:].reshape(-1, mesh.facets.shape[1]),
        facet_tags=np.repeat(mesh.facet_tags, len(facets)),
    )


def _keys(rows, parts):
    """Return the old nodes between which every new one lies, ascending behind −1, (n, 8)."""
    keys = np.full((len(rows), len(parts), len(parts[0]), 8), -1, dtype=np.int64)
    for number, part in enumerate(parts):
        for corner, name in enumerate(part):
            keys[:, number, corner, : len(name)] = rows[:, [int(digit) for digit in name]]
    return np.sort(keys, axis=-1).reshape(-1, 8)


def tagged(arrays, comm):
    """Return a mesh from arrays, all of which rank 0 has."""
    own = arrays if comm.rank == 0 else replace(
        arrays, cells=arrays.cells[:0], points=arrays.points[:0]
    )  # fmt: skip
    mesh = compat.mesh_from_cells(own.cells, own.points, None, comm)
    return TaggedMesh(
        mesh=mesh,
        facet_tags=facet_tags(mesh, arrays.facets, arrays.facet_tags, arrays.facet_names),
        cell_tags=cell_tags(mesh, arrays.cell_tags),
        facet_names=arrays.facet_names,
        cell_names=arrays.cell_names,
    )
