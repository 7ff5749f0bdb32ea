"""From a scene to its coupling: the only place that asks which coupling a scene has."""

from __future__ import annotations

from typing import Any

from multiscale.couplings.coupling import Coupling
from multiscale.couplings.micro_coupling import AnalyticCoupling, ConcurrentCoupling
from multiscale.couplings.patch_laws import ConsistentCoupling, IsolatedCoupling
from multiscale.couplings.reference import ReferenceCoupling
from multiscale.couplings.representative import RepresentativeCoupling
from multiscale.scene.scene import Scene

COUPLINGS: dict[str, type[Coupling]] = {
    "analytic": AnalyticCoupling,
    "concurrent": ConcurrentCoupling,
    "consistent": ConsistentCoupling,
    "isolated": IsolatedCoupling,
    "representative": RepresentativeCoupling,
    "reference": ReferenceCoupling,
    "auto": ConsistentCoupling,  # until it is chosen
}
"""The class of every coupling."""


def coupling_class(scene: Scene) -> type[Coupling]:
    """Return the class of a scene's coupling.

    Args:
        scene: The scene.
    """
    return COUPLINGS[scene.kind]


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
        import macro  # noqa: F401
