"""The flat block meshed with tetrahedra that are small only where contact can occur."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import scipy

from patchlaw.geometry.meshes.bisection import Tetrahedra, from_hexahedra, hexahedron_sides, refined
from patchlaw.geometry.meshes.block import Segment, lattice_cells, node_share
from patchlaw.support.arrays import Array
from patchlaw.support.checks import positive_lengths
from patchlaw.support.errors import InputError

_LONGEST = 1.75
"""Longest edge of bisected cells over the edge of a regular tetrahedron as large as their mean."""

_AT_HOLLOWS = 0.2
"""Edge length at re-entrant edges over that around them. With 1 instead, the compliance of an L
1.5 mm high in cells of 0.1 mm is too small by 0.1 %."""

_CLASS = 1.15
"""Ratio of edge lengths at places that are told apart."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RefinedShape:
    """A block whose tetrahedra grow with the distance from places on its top.

    Args:
        interface: Sides (Lx, Ly) of the top [mm].
        height: Height of the block [mm].
        places: Places on the top around which elements are small, shape (n, 2) [mm].
        fine: Edge length there [mm].
        coarse: Edge length far from them [mm].
        growth: Increase of the edge length per distance.
        element: ``P1``, or ``P2``, whose edges have a node in their middle and can be curved.
        relative: Edge length at every place over `fine`, shape (n,); 1 where not given.

    Raises:
        InputError: When a value is out of its range.
    """

    interface: tuple[float, float]
    height: float
    places: Array
    fine: float
    coarse: float
    growth: float = 0.25
    element: str = "P1"
    relative: Array | None = None
    margin: float = field(default=0.0, init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "interface", positive_lengths(self.interface, "the interface"))
        if self.element not in ("P1", "P2"):
            raise InputError("this element is unknown", value=self.element, allowed="P1, P2")
        if not 0.0 < self.fine <= self.coarse < math.inf:
            raise InputError(
                "the edge lengths are out of range",
                value=(self.fine, self.coarse),
                allowed="0 < fine ≤ coarse",
            )
        if not (0.0 < self.height < math.inf and 0.0 < self.growth < math.inf):
            raise InputError("height and growth must be positive", value=(self.height, self.growth))
        self._check_places()

    @property
    def degree(self) -> int:
        """Polynomial degree of the element."""
        return int(self.element[1])

    @property
    def cubes(self) -> tuple[int, int, int]:
        """Numbers of cubes along x, y and z, about half as wide as the block, that are bisected."""
        sides = (*self.interface, self.height)
        x, y, z = (max(1, round(2.0 * side / min(sides))) for side in sides)
        return x, y, z

    @property
    def edges(self) -> Array:
        """Edge lengths at the places, shape (n,) [mm]."""
        relative = np.ones(len(self.places)) if self.relative is None else self.relative
        return np.minimum(self.fine * relative, self.coarse)

    def edge_classes(self) -> list[tuple[float, Array]]:
        """Return edge lengths that are told apart [mm], each with its places, shape (n, 2) [mm]."""
        edges = self.edges
        classes = np.rint(np.log(edges / self.fine) / math.log(_CLASS)).astype(int)
        alike = [classes == one for one in np.unique(classes)]
        return [(float(edges[these].mean()), self.places[these]) for these in alike]

    def _check_places(self) -> None:
        places = np.asarray(self.places, float)
        object.__setattr__(self, "places", places)
        if places.ndim != 2 or places.shape[1] != 2 or not len(places):
            raise InputError("places have two coordinates", value=places.shape, allowed="(n, 2)")
        away = ~((places >= 0.0) & (places <= self.interface)).all(axis=1)
        if away.any():
            raise InputError(
                "a place lies outside the interface",
                value=tuple(places[away][0].tolist()),
                allowed=f"0 … {self.interface} mm",
            )
        if self.relative is None:
            return
        relative = np.asarray(self.relative, float)
        object.__setattr__(self, "relative", relative)
        if relative.shape != (len(places),) or not np.all((relative > 0) & (relative < np.inf)):
            raise InputError(
                "the relative edge lengths do not fit the places",
                value=relative.shape,
                allowed=f"{len(places)} positive numbers",
            )

    def meshed(self) -> Tetrahedra:
        """Mesh the flat block: cubes in 24 tetrahedra each, bisected until they fit."""
        sides, (x, y, z) = (*self.interface, self.height), self.cubes
        starts = (0.0, 0.0, -self.height)
        ticks = [
            Segment(start=start, end=start + side, cells=count).ticks
            for start, side, count in zip(starts, sides, (x, y, z), strict=True)
        ]
        hexahedra = lattice_cells((x, y, z), (range(x), range(y), range(z)), hexahedra=True)
        quadrilaterals, count = np.unique(
            np.sort(hexahedron_sides(hexahedra), axis=1), axis=0, return_counts=True
        )
        points, tetrahedra, facets = from_hexahedra(
            node_share(ticks, 1, 0), hexahedra, quadrilaterals[count == 1]
        )
        whole = Tetrahedra(
            points=points,
            cells=tetrahedra,
            cell_tags=np.zeros(len(tetrahedra), np.int32),
            facets=facets,
            facet_tags=np.zeros(len(facets), np.int32),
        )
        return refined(whole, EdgeLengths(self))


class EdgeLengths:
    """Longest edges of bisected cells by their middles, in the coordinates of the contact face.

    They grow from those at the places of contact, and from `coarse` around the interface. At
    re-entrant edges of a body they are a part of that, and grow from there.

    Args:
        shape: The edge lengths.
        hollows: Ends of the re-entrant edges, shape (n, 2, 3) [mm].
    """

    def __init__(self, shape: RefinedShape, hollows: Array | None = None) -> None:
        self._shape = shape
        self._near = [
            (edge, scipy.spatial.cKDTree(np.column_stack([places, np.zeros(len(places))])))
            for edge, places in shape.edge_classes()
        ]
        hollows = np.empty((0, 2, 3)) if hollows is None else hollows
        start, end = hollows[:, :1], hollows[:, 1:]
        length = np.linalg.norm(end - start, axis=2).ravel()
        least = _AT_HOLLOWS * self._around(0.5 * (start + end)[:, 0])
        count = np.ceil(length / least).astype(int) + 1
        share = np.concatenate([np.linspace(0.0, 1.0, n) for n in count] or [np.empty(0)])
        which = np.repeat(np.arange(len(count)), count)
        seams = start[which, 0] + share[:, None] * (end - start)[which, 0]
        self._least = least[which]
        self._seam_tree = scipy.spatial.cKDTree(seams) if len(seams) else None

    def _around(self, points: Array) -> Array:
        """Return the edge length that roughness and distance from the interface allow."""
        shape = self._shape
        on_face = np.clip(points, 0.0, [*shape.interface, 0.0])
        distance = np.linalg.norm(points - on_face, axis=1)
        return np.asarray(shape.coarse + shape.growth * distance)

    def __call__(self, middles: Array) -> Array:
        """Return the longest edges for middles (n, 3), shape (n,) [mm]."""
        size, growth = self._around(middles), self._shape.growth
        for edge, tree in self._near:
            away = np.maximum(tree.query(middles)[0] - 2.0 * edge, 0.0)
            np.minimum(size, edge + growth * away, out=size)
        if self._seam_tree is not None:
            distance, seam = self._seam_tree.query(middles)
            size = np.minimum(size, self._least[seam] + growth * distance)
        return np.asarray(_LONGEST * size)
