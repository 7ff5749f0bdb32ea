"""Elements of a gmsh model with their groups."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.errors import InputError

Array = NDArray[np.float64]
Table = NDArray[np.uint64]

NO_GROUP = 0
"""Tag of cells without a physical group, where other cells have one; its name is the number."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Elements:
    """Elements of one dimension.

    Attributes:
        nodes: Nodes by gmsh's numbers, shape (m, nodes of an element), for every kind of element.
        tags: Group of every element, shape (m,), for every kind.
        names: Tags by the names of the groups; groups without a name have their number.
    """

    nodes: dict[int, Table]
    tags: dict[int, NDArray[np.int32]]
    names: dict[str, int]


def elements_of(gmsh: Any, dimension: int) -> Elements:
    """Return the elements of all volumes, or of the surfaces that have a group.

    The physical groups are the tags. Where the model has none of the dimension, the numbers of the
    volumes or surfaces themselves are.

    Args:
        gmsh: The gmsh module, the model its current one.
        dimension: 3 for volumes, 2 for surfaces.

    Raises:
        InputError: When a volume or a surface has two groups, or two groups have one name.
    """
    model = gmsh.model
    entities = [tag for _, tag in model.getEntities(dimension)]
    groups = {tag: model.getPhysicalGroupsForEntity(dimension, tag) for tag in entities}
    names = _names(model, dimension, entities)
    grouped = bool(model.getPhysicalGroups(dimension))
    nodes: dict[int, list[Table]] = {}
    tags: dict[int, list[NDArray[np.int32]]] = {}
    for entity in entities:
        own = [abs(int(tag)) for tag in groups[entity]] if grouped else [entity]
        kinds, _, numbers = model.mesh.getElements(dimension, entity)
        if len(set(own)) > 1 and len(kinds):
            several = " and ".join(repr(name) for name, tag in names.items() if tag in own)
            kind = "volume" if dimension == 3 else "surface"
            raise InputError(
                f"{kind} {entity} of the mesh is in several physical groups: {several}",
                allowed=f"at most one group for a {kind}",
            )
        if not own and dimension == 2:
            continue
        for kind, table in zip(kinds, numbers, strict=True):
            count = properties(gmsh, kind)[2]
            nodes.setdefault(kind, []).append(np.reshape(table, (-1, count)))
            tag = np.full(len(table) // count, own[0] if own else NO_GROUP, np.int32)
            tags.setdefault(kind, []).append(tag)
    if any(np.any(part == NO_GROUP) for parts in tags.values() for part in parts):
        names[str(NO_GROUP)] = NO_GROUP
    return Elements(
        nodes={kind: np.concatenate(parts) for kind, parts in nodes.items()},
        tags={kind: np.concatenate(parts) for kind, parts in tags.items()},
        names=names,
    )


def properties(gmsh: Any, kind: int) -> tuple[str, int, int, Array, int]:
    """Return what gmsh knows of a kind of element.

    Args:
        gmsh: The gmsh module.
        kind: Its number of the kind.

    Returns:
        The family, such as ``Tetrahedron``; the order; the number of nodes; their coordinates in
        the reference element, one after the other; the number of corners.
    """
    name, _, order, count, places, corners = gmsh.model.mesh.getElementProperties(kind)
    return name.split(" ")[0], order, count, np.asarray(places), corners


def _names(model: Any, dimension: int, entities: list[int]) -> dict[str, int]:
    """Return the tags by the names of the physical groups, or of the entities if there are none."""
    groups = [tag for _, tag in model.getPhysicalGroups(dimension)]
    if not groups:
        return {str(tag): tag for tag in entities}
    names: dict[str, int] = {}
    for tag in groups:
        name = model.getPhysicalName(dimension, tag) or str(tag)
        if name in names:
            raise InputError(
                f"physical groups {names[name]} and {tag} have the same name", value=name
            )
        names[name] = tag
    return names
