"""Start of a load step: the two solutions before it, continued in the approach or the force."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry.rigid_plane import Control

Array = NDArray[np.float64]

_FARTHEST = 1.0  # steps ahead, or behind, that two solutions tell of


class Start(NamedTuple):
    """Where an iteration starts.

    Attributes:
        plane: Approach [mm] and slopes of the plane, shape (3,).
        displacement: This rank's owned degrees of freedom [mm].
        contact: Contact forces of its nodes, or pressures of its quadrature points, shape (n,).
    """

    plane: Array
    displacement: Array
    contact: Array


class StepHistory:
    """The last two solutions.

    Args:
        dofs: Number of this rank's degrees of freedom.
        places: Number of its nodes or quadrature points on the top.
    """

    def __init__(self, dofs: int, places: int) -> None:
        self._rest = Start(np.zeros(3), np.zeros(dofs), np.zeros(places))
        self._last: list[tuple[Start, float]] = []

    def add(self, solution: Start, force: float) -> None:
        """Add a solution.

        Args:
            solution: The solution.
            force: Its force [N].
        """
        self._last = [*self._last[-1:], (solution, force)]

    def start(self, control: Control) -> Start:
        """Return the line through the last two solutions, at what a load step prescribes.

        Args:
            control: What the load step prescribes: its approach, or its force, leads along.
        """
        if not self._last:
            return self._rest
        last, force = self._last[-1]
        before, least = self._last[0]
        if control.approach is not None:
            run, ahead = last.plane[0] - before.plane[0], control.approach - last.plane[0]
        else:
            run, ahead = force - least, (control.force or 0.0) - force
        share = float(np.clip(ahead / run, -_FARTHEST, _FARTHEST)) if run else 0.0
        pairs = zip(last, before, strict=True)
        return Start(*(new + share * (new - old) for new, old in pairs))
