"""Which sections do not go with a hardness, and which not with conductance."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any


def problems_of_hardness(scene: Any) -> Iterator[tuple[str, str]]:
    """Yield what has no plastic depth, or forgets it: keys, and why they do not fit.

    Args:
        scene: The sections of a scene.
    """
    if scene.micro.hardness is None:
        return
    if scene.micro.model != "half-space":
        yield (
            "micro.hardness",
            f"does not go with micro.model = '{scene.micro.model}', which has no cells to yield "
            "(allowed: micro.model = 'half-space')",
        )
    if scene.kind in ("isolated", "reference"):
        yield (
            "micro.hardness",
            f"does not go with coupling.kind = '{scene.kind}', which is elastic (allowed: "
            "coupling.kind = 'concurrent', 'consistent' or 'analytic')",
        )
    with_laws = scene.kind in ("consistent", "representative", "auto")
    if with_laws and scene.loading.load_history.unloads:
        yield (
            "micro.hardness",
            "does not go with a load that turns back where patch laws stand for the contact: "
            "they are those of rising loads and have no plastic depth (allowed: "
            "coupling.kind = 'concurrent')",
        )


def problems_of_conductance(scene: Any) -> Iterator[tuple[str, str]]:
    """Yield what does not know the stiffness of the interface alone: keys, and why.

    Args:
        scene: The sections of a scene.
    """
    if scene.conductance is None:
        return
    if scene.kind == "reference":
        yield (
            "conductance",
            "does not go with coupling.kind = 'reference', whose meshes do not tell the "
            "stiffness of the interface from that of the block (allowed: coupling.kind = "
            "'concurrent', 'consistent', 'isolated' or 'analytic')",
        )
    with_laws = scene.kind not in ("concurrent", "analytic")
    if scene.micro.hardness is not None and with_laws:
        yield (
            "conductance",
            "does not go with micro.hardness where patch laws stand for the contact: their "
            "stiffness is that of contacts that yield, which conduct all the same (allowed: "
            "coupling.kind = 'concurrent')",
        )
    if scene.kind in ("concurrent", "analytic", "auto") and scene.micro.model != "half-space":
        yield (
            "conductance",
            f"does not go with micro.model = '{scene.micro.model}' without laws (allowed: "
            "micro.model = 'half-space'; or coupling.kind = 'consistent' or 'isolated')",
        )
