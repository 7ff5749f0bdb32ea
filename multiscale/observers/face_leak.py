"""The leak over the contact face of a body, between two of its edges, under laws of samples.

At every point of the face the law of the samples tells the mean separation, and their gaps under a
plane at that separation the transmissivity. The flow over the face is a problem of two dimensions.

Theory: docs/theory.md, section 16.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from micro.flow.triangle_flow import TriangleFace
from multiscale.laws.transmissivity import Transmissivity, transmissivities
from multiscale.loading.leak import Leak
from multiscale.loading.load_step import LoadStep
from multiscale.observers.step_observers import StepObserver
from multiscale.results.leak_notes import leak_notes
from multiscale.scene.leak import LeakSection
from support.arrays import Array
from support.collective import on_root
from support.errors import InputError

if TYPE_CHECKING:
    from multiscale.couplings.representative import RepresentativeCoupling
    from multiscale.inputs.bodies import SceneBody

_ON_FACE = 1e-6
"""Distance from the plane of the face, over its longer side, of nodes that lie on it."""


class FaceLeakObserver(StepObserver):
    """Adds what leaks over the contact face to load steps.

    Args:
        coupling: What finds the load steps, with laws of samples on a mesh.
        section: What its scene asks for.

    Raises:
        InputError: When the body has no such faces, or they share no edge with the contact face.

    Note:
        Everything is collective.
    """

    _coupling: RepresentativeCoupling

    def __init__(self, coupling: RepresentativeCoupling, section: LeakSection) -> None:
        super().__init__(coupling)
        self._section = section
        self._tables: list[tuple[Transmissivity, Transmissivity]] = []
        first = coupling.bodies.first
        assert first is not None, "scenes without a body on a mesh are refused"
        try:
            edges = [_places(first, getattr(section, key), key) for key in ("inlet", "outlet")]
            corners, self._facet = _triangles(first)
            self._face = TriangleFace(corners, *edges)  # the same on all ranks
        except InputError as error:
            raise error.located(key="leak", file=coupling.scene.file) from None

    def observe(self, step: LoadStep, before: LoadStep | None, *, last: bool) -> LoadStep:
        """Return the load step with its leak and its error."""
        coupling, section = self._coupling, self._section
        with coupling.clock.phase("leak"):
            if not self._tables:
                models = coupling.periodic_models
                self._tables = [transmissivities(one, coupling.comm) for one in models]
            found = [self._of_triangles(which) for which in (0, 1)]
            fine, coarse = on_root(
                coupling.comm, lambda: [self._face.flow(one).total for one in found]
            )
        scale = section.drop / (12.0 * section.viscosity_MPa_s)
        leak = Leak(way="face", rate=scale * fine)
        return replace(step, leaks=(leak.with_errors({"grid": abs(scale * (fine - coarse))}),))

    def _of_triangles(self, which: int) -> Array:
        """Return the transmissivities of all triangles of the face, shape (n, 2) [mm³].

        Args:
            which: 0 for those on the cells of the samples, 1 for those on half as many a side.
        """
        solver: Any = self._coupling.solver
        face, separation = solver.face, solver.point_separations
        points, facets = face.quadrature, face.facets
        values = np.zeros((len(separation), 2))
        for region, tables in enumerate(self._tables):
            inside = points.patch == region
            values[inside] = tables[which].at(separation[inside])
        order = np.argsort(facets.cell)
        facet = order[np.searchsorted(facets.cell, points.cell, sorter=order)]
        count = len(facets.cell)
        area = np.bincount(facet, points.weight, minlength=count)
        sums = [np.bincount(facet, points.weight * one, minlength=count) for one in values.T]
        own = np.stack(sums, axis=1) / area[:, None]
        return np.concatenate(face.comm.allgather(own))[self._facet]

    def notes(self, steps: Sequence[LoadStep]) -> Iterator[str]:
        """Yield what a report says of the leak."""
        yield from leak_notes(steps)


def _places(body: SceneBody, name: str | int, key: str) -> Array:
    """Return where the nodes of a face of a body lie in the plane of the contact face, (n, 2) [mm].

    Those beside the plane are left out.
    """
    from macro.mesh.facets import facet_nodes

    tagged = body.body.mesh
    tag = tagged.facet_tag(name, key=f"leak.{key}")
    points = tagged.mesh.geometry.x[facet_nodes(tagged.mesh, tagged.facet_tags.find(tag)).corners]
    points = np.concatenate(tagged.comm.allgather(points.reshape(-1, 3)))
    on_face = np.abs(body.frame.height(points)) < _ON_FACE * max(body.facts.lengths)
    return np.asarray(body.frame.in_plane(points[on_face]))


def _triangles(body: SceneBody) -> tuple[Array, Any]:
    """Return the triangles of the contact face of all ranks, (n, 3, 2) [mm], and their facets."""
    from macro.mesh.contact_face import facet_triangles

    own = body.facets[0].joined(body.facets[1:]).corners
    return facet_triangles(np.concatenate(body.body.mesh.comm.allgather(own)))
