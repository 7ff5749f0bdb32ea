"""Refines the meshes of a reference until their measured error keeps the accuracy."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from multiscale.auto.keys import accuracy_of, with_value
from multiscale.couplings.coupling import Coupling
from multiscale.couplings.reference import ReferenceCoupling
from multiscale.results.notes import relative_error
from multiscale.scene.scene import Scene

Build = Callable[[Scene], Coupling]
MeshError = Callable[[ReferenceCoupling], float]
Errors = Mapping[str, float]

_TRIALS = 6
"""Most trials of the size of meshes."""
_LEAST_STEP, _LARGEST_STEP = 1.3, 2.0
"""Limits of the refinement from one trial to the next."""
_MOST_UNKNOWNS = 1_000_000
"""Unknowns of all meshes of a reference beyond which they are not refined of themselves: 3.5 GB."""
_DEFAULT_MESHES = 0.005
"""Error, roughly, of the meshes that a reference has by default."""
_COARSEST_MESH = 1.8
"""Largest edge length of the first meshes, relative to the default."""


def refinement(excess: float, order: float) -> float:
    """Return the refinement for the next trial.

    Args:
        excess: Error over allowed error.
        order: Known order of the error in the size.
    """
    return min(max(excess ** (1.0 / order), _LEAST_STEP), _LARGEST_STEP)


def measured_mesh_error(coupling: ReferenceCoupling) -> float:
    """Return the relative error of the force by the meshes of a reference at the largest load.

    Args:
        coupling: The reference, with several meshes.

    Raises:
        NotConverged: When the contact problem cannot be solved.
    """
    history = coupling.load_history
    step = coupling.press(history.control(history.largest))
    (with_error,), _ = coupling.with_mesh_errors([step])
    coupling.release()
    if not step.force_N > 0.0:
        return 0.0
    error = relative_error(with_error, by_force=history.quantity == "force")
    return 1.0 if error is None else error


@dataclass(frozen=True)
class MeshSearch:
    """The search for meshes of a reference.

    Args:
        given: The scene as it was given.
        build: Sets up a scene without auto values.
        mesh_error: Measures the relative error of the meshes.
    """

    given: Scene
    build: Build
    mesh_error: MeshError

    @property
    def accuracy(self) -> float:
        """Relative error of the force that may be left."""
        return accuracy_of(self.given)

    def with_refined_meshes(self, coupling: ReferenceCoupling) -> tuple[ReferenceCoupling, Errors]:
        """Refine the meshes of a reference until their error keeps the accuracy."""
        coupling = self.with_first_meshes(coupling)
        if len(coupling.rough_meshes.shapes) == 1:  # one mesh does not show its error
            return coupling, {}
        for _ in range(_TRIALS):
            error, fine = self.mesh_error(coupling), coupling.scene.reference.fine
            if error <= self.accuracy or not self._may_refine(coupling) or fine is None:
                break
            finer = refinement(error / self.accuracy, coupling.rough_meshes.force_order)
            refined = self._with_fine(coupling, fine / finer)
            if not self.is_small(refined):
                break
            coupling = refined
        return coupling, {"mesh": error}

    def is_small(self, coupling: ReferenceCoupling) -> bool:
        """Tell whether the meshes of a reference have no more unknowns than are chosen."""
        return sum(coupling.rough_meshes.unknowns) <= _MOST_UNKNOWNS

    def _may_refine(self, coupling: ReferenceCoupling) -> bool:
        """Tell whether the scene leaves the size of tetrahedra open."""
        return self.given.reference.fine is None and not coupling.rough_meshes.hexahedral

    def with_first_meshes(self, coupling: ReferenceCoupling) -> ReferenceCoupling:
        """Return a reference with the meshes to try first, coarser for a lower accuracy."""
        if not self._may_refine(coupling) or coupling.scene.reference.fine is not None:
            return coupling
        coarser = min(max((self.accuracy / _DEFAULT_MESHES) ** 0.5, 1.0), _COARSEST_MESH)
        return self._with_fine(coupling, coarser * float(coupling.rough_meshes.sizes[-1]))

    def _with_fine(self, coupling: ReferenceCoupling, fine: float) -> ReferenceCoupling:
        return self.reference(with_value(coupling.scene, "reference.fine", fine))

    def reference(self, scene: Scene) -> ReferenceCoupling:
        """Return the reference of a scene.

        Args:
            scene: The scene, of a reference.
        """
        made = self.build(scene)
        assert isinstance(made, ReferenceCoupling)
        return made
