"""A contact face of any outline, whose regions have a law each.

Theory: section 11 of ``demos/theory.md``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from geometry.patches import PatchGrid
from macro import compat
from macro.contact.loaded_face import LoadedFace
from macro.mesh.contact_face import ContactFacets, FacetQuadrature, facet_quadrature

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Outline:
    """What stands for patches on a face that is covered as a whole.

    Attributes:
        count: Number of regions.
        middle: Middle of the bounding rectangle, which the plane turns about, shape (2,) [mm].
        lengths: Sides of the bounding rectangle [mm].
    """

    count: int
    middle: Array
    lengths: tuple[float, float]


@dataclass(frozen=True, eq=False)
class FaceRegions(LoadedFace):
    """A whole contact face in regions, for laws that hold at its points.

    A region takes the place of a patch; its facets may lie anywhere in the plane.

    Args:
        region: Region of every facet, ascending, shape (facets,).

    Note:
        Everything here is collective. A rank may own no facet, or no part of a region.
    """

    region: NDArray[np.intp] | None = None

    @classmethod
    def covering(
        cls, body: Any, parts: Sequence[ContactFacets], lengths: tuple[float, float]
    ) -> FaceRegions:
        """Return a face whose regions are given by their facets.

        Args:
            body: The body.
            parts: Facets of each region, all in one frame.
            lengths: Sides of the rectangle around all of them, from the origin of the frame [mm].
        """
        names = [each.name for each in fields(ContactFacets) if each.name not in _SHARED]
        joined = {name: np.concatenate([getattr(part, name) for part in parts]) for name in names}
        region = np.repeat(np.arange(len(parts)), [len(part.cell) for part in parts])
        outline = Outline(len(parts), 0.5 * np.asarray(lengths), lengths)
        facets = replace(parts[0], **joined)
        return cls(body, facets, outline, None, region)  # type: ignore[arg-type]

    @cached_property
    def quadrature(self) -> FacetQuadrature:
        """Quadrature points of this rank, sorted by region."""
        hexahedral = compat.is_hexahedral(self.space.mesh)
        degree = self.degree or (4 if hexahedral else 2) * compat.lagrange_degree(self.space)
        assert self.region is not None
        parts = [_part(self.facets, self.region == k) for k in range(self.patches.count)]
        return _joined(
            [facet_quadrature(part, self.space, self._whole, degree=degree) for part in parts]
        )

    @cached_property
    def _means(self) -> tuple[Array, Array, Array]:
        """Mean place of the regions on the face, and its depth there, shape (N,) each [mm]."""
        points = self.quadrature
        moments = [
            np.bincount(points.patch, points.weight * values, minlength=self.patches.count)
            for values in (points.x, points.y, points.depth)
        ]
        x, y, depth = self.comm.allreduce(np.array(moments), op=MPI.SUM) / self.areas
        return x, y, depth

    @property
    def _whole(self) -> PatchGrid:
        """One patch that covers the whole face, with room for rounding of its border."""
        x, y = self.patches.lengths
        room = 1e-3 * max(x, y)
        return PatchGrid(
            grid=(1, 1), lengths=(x + 2.0 * room, y + 2.0 * room), origin=(-room, -room)
        )


_SHARED = ("frame", "outward")


def _part(facets: ContactFacets, chosen: NDArray[np.bool_]) -> ContactFacets:
    names = [each.name for each in fields(ContactFacets) if each.name not in _SHARED]
    return replace(facets, **{name: getattr(facets, name)[chosen] for name in names})


def _joined(parts: Sequence[FacetQuadrature]) -> FacetQuadrature:
    """Return the points of several regions as those of one face."""
    joined = {
        each.name: np.concatenate([getattr(part, each.name) for part in parts])
        for each in fields(FacetQuadrature)
        if each.name != "patch"
    }
    region = np.repeat(np.arange(len(parts)), [len(part.x) for part in parts])
    return FacetQuadrature(patch=region, **joined)
