"""Transfinite gmsh meshes of a rectangular lattice of boxes with graded lines."""

from __future__ import annotations

import ctypes
import itertools
import math
import signal
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

# Settings that a caller's own gmsh session may have changed; they are put back afterwards.
_OPTIONS = {
    "General.AbortOnError": 2,  # errors raise exceptions; 4 would end the process
    "General.Verbosity": 0,
    "General.Terminal": 0,
    "Mesh.Algorithm": 6,
    "Mesh.ElementOrder": 1,
    "Mesh.RecombineAll": 0,
    "Mesh.SubdivisionAlgorithm": 0,
    "Mesh.SaveAll": 0,
    "Mesh.MeshSizeFactor": 1,
    "Mesh.MeshSizeMin": 0,
    "Mesh.MeshSizeMax": 1e22,
    "Mesh.MeshSizeFromPoints": 0,
    "Mesh.MeshSizeFromCurvature": 0,
    "Mesh.MeshSizeExtendFromBoundary": 0,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Segment:
    """A straight piece of a grid line, divided geometrically.

    Args:
        start: First coordinate [mm].
        end: Last coordinate [mm].
        cells: Number of cells.
        growth: Size of the last cell relative to the first.
    """

    start: float
    end: float
    cells: int
    growth: float = 1.0

    @property
    def ratio(self) -> float:
        """Ratio of the sizes of successive cells."""
        return self.growth ** (1.0 / (self.cells - 1)) if self.cells > 1 else 1.0

    @property
    def narrowest(self) -> float:
        """Size of the smallest cell [mm], without making the others."""
        length, count = abs(self.end - self.start), self.cells
        steepness = abs(math.log(self.growth))
        if count == 1 or steepness == 0.0:
            return length / count
        per_cell = steepness / (count - 1)
        return length * math.expm1(per_cell) / math.expm1(count * per_cell)

    @property
    def ticks(self) -> NDArray[np.float64]:
        """Coordinates of the grid planes, shape (cells + 1,) [mm]."""
        sizes = self.ratio ** np.arange(self.cells)
        share = np.concatenate([[0.0], np.cumsum(sizes) / sizes.sum()])
        return self.start + (self.end - self.start) * share


Axes = tuple[Sequence[Segment], Sequence[Segment], Sequence[Segment]]


@contextmanager
def sigint_untouched() -> Iterator[None]:
    """Import or call gmsh without its replacing the process's handler of SIGINT.

    gmsh does so when a session begins and ends, and release 4.8 already when it is imported. Inside
    this context gmsh has a copy of the module ``signal`` whose function ``signal`` ignores SIGINT.
    Restoring the handler afterwards would leave a moment in which SIGINT ends the process, and
    would fail outside the main thread.
    """

    def ignoring_sigint(number: int, handler: Any) -> Any:
        if number == signal.SIGINT:
            return signal.getsignal(number)
        return signal.signal(number, handler)

    copy: Any = ModuleType("signal")
    vars(copy).update(vars(signal) | {"signal": ignoring_sigint})
    if "gmsh" in sys.modules:
        sys.modules["gmsh"].signal = copy  # type: ignore[attr-defined]
    else:
        sys.modules["signal"] = copy  # for gmsh's own import of it
    try:
        yield
    finally:
        sys.modules["signal"] = signal
        if "gmsh" in sys.modules:
            sys.modules["gmsh"].signal = signal  # type: ignore[attr-defined]


@contextmanager
def gmsh_session(name: str) -> Iterator[Any]:
    """Give a silent gmsh with a new current model, and leave a caller's session as it was.

    Args:
        name: Name of the new model, which is removed at the end.

    Yields:
        The gmsh module.
    """
    with sigint_untouched():
        import gmsh  # here, so that everything without a mesh works without gmsh

        owned = not is_initialised(gmsh)
        if owned:
            gmsh.initialize(["", "-v", "0"], readConfigFiles=False)
    current = gmsh.model.getCurrent()
    kept = {option: gmsh.option.getNumber(option) for option in _OPTIONS}
    try:
        for option, value in _OPTIONS.items():
            gmsh.option.setNumber(option, value)
        gmsh.model.add(name)
        yield gmsh
    finally:
        if owned:
            with sigint_untouched():
                gmsh.finalize()
        else:
            gmsh.model.setCurrent(name)
            gmsh.model.remove()
            gmsh.model.setCurrent(current)
            for option, value in kept.items():
                gmsh.option.setNumber(option, value)


def mesh_lattice(gmsh: Any, axes: Axes, *, hexahedra: bool) -> dict[str, list[int]]:
    """Mesh the boxes between the segments of three axes conformingly.

    Args:
        gmsh: The module, inside a session.
        axes: Adjoining segments along x, y and z.
        hexahedra: Hexahedra, or six tetrahedra in the place of each.

    Returns:
        Tags of the volumes under ``"volumes"`` and of the outer faces under ``"x-"``, ``"x+"``,
        ``"y-"`` … ``"z+"``.
    """
    geo = gmsh.model.geo
    corners = [[axis[0].start, *(segment.end for segment in axis)] for axis in axes]
    shape = [len(axis) for axis in axes]
    points = {
        place: geo.addPoint(*(corners[k][place[k]] for k in range(3)))
        for place in itertools.product(*(range(n + 1) for n in shape))
    }
    lines = _add_lines(geo, axes, points)
    faces = _add_faces(geo, shape, points, lines, recombine=hexahedra)
    volumes = []
    for place in itertools.product(*(range(n) for n in shape)):
        shell = [faces[k, _next(place, k, side)] for k in range(3) for side in (0, 1)]
        volumes.append(geo.addVolume([geo.addSurfaceLoop(shell)]))
        geo.mesh.setTransfiniteVolume(volumes[-1])
    geo.synchronize()
    gmsh.model.mesh.generate(3)
    return {"volumes": volumes, **_outer_faces(shape, faces)}


Place = tuple[int, ...]


def _next(place: Place, axis: int, step: int = 1) -> Place:
    return tuple(index + step * (k == axis) for k, index in enumerate(place))


def _add_lines(geo: Any, axes: Axes, points: dict[Place, int]) -> dict[tuple[int, Place], int]:
    """Add the edges of all boxes, keyed by direction and first point."""
    lines = {}
    for place, k in itertools.product(points, range(3)):
        if place[k] < len(axes[k]):
            segment = axes[k][place[k]]
            tag = geo.addLine(points[place], points[_next(place, k)])
            geo.mesh.setTransfiniteCurve(tag, segment.cells + 1, "Progression", segment.ratio)
            lines[k, place] = tag
    return lines


def _add_faces(
    geo: Any,
    shape: Sequence[int],
    points: dict[Place, int],
    lines: dict[tuple[int, Place], int],
    *,
    recombine: bool,
) -> dict[tuple[int, Place], int]:
    """Add the faces of all boxes, keyed by normal and lowest corner."""
    faces = {}
    for place, k in itertools.product(points, range(3)):
        first, second = (axis for axis in range(3) if axis != k)
        if place[first] == shape[first] or place[second] == shape[second]:
            continue
        right, above = _next(place, first), _next(place, second)
        loop = [lines[first, place], lines[second, right], -lines[first, above]]
        tag = geo.addPlaneSurface([geo.addCurveLoop([*loop, -lines[second, place]])])
        corner = [points[at] for at in (place, right, _next(right, second), above)]
        geo.mesh.setTransfiniteSurface(tag, "Left", corner)
        if recombine:
            geo.mesh.setRecombine(2, tag)
        faces[k, place] = tag
    return faces


def _outer_faces(shape: Sequence[int], faces: dict[tuple[int, Place], int]) -> dict[str, list[int]]:
    outer: dict[str, list[int]] = {}
    for (k, place), tag in faces.items():
        if place[k] in (0, shape[k]):
            outer.setdefault("xyz"[k] + ("-" if place[k] == 0 else "+"), []).append(tag)
    return outer


def is_initialised(gmsh: Any) -> bool:
    """Tell whether gmsh has a session, calling nothing that may end the process.

    A call before the first session makes gmsh 4.8 report an error. It then reads how to treat
    errors from memory that nothing has set, and where that holds a 4 it exits without a word.
    """
    if hasattr(gmsh, "isInitialized"):
        return bool(gmsh.isInitialized())
    if not _has_context(gmsh):
        return False
    try:  # gmsh 4.8 answers 0, or raises, between two sessions
        return bool(gmsh.option.getNumber("Mesh.ElementOrder") >= 1.0)
    except Exception:
        return False


def _has_context(gmsh: Any) -> bool:
    """Tell whether gmsh has had a session, which leaves its options' singleton behind.

    Where the library hides that (no release that we know does so and lacks ``isInitialized``),
    the answer is no, and a caller's session, if there is one, ends with ours.
    """
    try:
        return ctypes.c_void_p.in_dll(gmsh.lib, "_ZN3CTX9_instanceE").value is not None
    except ValueError:
        return False
