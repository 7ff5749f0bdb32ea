"""The leak over the contact face of a body, between two of its edges, under laws of samples.

At every point of the face the law of the samples tells the mean separation and, from their gaps
under a plane at that separation, the transmissivity. The flow over the face is a problem of two
dimensions. It is solved again with each cause of its error varied: the harmonic mean of a facet's
points instead of their mean, gaps on half as many cells, the transmissivity from half of its rows,
and the mean of the samples as much too low as it may be.

Theory: docs/theory.md, section 16.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from multiscale.law_errors import mean_error
from multiscale.laws.transmissivity import CAUSES, Transmissivity
from multiscale.loading.leak import Leak
from multiscale.loading.load_step import LoadStep
from multiscale.observers.leak import LeakObserver
from support.arrays import Array
from support.errors import InputError

if TYPE_CHECKING:  # finite elements are imported only by scenes that need them
    from macro.contact.face_leak import LeakingFace


_MESH, _FINER = "mesh", 2.0
"""A cause of the error, and its part by linear elements over what cutting each into four changes:
4/3 where the fluid's pressure is smooth, more beside its corners."""
"""The cause of error that the facets of the face are."""


class FluidMap(NamedTuple):
    """The fluid on the triangles of a contact face.

    Attributes:
        triangles: Corners of the triangles in the frame of the face, shape (n, 3, 2) [mm].
        pressure_MPa: Fluid pressures at the corners, NaN where no fluid comes, (n, 3) [MPa].
        leaving_mm3_per_s: Part of the flow rate that leaves from each triangle, (n,) [mm³/s].
    """

    triangles: Array
    pressure_MPa: Array
    leaving_mm3_per_s: Array


class FaceLeakObserver(LeakObserver):
    """Adds what leaks over the contact face to load steps.

    Args:
        coupling: What finds the load steps, with laws of samples on a mesh.

    Raises:
        InputError: When the body has no such faces, or they share no edge with the contact face.

    Note:
        Everything is collective.
    """

    def __init__(self, coupling: Any) -> None:
        super().__init__(coupling)
        self._face: LeakingFace | None = None
        self._known: tuple[int, Any] | None = None
        first = coupling.bodies.first
        assert first is not None, "scenes without a body on a mesh are refused"
        tagged = first.body.mesh
        try:
            tags = [
                tagged.facet_tag(getattr(self._section, key), key=f"leak.{key}")
                for key in ("inlet", "outlet")
            ]
        except InputError as error:
            raise error.located(file=coupling.scene.file) from None
        self._edges = tuple(tagged.facet_tags.find(tag) for tag in tags)
        self._errors = [mean_error(region.surfaces) for region in coupling.samples]
        causes = [one for one in CAUSES if one != "samples" or any(self._errors)]
        self.causes = [_MESH, *causes]
        self._leaking()  # refuses edges that do not fit before anything is solved
        coupling.further_fields.append(self.fluid_pressure)

    def _leaking(self) -> LeakingFace:
        """Return the contact face with its edges."""
        from macro.contact.face_leak import LeakingFace

        if self._face is None:
            coupling = self._coupling
            whole: Any = coupling.bodies.contact_face()
            first = getattr(whole, "first", whole)
            known = getattr(whole, "on_both", None)
            mesh, points = first.space.mesh, first.quadrature
            try:
                self._face = LeakingFace(mesh, first.facets, points, self._edges, known)
            except InputError as error:
                raise error.located(key="leak", file=coupling.scene.file) from None
        return self._face

    def _leaks(self, step: LoadStep) -> tuple[Leak, ...]:
        return (Leak(way="face", rate=self._scale * self._flow_at(step).total),)

    def _varied(self, step: LoadStep, cause: str) -> Sequence[float]:
        if cause != _MESH:
            return [self._scale * self._flow(cause).total]
        face, points, own = self._leaking(), self._at_points(None), self._flow_at(step).total
        in_series = face.flow(points, harmonic=True).total
        finer = face.flow(points, quartered=True).total
        off = abs(in_series - own) + _FINER * abs(finer - own)
        return [self._scale * (own + off)]

    def fluid_pressure(self, step: LoadStep) -> Any:
        """Return the fluid pressure at a load step just solved, as a function on the mesh [MPa]."""
        flow = self._flow_at(step)
        return self._leaking().pressure(flow, *self._section.pressures, "fluid_pressure")

    @property
    def fluid(self) -> FluidMap | None:
        """The fluid on the face at the load step solved last; None before the first."""
        if self._known is None:
            return None
        section, flow = self._section, self._known[1]
        return FluidMap(
            triangles=self._leaking().triangles,
            pressure_MPa=section.pressures[1] + flow.pressure * section.drop,
            leaving_mm3_per_s=flow.leaving * self._scale,
        )

    def _flow_at(self, step: LoadStep) -> Any:
        """Return the flow at the load step solved last, solved once."""
        if self._known is None or self._known[0] != step.step:
            self._known = step.step, self._flow(None)
        return self._known[1]

    def _flow(self, cause: str | None) -> Any:
        """Return the flow over the face, with a cause of its error varied but that of its mesh."""
        return self._leaking().flow(self._at_points(cause))

    def _at_points(self, cause: str | None) -> Array:
        """Return the transmissivities at this rank's points of the face, shape (n, 2) [mm³]."""
        solver: Any = self._coupling.solver
        patch, separation = solver.face.sampling("pointwise").patch, solver.point_separations
        values = np.zeros((len(separation), 2))
        for region, (law, error) in enumerate(zip(solver.table.laws, self._errors, strict=True)):
            inside = patch == region
            values[inside] = _transmissivity(law.transmissivity, cause, separation[inside], error)
        known = getattr(solver.face, "on_both", None)
        if known is not None:
            whole = np.zeros((len(known), 2))
            whole[known], values = values, whole
        return values


def _transmissivity(
    law: Transmissivity, cause: str | None, separation: Array, error: float
) -> Array:
    """Return what a law lets through at separations, with a cause of error varied."""
    return law.at(separation) if cause is None else law.varied(cause, separation, error)
