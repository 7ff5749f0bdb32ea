"""The flat block meshed by gmsh: the family of meshes that bisection is compared with.

Sessions of gmsh leave signals, and a session of the caller, as they were.
"""

from __future__ import annotations

import ctypes
import math
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from types import ModuleType
from typing import Any

import numpy as np
import scipy

from patchlaw.geometry.meshes.bisection import Tetrahedra
from patchlaw.support.arrays import Array
from patchlaw.support.packages import optional_packages

_TETRAHEDRA = 4
"""gmsh's number of the tetrahedra with four nodes."""

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
"""Options that a caller's own session may have changed; they are restored afterwards."""


def block_by_gmsh(
    interface: tuple[float, float],
    height: float,
    near: list[tuple[float, Array]],
    *,
    coarse: float,
    growth: float,
) -> Tetrahedra:
    """Mesh a flat block with gmsh's frontal algorithm and edge lengths that grow from its places.

    The block is meshed with its largest side as the unit of length, because gmsh's CAD kernel
    treats lengths below 1e-7 as zero. Blocks of one shape have the same mesh whatever their size:
    coordinates are rounded, because differences in the last digit would change which edges are
    flipped. A gmsh session of the caller goes on afterwards, with its model and options.

    Args:
        interface: Sides (Lx, Ly) of the top [mm].
        height: Height of the block [mm].
        near: Edge lengths [mm], each with the places on the top where it holds, shape (n, 2) [mm].
        coarse: Edge length far from all of them [mm].
        growth: Increase of the edge length per distance.

    Returns:
        The mesh in mm, without marked facets.
    """
    unit = max(*interface, height)
    with gmsh_session("patchlaw refined block") as gmsh:
        width, depth, low = (_digits(side / unit) for side in (*interface, height))
        gmsh.model.occ.addBox(0.0, 0.0, -low, width, depth, low)
        classes = [(_digits(edge / unit), places / unit) for edge, places in near]
        tags = []
        for edge, places in classes:
            decimals = 3 + math.ceil(-math.log10(edge))
            at = np.clip(np.round(places, decimals), 0.0, (width, depth))
            tags.append([gmsh.model.occ.addPoint(x, y, 0.0) for x, y in at])
        gmsh.model.occ.synchronize()
        most, fields = _digits(coarse / unit), gmsh.model.mesh.field
        sizes = [
            _size_near(fields, points, edge, (most - edge) / growth, most)
            for points, (edge, _) in zip(tags, classes, strict=True)
        ]
        smallest = fields.add("Min")
        fields.setNumbers(smallest, "FieldsList", sizes)
        fields.setAsBackgroundMesh(smallest)
        _generate(gmsh, low, classes)
        return _tetrahedra(gmsh, unit)


def _digits(length: float) -> float:
    return float(f"{length:.12g}")


def _size_near(fields: Any, points: list[int], least: float, run: float, most: float) -> int:
    """Return gmsh's field of an edge length that grows linearly with the distance from points.

    Args:
        fields: gmsh's interface to fields.
        points: Tags of the points.
        least: The edge length there, in the model's unit.
        run: Distance over which it grows.
        most: The largest edge length.
    """
    near = fields.add("Distance")
    fields.setNumbers(near, "PointsList", points)
    size = fields.add("Threshold")
    start = 2.0 * least
    values = {"DistMin": start, "DistMax": start + run, "SizeMin": least, "SizeMax": most}
    for option, value in (values | {"InField": near}).items():
        fields.setNumber(size, option, value)
    return int(size)


def _generate(gmsh: Any, height: float, classes: list[tuple[float, Array]]) -> None:
    """Mesh by the frontal algorithm, and again by Delaunay's if it has missed a place.

    The frontal algorithm makes better triangles, but evaluates sizes only at its own nodes and can
    step over a small region between large edges.
    """
    gmsh.model.mesh.generate(2)
    _, nodes, _ = gmsh.model.mesh.getNodes(2, -1, includeBoundary=True)
    nodes = np.reshape(nodes, (-1, 3))
    top = scipy.spatial.cKDTree(nodes[np.abs(nodes[:, 2]) < 1e-9 * height, :2])
    if any(np.any(top.query(places)[0] > edge) for edge, places in classes):
        gmsh.model.mesh.clear()
        gmsh.option.setNumber("Mesh.Algorithm", 5)  # Delaunay's
        gmsh.model.mesh.generate(2)
    gmsh.model.mesh.generate(3)


def _tetrahedra(gmsh: Any, unit: float) -> Tetrahedra:
    """Return the tetrahedra of the current model, with lengths in mm."""
    tags, points, _ = gmsh.model.mesh.getNodes()
    _, nodes = gmsh.model.mesh.getElementsByType(_TETRAHEDRA)
    used, cells = np.unique(np.asarray(nodes, np.int64), return_inverse=True)
    order = np.argsort(tags)
    rows = order[np.searchsorted(tags, used, sorter=order)]
    cells = cells.reshape(-1, 4).astype(np.int64)
    return Tetrahedra(
        points=unit * np.reshape(points, (-1, 3))[rows],
        cells=cells,
        cell_tags=np.zeros(len(cells), np.int32),
        facets=np.empty((0, 3), np.int64),
        facet_tags=np.empty(0, np.int32),
    )


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
    """Open a silent session of gmsh with a new current model; restore a caller's afterwards.

    Args:
        name: Name of the new model, which is removed at the end.

    Yields:
        The gmsh module.
    """
    with sigint_untouched(), optional_packages():
        import gmsh  # here, so that everything without a mesh works without gmsh

        owned = not is_initialised(gmsh)
        if owned:
            gmsh.initialize(["", "-v", "0"], readConfigFiles=False)
    current = gmsh.model.getCurrent()
    before = {option: gmsh.option.getNumber(option) for option in _OPTIONS}
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
            for option, value in before.items():
                gmsh.option.setNumber(option, value)


def is_initialised(gmsh: Any) -> bool:
    """Tell whether gmsh has a session, without a call that may end the process.

    Before its first session gmsh 4.8 answers calls with an error. How it treats errors it then
    reads from uninitialised memory, and where that holds a 4 it ends the process without a message.
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
    """Tell whether gmsh has had a session, by the singleton of options that a session creates.

    Where the library does not export it, the answer is no, and a caller's session ends with ours.
    No release is known that lacks both this symbol and ``isInitialized``.
    """
    try:
        return ctypes.c_void_p.in_dll(gmsh.lib, "_ZN3CTX9_instanceE").value is not None
    except ValueError:
        return False
