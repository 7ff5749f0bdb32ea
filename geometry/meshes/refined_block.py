"""The flat block meshed with tetrahedra that are small only where contact can occur."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from geometry.meshes.gmsh_session import gmsh_session
from support.arrays import Array
from support.checks import positive_lengths
from support.errors import InputError


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
    def hexahedral(self) -> bool:
        """Whether the cells are hexahedra."""
        return False

    @property
    def degree(self) -> int:
        """Polynomial degree of the element."""
        return int(self.element[1])

    @property
    def unit(self) -> float:
        """Length that gmsh meshes the block in, its largest side [mm].

        gmsh's CAD kernel treats lengths below 1e-7 as zero. Blocks of one shape have the same mesh
        whatever their size: coordinates are rounded, because differences in the last digit would
        change which edges are flipped.
        """
        return max(*self.interface, self.height)

    def _check_places(self) -> None:
        places = np.asarray(self.places, float)
        object.__setattr__(self, "places", places)
        if places.ndim != 2 or places.shape[1] != 2 or not len(places):
            raise InputError("places have two coordinates", value=places.shape, allowed="(n, 2)")
        # gmsh ends the process when a coordinate is not a number
        away = ~((places >= 0.0) & (places <= self.interface)).all(axis=1)
        if away.any():
            raise InputError(
                "a place lies outside the interface",
                value=tuple(places[away][0].tolist()),
                allowed=f"0 … {self.interface} mm",
            )

    def scaled(self, unit: float) -> RefinedShape:
        """Return the block in a unit of length, its coordinates rounded as gmsh is to have them.

        Args:
            unit: Length that becomes 1 [mm].
        """

        def digits(length: float) -> float:
            return float(f"{length / unit:.12g}")

        width, depth, height, fine, coarse = map(
            digits, (*self.interface, self.height, self.fine, self.coarse)
        )
        decimals = 3 + math.ceil(-math.log10(fine))
        places = np.clip(np.round(self.places / unit, decimals), 0.0, (width, depth))
        return replace(
            self, interface=(width, depth), height=height, places=places, fine=fine, coarse=coarse
        )

    @contextmanager
    def meshed(self) -> Iterator[Any]:
        """Mesh the block in gmsh for as long as the context lasts.

        The cells form the physical volume 1. The geometry has the order of the element, and its
        lengths are in `unit`. A gmsh session of the caller goes on afterwards, with its model and
        options.
        """
        shape = self.scaled(self.unit)
        with gmsh_session("patchlaw refined block") as gmsh:
            box = gmsh.model.occ.addBox(0.0, 0.0, -shape.height, *shape.interface, shape.height)
            points = [gmsh.model.occ.addPoint(x, y, 0.0) for x, y in shape.places]
            gmsh.model.occ.synchronize()
            gmsh.model.addPhysicalGroup(3, [box], 1)
            fields = gmsh.model.mesh.field
            fields.setAsBackgroundMesh(size_near(fields, "PointsList", points, shape.fine, shape))
            generate(gmsh, shape)
            yield gmsh.model


def generate(gmsh: Any, shape: RefinedShape) -> None:
    """Mesh by the frontal algorithm, and again by Delaunay's if it has missed a place.

    The frontal algorithm makes better triangles, but evaluates sizes only at its own nodes and can
    step over a small region between large edges.

    Args:
        gmsh: The gmsh module, its current model with edge lengths.
        shape: The block in the model's unit.
    """
    gmsh.model.mesh.generate(2)
    _, nodes, _ = gmsh.model.mesh.getNodes(2, -1, includeBoundary=True)
    nodes = np.reshape(nodes, (-1, 3))
    top = nodes[np.abs(nodes[:, 2]) < 1e-9 * shape.height, :2]
    if np.any(cKDTree(top).query(shape.places)[0] > shape.fine):
        gmsh.model.mesh.clear()
        gmsh.option.setNumber("Mesh.Algorithm", 5)  # Delaunay's
        gmsh.model.mesh.generate(2)
    gmsh.model.mesh.generate(3)
    gmsh.model.mesh.setOrder(shape.degree)


def size_near(fields: Any, kind: str, tags: list[int], least: float, shape: RefinedShape) -> int:
    """Return gmsh's field of an edge length that grows linearly with the distance from something.

    Args:
        fields: gmsh's interface to fields.
        kind: Name of gmsh's list of what it grows from.
        tags: The list.
        least: The edge length there, in the model's unit.
        shape: The block in that unit.
    """
    near = fields.add("Distance")
    fields.setNumbers(near, kind, tags)
    size = fields.add("Threshold")
    values = {
        "DistMin": 2.0 * least,
        "DistMax": 2.0 * least + (shape.coarse - least) / shape.growth,
        "SizeMin": least,
        "SizeMax": shape.coarse,
        "InField": near,
    }
    for option, value in values.items():
        fields.setNumber(size, option, value)
    return int(size)
