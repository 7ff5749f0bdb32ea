"""Writes contact stiffness as springs of CalculiX and Abaqus, and in Matrix Market's format."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from scipy.sparse import csr_array

from patchlaw.macro import compat
from patchlaw.support.arguments import Has, checked
from patchlaw.support.arrays import Array, Indices
from patchlaw.support.errors import InputError
from patchlaw.support.files import write_text
from patchlaw.support.parallel import on_root

Assembled = Annotated[Any, Has("an assembled matrix of PETSc", ("getValuesCSR",))]

_SKEW = 1e-12
"""Difference of a stiffness from its transpose, over its largest entry, that is rounding."""


@checked
def write_contact_stiffness(path: str | Path, stiffness: Assembled, space: compat.Space) -> None:
    """Write a contact stiffness for other programs, by the ending of the file.

    ``.inp``: springs of CalculiX and Abaqus that have together this matrix, SPRING1 from a node to
    ground and SPRING2 between two displacements, for a deck whose nodes have the numbers of the
    mesh's file. ``.mtx``: the matrix in Matrix Market's format. Both state the numbers and places
    of the nodes in comments; the unknown of displacement i of the node in row k there is 3 k + i.

    Args:
        path: File to write, ending in ``.inp`` or ``.mtx``.
        stiffness: What `Interface.stiffness_matrix` returned [N/mm].
        space: The space of the displacements.

    Raises:
        InputError: For another ending, or a plane or mixed space; for springs of a matrix that is
            not symmetric.

    Note:
        Collective; rank 0 writes.
    """
    path = Path(path)
    if path.suffix not in (".inp", ".mtx"):
        problem = "is no format of a stiffness"
        raise InputError(problem, key="path", value=path.name, allowed=".inp or .mtx")
    if space.dofmap.index_map_bs != 3:
        raise InputError(
            "springs are written for displacements alone, on meshes of three dimensions",
            key="space",
            value=str(space.ufl_element()),
            allowed="such a space",
        )
    starts, columns, entries = stiffness.getValuesCSR()
    first = stiffness.getOwnershipRange()[0]
    rows = np.repeat(np.arange(len(starts) - 1), np.diff(starts)) + first
    own = len(starts) // 3
    places = space.tabulate_dof_coordinates()[:own]
    parts = space.mesh.comm.gather((rows, columns, entries, node_numbers(space)[:own], places))

    def write() -> None:
        row, column, entry, number, place = (
            np.concatenate(one) for one in zip(*parts, strict=True)
        )
        matrix = csr_array((entry, (row, column)), shape=(3 * len(number),) * 2)
        used = np.unique(np.concatenate([row[entry != 0.0], column[entry != 0.0]]) // 3)
        dofs = (3 * used[:, None] + np.arange(3)).ravel()
        lines = (_springs if path.suffix == ".inp" else _matrix_market)(
            csr_array(matrix[dofs][:, dofs]), number[used], place[used]
        )
        write_text(path, "\n".join(lines) + "\n")

    on_root(space.mesh.comm, write)


def node_numbers(space: Any) -> Indices:
    """Return the numbers of this rank's nodes, ghosts included, in the file of the mesh, from 1.

    Nodes of quadratic displacements that a mesh of straight cells has not follow behind all others.

    Args:
        space: Space of the displacements.

    Note:
        Collective.
    """
    mesh, nodes = space.mesh, space.dofmap.index_map
    given = np.asarray(mesh.geometry.input_global_indices)
    total = max(mesh.comm.allgather(int(given.max(initial=-1)))) + 1
    numbers = nodes.local_to_global(np.arange(nodes.size_local + nodes.num_ghosts, dtype=np.int32))
    numbers = np.asarray(numbers) + total + 1
    vertices, cells = compat.cell_vertices(mesh), compat.cell_nodes(space)
    shared = min(vertices.shape[1], cells.shape[1])
    numbers[cells[:, :shared]] = given[vertices[:, :shared]] + 1
    return numbers


def _nodes(numbers: Indices, places: Array, mark: str) -> Iterator[str]:
    yield f"{mark} row, node, x, y, z [mm]"
    for row, (number, place) in enumerate(zip(numbers, places, strict=True)):
        yield f"{mark} {row}, {number}, " + ", ".join(f"{each:.9g}" for each in place)


def _matrix_market(matrix: csr_array, numbers: Indices, places: Array) -> Iterator[str]:
    entries = matrix.tocoo()
    yield "%%MatrixMarket matrix coordinate real general"
    yield "% stiffness of the contact [N/mm]"
    yield from _nodes(numbers, places, "%")
    yield f"{matrix.shape[0]} {matrix.shape[1]} {entries.nnz}"
    triples = zip(entries.row, entries.col, entries.data, strict=True)
    yield from (f"{i + 1} {j + 1} {value:.17g}" for i, j, value in triples)


def _springs(matrix: csr_array, numbers: Indices, places: Array) -> Iterator[str]:
    """Yield springs: −K_ij between two displacements, and the sums of the rows to ground."""
    # out of contact there are no entries
    largest = np.abs(matrix.data).max(initial=0.0)
    if np.abs((matrix - matrix.T).data).max(initial=0.0) > _SKEW * largest:
        raise InputError(
            "is not symmetric, as that of a face that slides, and no springs have it",
            value=".inp",
            allowed=".mtx, or the stiffness of a face that sticks",
        )
    yield "** stiffness of the contact [N/mm], as springs; put it into the model, before steps"
    yield from _nodes(numbers, places, "**")
    ground = np.asarray(matrix.sum(axis=1)).ravel()
    entries, begin = matrix.tocoo(), _FIRST_ELEMENT
    pairs = [
        (i, j, -value)
        for i, j, value in zip(entries.row, entries.col, entries.data, strict=True)
        if i < j and abs(value) > _SKEW * largest
    ]
    alone = [(i, value) for i, value in enumerate(ground) if abs(value) > _SKEW * largest]
    for k, (i, value) in enumerate(alone, begin):
        yield f"*ELEMENT, TYPE=SPRING1, ELSET=CONTACT_{k}\n{k}, {numbers[i // 3]}"
        yield f"*SPRING, ELSET=CONTACT_{k}\n{i % 3 + 1}\n{value:.13e}"
    for k, (i, j, value) in enumerate(pairs, begin + len(alone)):
        yield f"*ELEMENT, TYPE=SPRING2, ELSET=CONTACT_{k}"
        yield f"{k}, {numbers[i // 3]}, {numbers[j // 3]}"
        yield f"*SPRING, ELSET=CONTACT_{k}\n{i % 3 + 1}, {j % 3 + 1}\n{value:.13e}"


_FIRST_ELEMENT = 10_000_001
"""Number of the first spring, beyond those of the elements of a deck."""
