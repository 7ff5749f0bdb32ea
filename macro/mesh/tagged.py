"""A mesh of a body of any shape, with marked facets and cells."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TaggedMesh:
    """A mesh of a body, distributed over the ranks of a communicator.

    Args:
        mesh: The dolfinx mesh; lengths in mm.
        facet_tags: Its marked facets; facets of ghost cells may be among them.
        cell_tags: Its marked cells; None where they are not marked.
        facet_names: Marker of every named surface.
        cell_names: Marker of every named volume.
    """

    mesh: Any
    facet_tags: Any
    cell_tags: Any = None
    facet_names: Mapping[str, int] = field(default_factory=dict)
    cell_names: Mapping[str, int] = field(default_factory=dict)

    @property
    def comm(self) -> Any:
        """Communicator of the mesh."""
        return self.mesh.comm
