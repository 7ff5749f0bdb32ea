"""From a scene to its coupling: the only place that asks which coupling a scene has."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from patchlaw.multiscale.couplings.coupling import Coupling
    from patchlaw.multiscale.scene.scene import Scene

COUPLINGS = {
    "analytic": "micro_coupling.AnalyticCoupling",
    "concurrent": "micro_coupling.ConcurrentCoupling",
    "consistent": "patch_laws.ConsistentCoupling",
    "isolated": "patch_laws.IsolatedCoupling",
    "representative": "representative.RepresentativeCoupling",
    "reference": "reference.ReferenceCoupling",
}
"""Module and class of every coupling; a run loads its own."""


def coupling_class(scene: Scene) -> type[Coupling]:
    """Return the class of a scene's coupling.

    Args:
        scene: The scene.
    """
    module, _, name = COUPLINGS[scene.kind].partition(".")
    known: type[Coupling] = getattr(import_module(f"patchlaw.multiscale.couplings.{module}"), name)
    return known


def load_finite_elements(scene: Scene, comm: Any) -> None:
    """Import the finite elements on all ranks where a scene may need them.

    PETSc starts with collective calls on all processes of the job, so that one rank alone must not
    import it.

    Args:
        scene: The scene.
        comm: MPI communicator; None for this process alone, which imports them when it needs them.

    Note:
        Collective.
    """
    meshed = scene.body is not None or (scene.counter_body and scene.counter_body.mesh)
    if comm is not None and (coupling_class(scene).has_body or meshed):
        import patchlaw.macro.bodies  # noqa: F401
