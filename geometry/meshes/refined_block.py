"""The flat block meshed with tetrahedra that are small only where contact can occur."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from geometry.meshes.gmsh_session import gmsh_session
from support.checks import positive_lengths
from support.errors import InputError

Array = NDArray[np.float64]

_DELAUNAY = 5
"""gmsh's number of the algorithm."""
_DIGITS = 12
"""Significant digits of lengths passed to gmsh."""
_AT_SEAMS = 0.2
"""Edge length at re-entrant edges, where stresses are singular, over that far from contact. With
the same length there, 0.1 mm, the compliance of an L 1.5 mm high is too small by 0.1 %."""
_CURVES = "CurvesList"
"""Name of a list of curves in gmsh."""
_NO_BOXES = np.empty((0, 2, 3))
_PLACE = 3
"""Decimals of places passed to gmsh, beyond those of the fine edge length."""


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

    @contextmanager
    def meshed(self) -> Iterator[Any]:
        """Mesh the block in gmsh for as long as the context lasts.

        The cells form the physical volume 1. The geometry has the order of the element, and its
        lengths are in `unit`. A gmsh session of the caller goes on afterwards, with its model and
        options.
        """
        with refined_solid(self, self.unit) as model:
            yield model


@contextmanager
def refined_solid(block: RefinedShape, unit: float, boxes: Array = _NO_BOXES) -> Iterator[Any]:
    """Mesh a block, or a block and the boxes that it stands on, as long as the context lasts.

    Args:
        block: The block and the sizes of the cells.
        unit: Length that gmsh meshes in [mm].
        boxes: Lower and upper corners of boxes below the block, shape (n, 2, 3) [mm].

    Raises:
        InputError: When block and boxes are not one body.
    """

    def digits(length: float) -> float:
        return float(f"{length / unit:.{_DIGITS}g}")

    width, depth, height, fine, coarse = map(
        digits, (*block.interface, block.height, block.fine, block.coarse)
    )
    decimals = _PLACE + math.ceil(-math.log10(fine))
    places = np.clip(np.round(block.places / unit, decimals), 0.0, (width, depth))
    shape = replace(
        block, interface=(width, depth), height=height, places=places, fine=fine, coarse=coarse
    )
    with gmsh_session("patchlaw refined block") as gmsh:
        box = gmsh.model.occ.addBox(0.0, 0.0, -shape.height, *shape.interface, shape.height)
        if len(boxes):
            corners = np.vectorize(digits)(boxes)
            box = _joined(gmsh, box, [(*low, *(high - low)) for low, high in corners])
        gmsh.model.occ.synchronize()
        gmsh.model.addPhysicalGroup(3, [box], 1)
        _set_sizes(gmsh, shape, _seams(gmsh, shape) if len(boxes) else [])
        _generate(gmsh, shape)
        gmsh.model.mesh.setOrder(shape.degree)
        yield gmsh.model


def _joined(gmsh: Any, block: int, boxes: list[tuple[float, ...]]) -> int:
    """Return the volume of a block and boxes, given by corner and sides, that are one body."""
    tools = [(3, gmsh.model.occ.addBox(*box)) for box in boxes]
    union, _ = gmsh.model.occ.fuse([(3, block)], tools)
    if len(union) != 1:
        raise InputError(
            "block and boxes are not one body", value=len(union), allowed="boxes that share faces"
        )
    return int(union[0][1])


def _generate(gmsh: Any, shape: RefinedShape) -> None:
    """Mesh by the frontal algorithm, and again by Delaunay's if it has missed a place.

    The frontal algorithm makes better triangles, but evaluates sizes only at its own nodes and can
    step over a small region between large edges.
    """
    gmsh.model.mesh.generate(2)
    _, nodes, _ = gmsh.model.mesh.getNodes(2, -1, includeBoundary=True)
    nodes = np.reshape(nodes, (-1, 3))
    top = nodes[np.abs(nodes[:, 2]) < 1e-9 * shape.height, :2]
    if np.any(cKDTree(top).query(shape.places)[0] > shape.fine):
        gmsh.model.mesh.clear()
        gmsh.option.setNumber("Mesh.Algorithm", _DELAUNAY)
        gmsh.model.mesh.generate(2)
    gmsh.model.mesh.generate(3)


def _set_sizes(gmsh: Any, shape: RefinedShape, seams: list[int]) -> None:
    """Let the edge length grow linearly with the distance from the places, and from seams."""
    points = [gmsh.model.occ.addPoint(x, y, 0.0) for x, y in shape.places]
    gmsh.model.occ.synchronize()
    fields = gmsh.model.mesh.field
    sizes = [_size_near(fields, "PointsList", points, shape.fine, shape)]
    if seams:
        least = _AT_SEAMS * shape.coarse
        sizes.append(_size_near(fields, _CURVES, seams, least, shape))
    smallest = fields.add("Min")
    fields.setNumbers(smallest, "FieldsList", sizes)
    fields.setAsBackgroundMesh(smallest if seams else sizes[0])


def _size_near(fields: Any, kind: str, tags: list[int], least: float, shape: RefinedShape) -> int:
    """Return the field of an edge length that grows with the distance from points or curves."""
    near = fields.add("Distance")
    fields.setNumbers(near, kind, tags)
    size = fields.add("Threshold")
    inner = 2.0 * least
    values = {
        "DistMin": inner,
        "DistMax": inner + (shape.coarse - least) / shape.growth,
        "SizeMin": least,
        "SizeMax": shape.coarse,
        "InField": near,
    }
    for option, value in values.items():
        fields.setNumber(size, option, value)
    return int(size)


def _seams(gmsh: Any, shape: RefinedShape) -> list[int]:
    """Return the curves at the bottom of a block along which boxes are joined to it."""
    slack, seams = 1e-6 * shape.height, []
    width, depth = shape.interface
    for _, curve in gmsh.model.getEntities(1):
        x, y, z, x_end, y_end, z_end = gmsh.model.getBoundingBox(1, curve)
        level = max(abs(z + shape.height), abs(z_end + shape.height)) < slack
        within = min(x, y) > -slack and x_end < width + slack and y_end < depth + slack
        if level and within:
            seams.append(curve)
    return seams
