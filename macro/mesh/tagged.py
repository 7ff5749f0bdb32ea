"""A mesh of any body with marked facets and cells."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches
from typing import Any

import numpy as np
from numpy.typing import NDArray

from support.errors import InputError

Array = NDArray[np.float64]

_SHOWN = 12
"""Names that a message lists."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TaggedMesh:
    """A body's mesh, distributed over the ranks of a communicator.

    Args:
        mesh: The dolfinx mesh, of tetrahedra or hexahedra; lengths in mm.
        facet_tags: Tags of this rank's facets, those of ghost cells included or not.
        cell_tags: Tags of this rank's cells, ghosts included; None where nothing tells cells apart.
        facet_names: Tags of facets by name.
        cell_names: Tags of cells by name.

    Raises:
        InputError: When the mesh is not three-dimensional, has other cells, or the tags are those
            of something else.
    """

    mesh: Any
    facet_tags: Any
    cell_tags: Any = None
    facet_names: Mapping[str, int] = field(default_factory=dict)
    cell_names: Mapping[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        name = self.mesh.topology.cell_name()
        if name not in ("tetrahedron", "hexahedron"):
            raise InputError(
                "the mesh of a body has cells that do not fit",
                value=name,
                allowed="tetrahedra or hexahedra",
            )
        for tags, dimension, what in ((self.facet_tags, 2, "facet"), (self.cell_tags, 3, "cell")):
            if tags is not None and tags.dim != dimension:
                raise InputError(
                    f"the {what} tags mark something else",
                    value=f"dimension {tags.dim}",
                    allowed=f"tags of dimension {dimension}",
                )

    @property
    def comm(self) -> Any:
        """Communicator of the mesh."""
        return self.mesh.comm

    def bounding_box(self) -> tuple[Array, Array]:
        """Return the lower and the upper corner of the box around all nodes, shapes (3,) [mm].

        Note:
            Collective.
        """
        x = self.mesh.geometry.x
        boxes = self.comm.allgather((x.min(axis=0), x.max(axis=0)) if len(x) else None)
        lower, upper = (np.array([box[k] for box in boxes if box is not None]) for k in (0, 1))
        return lower.min(axis=0), upper.max(axis=0)

    def facet_tag(self, wanted: str | int, *, key: str | None = None) -> int:
        """Return the tag of facets by its name or number.

        Args:
            wanted: A name, or the number of a tag.
            key: Key of the scene that the name comes from, for the error.

        Raises:
            InputError: When there is no such name; it shows the nearest one and all others.
        """
        return _tag(self.facet_names, wanted, "surface", key)

    def cell_tag(self, wanted: str | int, *, key: str | None = None) -> int:
        """Return the tag of cells by its name or number; see `facet_tag`."""
        return _tag(self.cell_names, wanted, "volume", key)


def _tag(names: Mapping[str, int], wanted: str | int, what: str, key: str | None) -> int:
    if isinstance(wanted, str) and wanted in names:
        return names[wanted]
    tag = int(wanted) if not isinstance(wanted, str) or wanted.strip().isdecimal() else None
    if tag is not None and (tag in names.values() or not names):
        return tag
    folded = {name.casefold(): name for name in names}
    near = get_close_matches(str(wanted).casefold(), folded, n=1)
    hint = f"; did you mean {folded[near[0]]!r}?" if near else ""
    listed = [
        repr(name) if name != str(number) else name for name, number in list(names.items())[:_SHOWN]
    ]
    more = f" and {len(names) - _SHOWN} more" if len(names) > _SHOWN else ""
    raise InputError(
        f"the mesh has no {what} of this name{hint}" if names else f"the mesh has no named {what}s",
        value=wanted,
        key=key,
        allowed=", ".join(listed) + more if names else "a number",
    )
