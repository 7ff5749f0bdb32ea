"""Meshes in gmsh's own files, as arrays."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.errors import InputError
from geometry.meshes.gmsh_elements import Elements, elements_of, properties
from geometry.meshes.gmsh_session import gmsh_session

Array = NDArray[np.float64]
Table = NDArray[np.int64]

_STRAIGHT = 1e-6
"""Distance of a node within a cell from its place on straight edges, relative to the cell."""

_ALLOWED = "tetrahedra alone, or hexahedra alone"

_CORNERS = {"Tetrahedron": [0, 1, 2, 3], "Hexahedron": [0, 1, 3, 2, 4, 5, 7, 6]}
"""Corners of gmsh's cells in the order of dolfinx; those of hexahedra form a tensor product."""

_FACETS = {"Tetrahedron": (3, "Triangle"), "Hexahedron": (4, "Quadrilateral")}
"""Corners and name of the facets of a cell."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MeshArrays:
    """A whole mesh of straight tetrahedra or hexahedra, with the groups of its cells and facets.

    Attributes:
        points: Nodes that cells use, shape (n, 3), in the unit of the file.
        cells: Nodes of the cells in the order of dolfinx, shape (m, 4 or 8).
        cell_tags: Group of every cell, shape (m,).
        facets: Nodes of the facets that have a group, shape (k, 3 or 4); −1 where no cell has one.
        facet_tags: Their groups, shape (k,).
        cell_names: Tags by the names of the cells' groups; groups without a name have their number.
        facet_names: Tags by the names of the facets' groups, in the same way.
    """

    points: Array
    cells: Table
    cell_tags: NDArray[np.int32]
    facets: Table
    facet_tags: NDArray[np.int32]
    cell_names: dict[str, int]
    facet_names: dict[str, int]


def read_gmsh_file(path: Path) -> MeshArrays:
    """Read a mesh from gmsh's file, of format 2 or 4, text or binary.

    The physical groups of volumes and surfaces give tags and names. Where a file has no physical
    group of volumes, their own numbers are the tags; surfaces in the same way.

    Args:
        path: The file.

    Raises:
        InputError: When it is no such file, or holds no mesh of tetrahedra alone or hexahedra alone
            with straight edges, or when a volume or a surface has two groups.
    """
    _check_format(path)
    with gmsh_session("mesh of a file") as gmsh:
        try:
            gmsh.merge(str(path))
        except Exception as error:  # gmsh raises nothing more special
            raise InputError(f"gmsh cannot read it: {error}", file=str(path)) from error
        try:
            return _arrays(gmsh)
        except InputError as error:
            raise error.located(file=str(path)) from error


def _check_format(path: Path) -> None:
    """Refuse what is no mesh by its first lines; gmsh would take it for a script and run it."""
    try:
        with path.open("rb") as file:
            start = file.read(4096)
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", file=str(path)) from error
    if not start.strip():
        raise InputError("the file is empty", file=str(path))
    allowed = "a mesh of gmsh, format 2 or 4, beginning with $MeshFormat"
    first = [line.strip() for line in start.split(b"\n")]
    if b"$MeshFormat" not in first or not start.lstrip().startswith(b"$"):
        raise InputError("this is no mesh of gmsh", file=str(path), allowed=allowed)
    version = first[first.index(b"$MeshFormat") + 1 :][:1]
    number = version[0].split(b" ")[0].decode("ascii", "replace") if version else ""
    if number[:1] not in ("2", "4"):
        raise InputError("unknown format", value=number, file=str(path), allowed=allowed)


def _arrays(gmsh: Any) -> MeshArrays:
    """Return the mesh of the current model."""
    kind, cells = _cells(gmsh)
    name, order, count, inner, corners = properties(gmsh, kind)
    numbers, places, _ = gmsh.model.mesh.getNodes()
    sorting = np.argsort(numbers)
    numbers, points = numbers[sorting], np.reshape(places, (-1, 3))[sorting]
    table = np.searchsorted(numbers, cells.nodes[kind])
    if order > 1:
        _check_straight(points[table], corners, np.reshape(inner, (count, 3)))
    table = table[:, _CORNERS[name]]
    _check_repeated(table)

    sides, facet = _FACETS[name]
    faces = elements_of(gmsh, 2)
    fitting = [kind for kind in faces.nodes if properties(gmsh, kind)[0] == facet]
    facets = np.concatenate(
        [np.empty((0, sides), numbers.dtype), *(faces.nodes[kind][:, :sides] for kind in fitting)]
    )
    tags = np.concatenate([np.empty(0, np.int32), *(faces.tags[kind] for kind in fitting)])
    rows = np.searchsorted(numbers, facets)
    used = np.zeros(len(points), dtype=bool)  # nodes of arcs' centres and of other things do not
    used[table] = True
    renumbered = np.where(used, np.cumsum(used) - 1, -1)
    return MeshArrays(
        points=points[used],
        cells=renumbered[table],
        cell_tags=cells.tags[kind],
        facets=renumbered[rows],
        facet_tags=tags,
        cell_names=cells.names,
        facet_names=faces.names,
    )


def _cells(gmsh: Any) -> tuple[int, Elements]:
    """Return the cells and their one kind."""
    cells = elements_of(gmsh, 3)
    kinds = {kind: properties(gmsh, kind)[0] for kind in cells.nodes}
    found = ", ".join(f"{len(cells.tags[kind])} × {kinds[kind].lower()}" for kind in kinds)
    if not kinds:
        flat = any(len(tags) for tags in elements_of(gmsh, 2).tags.values())
        problem = "is two-dimensional, it has surfaces only" if flat else "has no cells"
        raise InputError(f"the mesh {problem}", allowed=_ALLOWED)
    if len(kinds) > 1:
        raise InputError(f"the mesh has cells of several kinds: {found}", allowed=_ALLOWED)
    ((kind, name),) = kinds.items()
    if name not in _CORNERS:
        raise InputError(f"the mesh has cells of another kind: {found}", allowed=_ALLOWED)
    return kind, cells


def _check_straight(nodes: Array, corners: int, places: Array) -> None:
    """Refuse cells of higher order, nodes (m, count, 3), unless their edges and faces are flat."""
    ends = places[:corners]
    if corners == 4:
        values = np.column_stack([1.0 - places.sum(axis=1), places])
    else:
        values = np.prod(0.5 * (1.0 + places[:, None] * ends), axis=2)
    straight = np.einsum("qk,mkj->mqj", values, nodes[:, :corners])
    size = np.ptp(nodes[:, :corners], axis=1).max(axis=1)
    off = np.abs(nodes - straight).max(axis=(1, 2)) > _STRAIGHT * size
    if off.any():
        raise InputError(
            f"{off.sum()} of {len(off)} cells are of second or higher order with curved edges; "
            'make a mesh of first order: element = "quadratic" gives quadratic displacements on it',
            allowed="cells with straight edges",
        )


def _check_repeated(cells: Table) -> None:
    """Refuse cells that stand in the mesh twice, such as those written once for every group."""
    odd = np.uint64(0x9E3779B97F4A7C15)
    mixed = (cells.astype(np.uint64) + np.uint64(1)) * odd
    mixed = (mixed ^ (mixed >> np.uint64(29))) * odd
    key = (mixed ^ (mixed >> np.uint64(32))).sum(axis=1)  # the same for any order of the nodes
    order = np.argsort(key)
    alike = key[order[1:]] == key[order[:-1]]
    first, second = (np.sort(cells[part[alike]], axis=1) for part in (order[1:], order[:-1]))
    count = int((first == second).all(axis=1).sum())
    if count:
        raise InputError(
            f"{count} cells stand in the mesh more than once; a volume may be in one physical group"
        )
