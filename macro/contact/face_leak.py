"""The leak over the contact face of a mesh, between faces that share an edge with it.

The transmissivity is known at the quadrature points of the face. Its mean over a facet is that of
the triangles of the facet, on which the flow is solved by one rank.

Theory: docs/theory.md, section 16.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from dolfinx import fem
from numpy.typing import NDArray

from patchlaw.macro import compat
from patchlaw.macro.contact.face_leak import FaceFlow, TriangleFace
from patchlaw.macro.mesh.contact_face import ContactFacets, FacetQuadrature, facet_triangles
from patchlaw.macro.mesh.facets import facet_nodes
from patchlaw.support.arrays import Array, Indices
from patchlaw.support.checks import real_array
from patchlaw.support.errors import InputError
from patchlaw.support.parallel import on_root

_ON_FACE = 1e-6
"""Distance from the plane of the face, over the size of the mesh, of nodes that lie on it."""
_LEAST_COVERED = 0.5
"""Part of a facet at least over which the transmissivity is known."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FaceLeak:
    """What leaks over a contact face.

    Args:
        rate: Flow rate from the inlet to the outlet; 0 where the gap is closed [mm³/s].
        imbalance: Sum of the absolute differences of what enters and what leaves over all nodes,
            over the flow.
        pressure: Fluid pressure on the face, linear between its vertices [MPa]; 0 beside the face,
            and where no fluid comes.
    """

    rate: float
    imbalance: float
    pressure: Any

    @property
    def percolates(self) -> bool:
        """Whether an open path leads from edge to edge."""
        return self.rate != 0.0


class LeakingFace:
    """The facets of a contact face, and where fluid enters and leaves.

    Args:
        mesh: The mesh.
        facets: This rank's facets of the face.
        points: Quadrature points on them.
        edges: This rank's facets of the faces at inlet and outlet; those beside the contact face
            count by the edges that they share with it.
        known: Which points have a transmissivity; None: all.

    Raises:
        InputError: On all ranks, when they share no edge, touch each other, or most of a facet has
            no transmissivity.

    Note:
        Everything is collective.
    """

    def __init__(
        self,
        mesh: Any,
        facets: ContactFacets,
        points: FacetQuadrature,
        edges: tuple[NDArray[Any], NDArray[Any]],
        known: NDArray[np.bool_] | None = None,
    ) -> None:
        self._mesh, self._facets, self.comm = mesh, facets, mesh.comm
        order = np.argsort(facets.cell)
        self._facet = order[np.searchsorted(facets.cell, points.cell, sorter=order)]
        self._weight = points.weight if known is None else points.weight * known
        self._area = np.bincount(self._facet, self._weight, len(facets.cell))
        least = float((self._area / facets.area).min(initial=1.0))
        if min(self.comm.allgather(least)) < _LEAST_COVERED:
            raise InputError("a part of the contact face has no laws, or no face opposite")
        all_corners = self.comm.allgather(facets.vertices)
        self._counts = [len(one) for one in all_corners]
        triangles, self._triangle_facet = facet_triangles(np.concatenate(all_corners))
        self._face = TriangleFace(triangles, *(self._places(one) for one in edges))

    @property
    def triangles(self) -> Array:
        """Triangles of the facets of all ranks, in the frame of the face, shape (n, 3, 2) [mm]."""
        return self._face.corners

    @property
    def most_bent(self) -> float:
        """Largest part of the way to a curve for new nodes on the border of the face."""
        return self._face.most_bent

    def _places(self, facets: NDArray[Any]) -> Array:
        """Return where the nodes of facets of all ranks lie in the plane of the face, (n, 2)."""
        frame, points = self._facets.frame, self._mesh.geometry.x
        own = points[facet_nodes(self._mesh, facets).corners].reshape(-1, 3)
        found = np.concatenate(self.comm.allgather(own))
        spans = self.comm.allgather(float(np.abs(points).max(initial=0.0)))
        return np.asarray(
            frame.in_plane(found[np.abs(frame.height(found)) < _ON_FACE * max(spans)])
        )

    def flow(
        self,
        transmissivity: Array,
        *,
        harmonic: bool = False,
        quartered: bool = False,
        bent: float = 0.0,
    ) -> FaceFlow:
        """Solve for the flow.

        Args:
            transmissivity: T along x and y of the face at this rank's points, (n, 2) [mm³].
            harmonic: Whether a facet has the harmonic mean over its points, as where T varies along
                the flow, instead of the mean, as where it varies across.
            quartered: Whether every triangle is cut into four, with its transmissivity.
            bent: Part of the way that new nodes on the border of the face then go to a curve.

        Returns:
            The flow, on every rank, with the pressures at the corners of the triangles of all
            ranks.

        Raises:
            NotConverged: When what enters and leaves the nodes does not balance.
        """
        with np.errstate(divide="ignore"):  # closed points close their facet
            values = 1.0 / transmissivity.T if harmonic else transmissivity.T
            values = np.where(self._weight > 0.0, values, 0.0)
            sums = [np.bincount(self._facet, self._weight * one, len(self._area)) for one in values]
            own = np.stack(sums, axis=1) / self._area[:, None]
            own = 1.0 / own if harmonic else own
        whole = np.concatenate(self.comm.allgather(own))[self._triangle_facet]
        if quartered:
            fourfold = np.repeat(whole, 4, axis=0)
            return on_root(self.comm, lambda: self._face.quartered(bent).flow(fourfold))
        return on_root(self.comm, lambda: self._face.flow(whole))

    def pressure(self, flow: FaceFlow, first: float, second: float, name: str = "fluid") -> Any:
        """Return the fluid pressure as a function, linear between the vertices of the mesh.

        Args:
            flow: What `flow` returned.
            first: Pressure at the inlet [MPa].
            second: Pressure at the outlet [MPa].
            name: Name of the function.
        """
        count, corners = len(self._triangle_facet), self._facets.vertices.shape[1]
        at = np.empty((sum(self._counts), corners))
        if corners == 3:
            at[:] = flow.pressure
        else:  # see facet_triangles
            at[:, [0, 2, 1]] = flow.pressure[: count // 2]
            at[:, 3] = flow.pressure[count // 2 :, 0]
        start = sum(self._counts[: self.comm.rank])
        own = at[start : start + len(self._facets.cell)]
        function = fem.Function(compat.scalar_space(self._mesh, 1), name=name)
        shapes = compat.reference_facets(self._mesh.topology.cell_name())[1]
        nodes = compat.cell_nodes(function.function_space)[self._facets.cell]
        nodes = np.take_along_axis(nodes, shapes[self._facets.side], axis=1).ravel()
        wet, size = ~np.isnan(own.ravel()), len(function.x.array)
        values = np.where(wet, second + own.ravel() * (first - second), 0.0)
        space = function.function_space
        total, times = (
            compat.sum_of_ranks(space, np.bincount(nodes, one, size))
            for one in (values, wet.astype(float))
        )
        np.divide(total, times, out=function.x.array[: len(total)], where=times > 0.0)
        function.x.scatter_forward()
        return function


def transmissivities_of(laws: Sequence[Any], patch: Indices, closure: Array) -> Array:
    """Return the transmissivities of laws at points, shape (n, 2) [mm³].

    Args:
        laws: One law per patch.
        patch: Patch of every point, shape (n,).
        closure: Closures there, shape (n,) [mm].

    Raises:
        InputError: When a law has no ``transmissivities``, or gives no numbers ≥ 0 of that shape.
    """
    found = np.empty((len(closure), 2))
    for index, law in enumerate(laws):
        if not callable(getattr(law, "transmissivities", None)):
            raise InputError(
                "the law knows no leak",
                value=law,
                allowed="a law with transmissivities(closure) of shape (n, 2) [mm³], such as "
                "representative_law(…, leak=True)",
            )
        here = patch == index
        values = real_array(law.transmissivities(closure[here]))
        if values.shape != (int(here.sum()), 2) or not (values >= 0.0).all():
            raise InputError(
                f"law {index} gives no transmissivities",
                value=values.shape,
                allowed="numbers ≥ 0 along x and y of the face for every closure",
            )
        found[here] = values
    return found


def face_leak(
    face: LeakingFace, transmissivity: Array, viscosity: float, pressures: tuple[float, float]
) -> FaceLeak:
    """Return what leaks over a face; collective.

    Args:
        face: The face.
        transmissivity: T along x and y at this rank's points, shape (n, 2) [mm³].
        viscosity: Dynamic viscosity [MPa s].
        pressures: Fluid pressures at inlet and outlet [MPa].

    Raises:
        InputError: When viscosity or pressures drive no flow.
        NotConverged: When what enters and leaves the nodes does not balance.
    """
    first, second = map(float, pressures)
    if not (np.isfinite(viscosity) and viscosity > 0.0):
        raise InputError(
            "must be a number greater than 0", key="viscosity", value=viscosity, allowed="MPa s"
        )
    if first == second or not np.isfinite([first, second]).all():
        raise InputError(
            "drives no flow", key="pressures", value=[first, second], allowed="two different ones"
        )
    flow = face.flow(transmissivity)
    return FaceLeak(
        rate=flow.total * (first - second) / (12.0 * viscosity),
        imbalance=flow.imbalance,
        pressure=face.pressure(flow, first, second),
    )
