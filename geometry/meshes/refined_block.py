"""The flat block meshed with tetrahedra that are small only where contact can occur.

`RefinedShape` is one mesh, `reference_shapes` a family of them, coarse to fine, whose results can
be extrapolated; a `ContactMap` says where contact is expected.

The finest tetrahedra have a stated number n of edges along the radius of a contact, wherever
contact is expected; from there their size grows by γ = 1.05/n of the distance. Curved quadratic
tetrahedra err by two parts. Beside contacts cells are too stiff for the stresses around these: the
force is too large by 0.75 γ², measured as 0.12, 0.07, 0.03 and 0.008 % with γ = 0.4, 0.3, 0.2 and
0.1. At their borders it matters where nodes happen to lie: 1.4 %/n³, of either sign, for one
contact, measured on spheres in ten places and on a single asperity of Set 1 (Waddad et al. 2016,
table 1), with n of 1.5 to 6. Therefore the members of a family differ by h in γ and in the edges
far away, and by √h in those where contact is: most of their difference is then of the first kind,
which falls with h² and can be extrapolated.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Annotated, Literal

import numpy as np
import scipy

from patchlaw.geometry.meshes.bisection import Tetrahedra, from_hexahedra, hexahedron_sides, refined
from patchlaw.geometry.meshes.block import Segment, lattice_cells, node_share
from patchlaw.geometry.rigid_plane import RigidPlane
from patchlaw.geometry.surface import Surface
from patchlaw.support import Array, InputError, Lengths
from patchlaw.support.arguments import Count, Positive, PositiveLength, check_fields, checked

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

    interface: Lengths
    height: PositiveLength
    places: Array
    fine: PositiveLength
    coarse: PositiveLength
    growth: Annotated[float, Positive] = 0.25
    element: str = "P1"
    relative: Array | None = None
    margin: float = field(default=0.0, init=False)

    def __post_init__(self) -> None:
        check_fields(self)
        if self.element not in ("P1", "P2"):
            raise InputError("this element is unknown", value=self.element, allowed="P1, P2")
        if self.fine > self.coarse:
            raise InputError(
                "the edge lengths are out of range",
                value=(self.fine, self.coarse),
                allowed="fine ≤ coarse",
            )
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
        places, relative = self.places, self.relative
        if places.ndim != 2 or places.shape[1] != 2 or not len(places):
            raise InputError("places have two coordinates", value=places.shape, allowed="(n, 2)")
        away = ~((places >= 0.0) & (places <= self.interface)).all(axis=1)
        if away.any():
            raise InputError(
                "a place lies outside the interface",
                value=tuple(places[away][0].tolist()),
                allowed=f"0 … {self.interface} mm",
            )
        if relative is None:
            return
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


EDGES = 3.0
"""Edges along the radius of a typical contact in the finest tetrahedra, by default."""

_GROWTH = 1.05
"""Increase of the edge length per distance, times the edges along the radius of a contact."""

_BESIDE = 1.5
"""Edges at summits that were not in contact, relative to those of a contact as wide."""

_SHARE = 1.0 / 6.0
"""Power of a contact's force by which its edges are more: cells then lessen the error of the whole
force most, as every contact costs n³ of them and errs by 1/n³ of its force."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ContactMap:
    """Where a surface is expected to be in contact, and how wide the contacts are.

    Attributes:
        places: Places in contact, shape (n, 2) [mm].
        radius: Radius of the contact that each is in [mm], times a power of the share in the load:
            what edges are in proportion to, shape (n,).
        typical: Radius of a contact on average over the load [mm].
        effective: Number of equal contacts with the same spread of loads, (Σ F)²/Σ F².
    """

    places: Array
    radius: Array
    typical: float
    effective: float

    @classmethod
    def of_pressures(cls, surface: Surface, pressures: Array) -> ContactMap:
        """Return the map of a contact that was solved for, on the grid of the surface.

        In a disc of radius a the mean distance from the edge is a/3, which is used for contacts of
        any form.

        Args:
            surface: The surface.
            pressures: Pressures of its cells, some of them positive [MPa].
        """
        touching, spacing = pressures > 0.0, surface.spacing
        region, count = scipy.ndimage.label(touching, structure=np.ones((3, 3)))
        # a cell is on average half its width further inside than its distance from those outside
        around = np.pad(touching, 1)
        depth = scipy.ndimage.distance_transform_edt(around, sampling=spacing)[1:-1, 1:-1]
        depth = depth[touching] - 0.5 * min(spacing)
        of_cell = region[touching] - 1
        cells = np.bincount(of_cell, minlength=count)
        radius = np.maximum(3.0 * np.bincount(of_cell, depth) / cells, max(spacing))
        force = np.bincount(of_cell, pressures[touching])
        usual = float(force @ force / force.sum())
        x, y = np.nonzero(touching)
        return cls(
            places=np.column_stack([surface.x[x], surface.y[y]]),
            radius=(radius * (usual / force) ** _SHARE)[of_cell],
            typical=float(force @ radius / force.sum()),
            effective=float(force.sum()) / usual,
        )

    def with_islands(
        self, surface: Surface, approach: float, tilt: tuple[float, float] = (0.0, 0.0)
    ) -> ContactMap:
        """Return the map with summits that interfere with the plane but were not in contact.

        Half a cell of the grid at the border of the surface decides whether they are: of eight
        surfaces of Set 1 and 2 two had such a summit there that bore 0.5 and 2 % of the load.

        Args:
            surface: The surface.
            approach: Approach at its middle [mm].
            tilt: Slopes of the approach along x and y.
        """
        x, y = (
            np.linspace(0.0, length, count + 1)
            for length, count in zip(surface.lengths, surface.grid, strict=True)
        )
        inside = depth_below_plane(surface, x[:, None], y[None, :], approach, tilt) > 0.0
        island, count = scipy.ndimage.label(inside, structure=np.ones((3, 3)))
        known = np.zeros(count + 1, dtype=bool)
        known[0] = True
        cell = np.floor(self.places / surface.spacing).astype(int)
        for step in ((0, 0), (0, 1), (1, 0), (1, 1)):
            known[island[tuple(np.minimum(cell + step, surface.grid).T)]] = True
        i, j = np.nonzero(~known[island])
        if not len(i):
            return self
        depth = scipy.ndimage.distance_transform_edt(inside, sampling=surface.spacing)[i, j]
        size = np.bincount(island[i, j], depth, count + 1) / np.maximum(
            np.bincount(island[i, j], minlength=count + 1), 1
        )
        radius = np.maximum(3.0 / math.sqrt(2.0) * size[island[i, j]], max(surface.spacing))
        return replace(
            self,
            places=np.concatenate([self.places, np.column_stack([x[i], y[j]])]),
            radius=np.concatenate([self.radius, _BESIDE * np.minimum(radius, self.typical)]),
        )

    @classmethod
    def of_interference(
        cls,
        surface: Surface,
        approach: float,
        *,
        tilt: tuple[float, float] = (0.0, 0.0),
        spacing: float | None = None,
    ) -> ContactMap:
        """Return what the surface alone says: where it interferes with the plane.

        Args:
            surface: The surface.
            approach: Approach at its middle [mm].
            tilt: Slopes of the approach along x and y.
            spacing: Distance between places [mm].
        """
        radius = contact_radius(surface, approach, tilt=tilt)
        places = places_in_reach(surface, approach, spacing=spacing or radius / EDGES, tilt=tilt)
        return cls(
            places=places, radius=np.full(len(places), radius), typical=radius, effective=1.0
        )


@checked
def reference_shapes(
    surface: Surface,
    approach: float,
    height: float,
    *,
    count: Count,
    fine: PositiveLength | None = None,
    tilt: tuple[float, float] = (0.0, 0.0),
    element: Literal["P1", "P2"] = "P2",
    contact: ContactMap | None = None,
) -> tuple[RefinedShape, ...]:
    """Return blocks to mesh, coarse to fine, all of whose sizes fall together.

    Two or more meshes span a factor of 2 in size, in equal ratios, and quadratic tetrahedra one of
    √2 where contact occurs (see the module).

    Args:
        surface: The rough surface, which covers the block's top.
        approach: Largest approach that the meshes are for [mm].
        height: Height of the block [mm].
        count: Number of meshes.
        fine: Edge length of the finest tetrahedra in a typical contact [mm]; by default
            `EDGES` of them are along its radius.
        tilt: Slopes of the approach along x and y.
        element: ``P1`` or ``P2``.
        contact: Where contact is expected; by default where the surface interferes with the plane.

    Raises:
        InputError: When a value is out of its range.
    """
    factors = [2.0 ** (k / max(count - 1, 1)) for k in reversed(range(count))]
    known = contact or ContactMap.of_interference(surface, approach, tilt=tilt, spacing=fine)
    smallest = known.typical / EDGES if fine is None else fine
    most = known.typical / smallest

    def member(factor: float) -> RefinedShape:
        """Return a shape whose sizes are larger than those of the finest by a factor."""
        fine = smallest * (math.sqrt(factor) if element == "P2" else factor)
        coarse = factor * min(*surface.lengths, height) / max(2.0, 2.0 * most)
        return RefinedShape(
            interface=surface.lengths,
            height=height,
            places=known.places,
            fine=fine,
            coarse=max(coarse, fine),
            growth=factor * _GROWTH / most,
            element=element,
            relative=known.radius / known.typical,
        )

    return tuple(map(member, factors))


@checked
def suggested_fine(
    surface: Surface,
    approach: float,
    *,
    tilt: tuple[float, float] = (0.0, 0.0),
    edges: Annotated[float, Positive] = EDGES,
) -> float:
    """Return an edge length that resolves typical contacts [mm].

    Args:
        surface: The rough surface.
        approach: Largest approach [mm].
        tilt: Slopes of the approach along x and y.
        edges: Edges along the radius of a typical contact.

    Raises:
        InputError: When the number of edges is not positive.
    """
    return contact_radius(surface, approach, tilt=tilt) / edges


def places_in_reach(
    surface: Surface, approach: float, *, spacing: float, tilt: tuple[float, float] = (0.0, 0.0)
) -> Array:
    """Return the places that the plane can touch: where the undeformed surface interferes with it.

    Under pressure a half-space only moves away from the plane, so that contact occurs nowhere else.

    Args:
        surface: The rough surface.
        approach: Largest approach at the middle of the surface [mm].
        spacing: Distance between places [mm].
        tilt: Slopes of the approach along x and y.

    Returns:
        Points of a square lattice, shape (n, 2) [mm]; at least that of the largest depth.
    """
    x, y = (
        np.linspace(0.0, length, max(2, math.ceil(length / spacing) + 1))
        for length in surface.lengths
    )
    lattice = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    top = np.array([surface.highest_point])
    depth = np.concatenate(
        [
            depth_below_plane(surface, x[:, None], y[None, :], approach, tilt).ravel(),
            depth_below_plane(surface, top[:, 0], top[:, 1], approach, tilt),
        ]
    )
    return np.vstack([lattice, top])[depth >= min(0.0, float(depth.max()))]


def depth_below_plane(
    surface: Surface, x: Array, y: Array, approach: float, tilt: tuple[float, float] = (0.0, 0.0)
) -> Array:
    """Return the interference of the undeformed surface and the rigid plane [mm].

    Args:
        surface: The rough surface.
        x: Abscissae [mm].
        y: Ordinates, broadcast with the abscissae [mm].
        approach: Approach at the middle of the surface, from first touch of a level plane [mm].
        tilt: Slopes of the approach along x and y.

    Returns:
        Interference at every place; negative where there is a gap.

    Raises:
        InputError: When a value is not finite.
    """
    plane = RigidPlane.above(surface, approach, tilt)
    return surface.height_at(x, y) - surface.highest + plane.at(x, y)


def contact_radius(
    surface: Surface, approach: float, *, tilt: tuple[float, float] = (0.0, 0.0)
) -> float:
    """Estimate the radius of a typical contact from the surface alone [mm].

    The surface behind the undeformed plane consists of caps. In a disc of radius r the mean
    distance from the edge is r / 3, which is used for caps of any form. The contact of a cap has
    1/√2 of the cap's radius (Hertz). Where more than a twentieth of the surface lies behind the
    plane, contacts merge and bear the plane together: only the highest twentieth counts then.

    Args:
        surface: The rough surface.
        approach: Approach at the middle of the surface [mm].
        tilt: Slopes of the approach along x and y.

    Returns:
        The radius, at least the distance of the surface's samples.

    Raises:
        InputError: When a value is not finite.
    """
    x, y = (
        np.linspace(0.0, length, min(max(256, 2 * n), 1024) + 1)
        for length, n in zip(surface.lengths, surface.grid, strict=True)
    )
    depth = depth_below_plane(surface, x[:, None], y[None, :], approach, tilt)
    level = float(np.quantile(depth, 0.95))
    inside = depth >= level if level > 0.0 else depth > 0.0
    least = max(surface.spacing)
    if not inside.any():
        return least
    if inside.all():
        return 0.5 * min(surface.lengths)
    step = (x[1], y[1])
    # a point lies on average half a step further inside than its distance from those outside
    distance = scipy.ndimage.distance_transform_edt(inside, sampling=step)[inside] - 0.5 * min(step)
    return max(3.0 * float(distance.mean()) / math.sqrt(2.0), least)
