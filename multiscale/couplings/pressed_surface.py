"""Couplings that press one rough surface as a whole: what they have in common."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry import InputError, PatchGrid, RigidPlane, Surface
from geometry.materials import MaterialPair
from geometry.patches import patch_means
from geometry.statistics import roughness
from multiscale.bodies.scene_body import SceneBody
from multiscale.couplings import describe
from multiscale.couplings.coupling import Coupling, Facts
from multiscale.inputs.block import make_shape
from multiscale.inputs.body_facts import BodyFacts, second_material
from multiscale.inputs.loads import check_load, check_patches, load_history_on, patch_grid
from multiscale.inputs.surfaces import make_surfaces
from multiscale.machine import ClusterNodes
from multiscale.readable import quantity
from multiscale.scene.scene import Scene

Array = NDArray[np.float64]

CLOSURE_RESERVE = 0.15
"""Closure that laws are made for beyond the largest approach, relative to the largest interference.
The surface of a bent block may rise between the loads of its patches."""
_COVERED = 1e-6
"""Part of the surface's rectangle beside the contact face that is rounding."""


@dataclass(kw_only=True, eq=False)
class PressedSurface(Coupling):
    """A rough surface that is pressed as a whole.

    Attributes:
        counter_surface: What of the surface is the counter-body's; None where that is smooth.
        mean_heights: Mean height of each patch, shape (N,) [mm].
        plane_at_largest_load: The rigid plane at the largest load. Where the force or the moment is
            prescribed, it is the plane in equilibrium on a half-space, or None where nothing before
            the load steps needs it.
    """

    counter_surface: Surface | None = None
    mean_heights: Array
    plane_at_largest_load: RigidPlane | None = None

    @classmethod
    def _parts(
        cls, scene: Scene, facts: Facts, nodes: ClusterNodes, like: Coupling | None
    ) -> dict[str, Any]:
        """Return the attributes that all couplings of one surface have."""
        began = time.perf_counter()
        cls.check_memory(scene, nodes)
        if isinstance(like, PressedSurface):
            surface, counter_surface = like.surface, like.counter_surface
        else:
            surface, counter_surface = make_surfaces(scene)
        check_patches(scene, cls.patch_limits(scene, surface))
        face, counter = facts
        if face is None:
            face = BodyFacts.of_block(scene, make_shape(scene, surface, cls.cells_unstated(scene)))
        second = second_material(scene, counter)
        materials = MaterialPair(first=face.materials[0], second=second)
        check_load(scene, (surface,), surface.area, face if cls.has_body else None)
        patches = PatchGrid(grid=patch_grid(scene), lengths=surface.lengths)
        return {
            "scene": scene,
            "surface": surface,
            "counter_surface": counter_surface,
            "materials": materials,
            "patches": patches,
            "mean_heights": patch_means(surface, patches),
            "body": face,
            "counter": counter,
            "load_history": load_history_on(scene, (surface,)),
            "seconds": {"surface": time.perf_counter() - began},
        }

    def attach(self, comm: Any, meshes: tuple[SceneBody | None, SceneBody | None]) -> None:
        """Put the coupling on its bodies, whose contact faces must cover the surface."""
        first, counter = meshes
        section = self.scene.body
        if first is not None and section is not None:
            free = np.subtract(first.facts.lengths, self.surface.lengths)
            place = section.place or (0.5 * float(free[0]), 0.5 * float(free[1]))
            first, counter = first.placed(place), counter and counter.placed(place)
        super().attach(comm, (first, counter))
        for mesh, key in ((first, "body.place"), (counter, "counter_body.contact")):
            if mesh is not None:
                self._check_covered(mesh, key)

    def _check_covered(self, mesh: SceneBody, key: str) -> None:
        from macro import LoadedFace

        lengths = self.surface.lengths
        whole = PatchGrid(grid=(1, 1), lengths=lengths)
        try:
            face = LoadedFace(mesh.body, mesh.facets[0], whole)
            covered = float(face.areas[0]) / whole.area
        except InputError:  # no facet lies in it
            covered = 0.0
        if covered < 1.0 - _COVERED:
            x, y = mesh.facts.lengths
            raise InputError(
                f"the surface's rectangle, {lengths[0]:g} × {lengths[1]:g} mm, does not lie on the "
                f"contact face, which covers {100.0 * covered:.3g} % of it and is {x:.6g} × "
                f"{y:.6g} mm large",
                key=key,
                allowed="a rectangle on the face; or law.kind = 'representative', where the "
                "surface is a sample and the face may have any size and outline",
                file=self.scene.file,
            )

    @property
    def plane(self) -> RigidPlane:
        """The rigid plane at the largest load.

        Raises:
            ValueError: Where it is not known before the load steps.
        """
        if self.plane_at_largest_load is None:
            raise ValueError("the plane under this force is not known before the load steps")
        return self.plane_at_largest_load

    def interference(self, x: Array, y: Array, z: Array) -> Array:
        """Return how far points lie above the undeformed plane at the largest load [mm].

        Args:
            x: First coordinate of the points [mm].
            y: Second coordinate [mm].
            z: Height [mm].
        """
        return self.plane.at(x, y) - (self.surface.highest - z)

    @property
    def cell_interference(self) -> Array:
        """Interference of the heights of the surface, shape (nx, ny) [mm]."""
        surface = self.surface
        return self.interference(surface.x[:, None], surface.y, surface.heights)

    @cached_property
    def largest_interference(self) -> float:
        """Largest interference of the surface [mm], never less than the approach at the middle.

        Under a tilted plane the approach at the middle may be negative while its lower side
        touches.
        """
        return max(self.plane.approach, float(self.cell_interference.max()))

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

        It is the largest mean approach of the patch and `CLOSURE_RESERVE`. Laws that hold at points
        need the approach at the corners of the patch. A free plane may tilt further than on a
        half-space.
        """
        plane, loading = self.plane, self.scene.loading
        ends = plane.means(self.patches)
        if self._closes_at_corners:
            ends = ends + 0.5 * float(np.abs(np.multiply(self.patches.size, plane.tilt)).sum())
        if loading.tilt == "free":
            ends = ends + (ends.max() - plane.approach)
        return ends + CLOSURE_RESERVE * self.largest_interference

    @property
    def _closes_at_corners(self) -> bool:
        """Whether closures at the corners of a patch may be those of its law."""
        return self.scene.coupling.interface == "pointwise"

    def contact_statement(self) -> str:
        """Say what is in contact."""
        cells = f"{self.surface.heights.size} cells"
        if self.plane_at_largest_load is None:
            return cells
        return f"{cells}, {int((self.cell_interference > 0.0).sum())} within the largest approach"

    def load_statement(self) -> str:
        """Say the load steps, and the approach under a force where it is estimated."""
        text = describe.load(self)
        if self.load_history.quantity == "force" and self.plane_at_largest_load is not None:
            approach = quantity(self.plane.approach - self.zero, "mm", 3)
            text += f"; on a half-space its approach is about {approach}"
        return text

    @property
    def size(self) -> float:
        """Size of the interferences [mm]."""
        known = self.plane_at_largest_load is not None
        return self.largest_interference if known else roughness(self.surface).sq

    def contact_warnings(self) -> Iterator[str]:
        """Yield what is doubtful of the contact."""
        if self.plane_at_largest_load is not None and not self.interfering_patches:
            yield "nothing lies within the largest approach: no force will act"
