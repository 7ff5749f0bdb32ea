"""The order of magnitude of a run's time, and its memory by part."""

from __future__ import annotations

import math
from collections.abc import Iterator

from multiscale.couplings.coupling import Coupling
from multiscale.couplings.work import Work
from multiscale.readable import duration

_START, _PICTURES = 2.0, 4.0
"""Time of imports and tables, and of figures and report [s]."""
_ORDERS = (1, 3, 10, 30, 120, 300, 900, 3600, 3 * 3600, 10 * 3600, 24 * 3600, 72 * 3600, 240 * 3600)
"""Times that are said [s]."""

_LIBRARIES = 70e6
"""Memory of dolfinx, and of matplotlib [B]."""
_HEIGHT = 87.0
"""Memory per height of the surface with its spline, and of figures [B]."""


def cost_statements(coupling: Coupling, program: float, ranks: int) -> Iterator[tuple[str, str]]:
    """Yield what a run computes, the order of magnitude of its time, and its memory.

    Args:
        coupling: The coupling.
        program: Memory of a process before anything of the scene is in it [B].
        ranks: Processes of the MPI job.
    """
    work, output = coupling.work(ranks), coupling.scene.output
    yield from work.statements()
    seconds = work.computing + _START + _PICTURES * bool(output.figures or output.report)
    parts = memory_parts(coupling, work, program)
    largest = max(parts, key=lambda part: parts[part])
    yield (
        "cost",
        f"of the order of {magnitude(seconds)}, more on slow or busy cores; the run tells its own "
        f"pace after its first load step; {sum(parts.values()) / 1e6:.0f} MB, most of it for the "
        f"{largest}",
    )


def memory_parts(coupling: Coupling, work: Work, program: float) -> dict[str, float]:
    """Return the memory of the first process by part [B].

    Args:
        coupling: The coupling.
        work: What it computes.
        program: Memory of a process before anything of the scene is in it [B].
    """
    libraries = coupling.has_body + bool(coupling.scene.output.figures)
    asked = (one for one in coupling.memory_requests() if not one.key.startswith("surface"))
    return {
        "program": program + _LIBRARIES * libraries,
        "surface": _HEIGHT * coupling.surface.heights.size,
        "meshes and laws": sum(
            one.shared / work.ranks + one.per_rank + one.root_only for one in asked
        ),
        "contact problem": work.memory,
    }


def magnitude(seconds: float) -> str:
    """Return the order of magnitude of a time, such as ``10 s`` or ``3 h``.

    Args:
        seconds: The time [s].
    """
    return duration(min(_ORDERS, key=lambda one: abs(math.log(one / max(seconds, 1e-3)))))
