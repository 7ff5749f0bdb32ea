"""Refines the meshes of a reference until their measured error keeps the accuracy."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from multiscale.couplings.reference import make_reference
from multiscale.planning.auto_keys import accuracy_of, with_value
from multiscale.results.accuracy_verdict import relative_error
from multiscale.scene.scene import Scene
from multiscale.setup.problem import ProblemSetup

Build = Callable[[Scene], ProblemSetup]
MeshError = Callable[[ProblemSetup], float]
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


def measured_mesh_error(setup: ProblemSetup) -> float:
    """Return the relative error of the force by the meshes of a reference at the largest load.

    Args:
        setup: The problem, of a reference with several meshes.

    Raises:
        NotConverged: When the contact problem cannot be solved.
    """
    coupling, load_history = make_reference(setup, None), setup.load_history
    step = coupling.press(load_history.control(load_history.largest))
    (found,) = coupling.record([step]).with_errors([step])
    if not step.force_N > 0.0:
        return 0.0
    error = relative_error(found, by_force=load_history.quantity == "force")
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

    def with_refined_meshes(self, setup: ProblemSetup) -> tuple[ProblemSetup, Errors]:
        """Refine the meshes of a reference until their error keeps the accuracy."""
        setup = self.with_first_meshes(setup)
        assert setup.meshes is not None
        if len(setup.meshes.shapes) == 1:  # one mesh does not show its error
            return setup, {}
        for _ in range(_TRIALS):
            error, fine = self.mesh_error(setup), setup.scene.reference.fine
            if error <= self.accuracy or not self._may_refine(setup) or fine is None:
                break
            finer = refinement(error / self.accuracy, setup.meshes.force_order)
            refined = self.build(with_value(setup.scene, "reference.fine", fine / finer))
            if not self.is_small(refined):
                break
            setup = refined
        return setup, {"mesh": error}

    def is_small(self, setup: ProblemSetup) -> bool:
        """Tell whether the meshes of a reference have no more unknowns than are chosen."""
        assert setup.meshes is not None
        return sum(setup.meshes.unknowns) <= _MOST_UNKNOWNS

    def _may_refine(self, setup: ProblemSetup) -> bool:
        """Tell whether the scene leaves the size of tetrahedra open."""
        assert setup.meshes is not None
        return self.given.reference.fine is None and not setup.meshes.hexahedral

    def with_first_meshes(self, setup: ProblemSetup) -> ProblemSetup:
        """Return a reference with the meshes to try first, coarser for a lower accuracy."""
        if not self._may_refine(setup) or setup.scene.reference.fine is not None:
            return setup
        assert setup.meshes is not None
        coarser = min(max((self.accuracy / _DEFAULT_MESHES) ** 0.5, 1.0), _COARSEST_MESH)
        fine = coarser * float(setup.meshes.sizes[-1])
        return self.build(with_value(setup.scene, "reference.fine", fine))
