"""Checks of a body's mesh: cells that are valid and hang together, and a plausible size."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from macro import compat
from macro.mesh.facets import facets_between_ranks, inner_facets, parts
from macro.mesh.tagged import TaggedMesh
from support.arrays import Array
from support.errors import InputError

_CHUNK = 1 << 14
"""Cells that are checked at a time, which bounds the memory to 10 MB."""

_SMALL, _LARGE = 1.0, 2.0e4
"""Diagonals of bodies beyond which the unit of their mesh is in doubt [mm]."""


def check_cells(tagged: TaggedMesh) -> None:
    """Refuse nodes that are no points, and cells inside out, folded or without volume.

    The nodes of a cell may be numbered right-handed or left-handed. Where both are found, two cells
    at a facet must lie on either side of it.

    Args:
        tagged: The mesh.

    Raises:
        InputError: On all ranks.

    Note:
        Collective.
    """
    mesh, comm = tagged.mesh, tagged.comm
    if not all(comm.allgather(bool(np.isfinite(mesh.geometry.x).all()))):
        raise InputError("the mesh has nodes whose coordinates are not finite")
    vertices = compat.cell_vertices(mesh)[: mesh.topology.index_map(3).size_local]
    quality, hands = np.empty(len(vertices)), np.empty(len(vertices))
    for start in range(0, len(vertices), _CHUNK):
        part = slice(start, start + _CHUNK)
        quality[part], hands[part] = _volumes(mesh.geometry.x[vertices[part]])
    bad = quality <= 1e-8  # of the product of the edges
    handedness = {hand for hands_there in comm.allgather(set(hands[~bad])) for hand in hands_there}
    if len(handedness) > 1:
        bad |= _folded(mesh, vertices)
    _refuse(comm, bad, mesh, vertices)


def _refuse(comm: Any, bad: NDArray[np.bool_], mesh: Any, vertices: NDArray[np.int32]) -> None:
    """Raise an error that counts the bad cells and shows the place of one of them."""
    first = mesh.geometry.x[vertices[np.argmax(bad)]].mean(axis=0).tolist() if bad.any() else None
    told = comm.allgather((int(bad.sum()), len(bad), first))
    count, cells = (sum(part[k] for part in told) for k in (0, 1))
    if count:
        place = ", ".join(f"{value:.4g}" for value in min(part[2] for part in told if part[0]))
        raise InputError(
            f"{count} of {cells} cells of the mesh are inside out or have no volume; one is at "
            f"({place}) mm"
        )


def _volumes(x: Array) -> tuple[Array, Array]:
    """Return the least relative volume at a node of each cell, and its hand.

    Args:
        x: Nodes of the cells, shape (n, 4, 8, 10 or 27, 3).
    """
    if x.shape[1] in (10, 27):
        name = {10: "tetrahedron", 27: "hexahedron"}[x.shape[1]]
        slopes = compat.lagrange_gradients(name, 2)
        volumes = np.linalg.det(np.einsum("qmk,nmi->nqki", slopes, x))
        hand, size = np.sign(volumes.sum(axis=1)), np.ptp(x, axis=1).prod(axis=1)
        return (hand[:, None] * volumes).min(axis=1) / np.where(size > 0.0, size, 1.0), hand
    if x.shape[1] == 4:
        lengths = np.linalg.norm(x[:, :, None] - x[:, None], axis=3) + np.eye(4)
        volume = np.linalg.det(x[:, 1:] - x[:, :1])
        size = lengths.prod(axis=2).min(axis=1)
        return np.abs(volume) / np.where(size > 0.0, size, 1.0), np.sign(volume)
    corner = np.arange(8)
    edges = np.stack([x[:, corner ^ bit] - x for bit in (1, 2, 4)], axis=2)
    turned = np.prod([1 - 2 * ((corner >> k) & 1) for k in range(3)], axis=0)
    volumes = np.linalg.det(edges) * turned
    hand = np.sign(volumes.sum(axis=1))
    size = np.linalg.norm(edges, axis=3).prod(axis=2)
    return (hand[:, None] * volumes / np.where(size > 0.0, size, 1.0)).min(axis=1), hand


def _folded(mesh: Any, vertices: NDArray[np.int32]) -> NDArray[np.bool_]:
    """Return which of this rank's cells lie on the same side of a facet as their neighbour."""
    _, shapes = compat.reference_facets(mesh.topology.cell_name())
    points = np.asarray(mesh.geometry.input_global_indices, dtype=np.int64)

    def side_of(cell: NDArray[np.int64], side: NDArray[np.int64]) -> Array:
        """Return on which side of the plane through three nodes of a facet the cells lie."""
        rows = np.take_along_axis(vertices[cell], shapes[side], axis=1)
        rows = np.take_along_axis(rows, np.argsort(points[rows], axis=1), axis=1)
        corner = mesh.geometry.x[rows[:, :3]]
        inside = mesh.geometry.x[vertices[cell]].mean(axis=1) - corner[:, 0]
        u, v = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
        return np.sign(np.einsum("ni,ni->n", np.cross(u, v), inside))

    folded = np.zeros(len(vertices), dtype=bool)
    cells, sides = inner_facets(mesh)
    folded[cells[side_of(cells[:, 0], sides[:, 0]) == side_of(cells[:, 1], sides[:, 1])]] = True
    facet, cell, side = facets_between_ranks(mesh)
    own = side_of(cell, side)
    ends = mesh.comm.allgather((facet, own))
    number, signs = (np.concatenate([end[k] for end in ends]) for k in (0, 1))
    _, row = np.unique(number, return_inverse=True)
    both = np.bincount(row.ravel(), signs)[row.ravel()]  # two cells on either side cancel
    start = sum(len(end[0]) for end in ends[: mesh.comm.rank])
    folded[cell[both[start : start + len(cell)] != 0.0]] = True
    return folded


def check_connected(tagged: TaggedMesh) -> None:
    """Refuse a mesh whose cells do not hang together by their facets.

    Args:
        tagged: The mesh.

    Raises:
        InputError: On all ranks, with the number of parts and their cells.

    Note:
        Collective.
    """
    sizes = parts(tagged.mesh)
    if len(sizes) > 1:
        shown = ", ".join(str(size) for size in sizes[:5]) + ", …" * (len(sizes) > 5)
        raise InputError(
            f"the mesh is in {len(sizes)} parts that share no facets, of {shown} cells; where "
            "volumes touch they must share nodes (in gmsh: fragment them before meshing)",
            allowed="one connected body",
        )


def size_note(tagged: TaggedMesh, *, key: str | None = None) -> str | None:
    """Return a note where the size of the mesh suggests that its unit was mistaken, else None.

    Args:
        tagged: The mesh [mm].
        key: Key of the scene that says the unit, for the error.

    Raises:
        InputError: On all ranks, when only a wrong unit gives such a size.

    Note:
        Collective.
    """
    lower, upper = tagged.bounding_box()
    lengths, size = upper - lower, float(np.linalg.norm(upper - lower))
    least, most = 1e-4, 1e7
    if not least <= size <= most:
        raise InputError(
            f"the body's mesh would be {size:.3g} mm large",
            key=key,
            allowed=f"a unit that makes it {least:g} … {most:g} mm large",
        )
    if _SMALL <= size <= _LARGE:
        return None
    sides = " × ".join(f"{length:.4g}" for length in lengths)
    guess = '"m"' if size < _SMALL else '"mm" or "um"'
    return f"the mesh of the body is {sides} mm large; is its unit right? (mesh_unit = {guess}?)"
