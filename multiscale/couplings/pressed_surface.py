"""Couplings that press one rough surface as a whole: what they have in common."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from patchlaw.geometry import PatchGrid
from patchlaw.geometry.materials import MaterialPair
from patchlaw.geometry.patches import patch_means
from patchlaw.multiscale.couplings.coupling import Coupling, Meshes
from patchlaw.multiscale.scene.loads import check_load, check_patches, load_history_on
from patchlaw.multiscale.scene.memory import check_memory
from patchlaw.multiscale.scene.parts import BodyFacts, Source, second_material
from patchlaw.multiscale.scene.surfaces import located, make_surfaces
from patchlaw.support.arrays import Array


@dataclass(kw_only=True, eq=False)
class PressedSurface(Coupling):
    """A rough surface that is pressed as a whole.

    Attributes:
        mean_heights: Mean height of each patch, shape (N,) [mm].
    """

    mean_heights: Array

    @classmethod
    def _parts(cls, source: Source) -> dict[str, Any]:
        """Return the attributes that all couplings of one surface have."""
        began, scene = time.perf_counter(), source.scene
        check_memory(source.nodes, cls.requests(scene))
        surface, counter_surface = make_surfaces(scene)
        check_patches(scene, cls.patch_limits(scene, surface))
        body, counter = source.facts
        body = body or BodyFacts.of_block(scene, surface, cls.unstated_cells(scene))
        materials = MaterialPair(first=body.materials[0], second=second_material(scene, counter))
        history = load_history_on(scene, (surface,), surface.area)
        check_load(scene, history, (surface,), surface.area, body if cls.has_body else None)
        patches = PatchGrid(grid=scene.patches.grid, lengths=surface.lengths)
        return {
            "scene": scene,
            "surface": surface,
            "counter_surface": counter_surface,
            "materials": materials,
            "patches": patches,
            "mean_heights": patch_means(surface, patches),
            "body": body,
            "counter": counter,
            "load_history": history,
            "seconds": {"surface": time.perf_counter() - began},
        }

    def attach(self, comm: Any, meshes: Meshes) -> None:
        """Put the coupling on its bodies, whose contact faces must cover the surface."""
        first, counter = meshes
        section, lengths = self.scene.body, self.surface.lengths
        if first is not None and section is not None:
            free = np.subtract(first.facts.lengths, lengths)
            place = section.place or (0.5 * float(free[0]), 0.5 * float(free[1]))
            first, counter = first.placed(place), counter and counter.placed(place)
        super().attach(comm, (first, counter))
        for mesh, key in ((first, "body.place"), (counter, "counter_body.contact")):
            if mesh is not None:
                with located(self.scene, key):
                    mesh.check_covers(lengths)

    @property
    def interfering_patches(self) -> int:
        """Number of patches that the largest closures of their laws bring into contact."""
        surface, largest = self.surface, self.largest_closures
        if self.summits is not None:
            x, y, z = self.summits.x, self.summits.y, self.summits.z
        else:  # few of many heights come near
            i, j = np.nonzero(largest.max() > surface.highest - surface.heights)
            x, y, z = surface.x[i], surface.y[j], surface.heights[i, j]
        owner = self.patches.index_of(x, y)
        closes = largest[owner] > surface.highest - z
        return int(np.unique(owner[closes]).size)

    @property
    def largest_closures(self) -> Array:
        """Largest closure that the law of each patch is made for, shape (N,) [mm].

        It is the largest mean approach of the patch and 15 % of the largest interference, for the
        surface of a bent block may rise between the loads of its patches. Laws that hold at points
        need the approach at the corners of the patch. A free plane may tilt further than on a
        half-space.
        """
        plane, loading = self.plane, self.scene.loading
        ends = plane.means(self.patches)
        if self._closes_at_corners:
            ends = ends + 0.5 * float(np.abs(np.multiply(self.patches.size, plane.tilt)).sum())
        if loading.tilt == "free":
            ends = ends + (ends.max() - plane.approach)
        return ends + 0.15 * self.largest_interference

    @property
    def _closes_at_corners(self) -> bool:
        """Whether closures at the corners of a patch may be those of its law."""
        return self.scene.coupling.interface == "pointwise"

    def contact_warnings(self) -> Iterator[str]:
        """Yield what is doubtful of the contact."""
        if self.plane_at_largest_load is not None and not self.interfering_patches:
            yield "nothing lies within the largest approach: no force will act"
