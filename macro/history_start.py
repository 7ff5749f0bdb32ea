"""Start of a load step: the two solutions before it, continued in the approach or the force."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry.control import Control

Array = NDArray[np.float64]

_FARTHEST = 1.0  # steps ahead, or behind, that two solutions tell of


class Start(NamedTuple):
    """Where an iteration starts.

    Attributes:
        plane: Approach [mm] and slopes of the plane, shape (3,).
        displacement: This rank's owned degrees of freedom [mm].
        active: Whether its nodes of the top were in contact, shape (n,).
    """

    plane: Array
    displacement: Array
    active: NDArray[np.bool_]


class StepHistory:
    """The last two solutions."""

    def __init__(self) -> None:
        self._last: list[tuple[Start, float]] = []

    def add(self, solution: Start, force: float) -> None:
        """Add a solution.

        Args:
            solution: The solution.
            force: Its force [N].
        """
        self._last = [*self._last[-1:], (solution, force)]

    def start(self, control: Control, dofs: int, nodes: int) -> Start:
        """Return the line through the last two solutions, at what a load step prescribes.

        Args:
            control: What the load step prescribes: its approach, or its force, leads along.
            dofs: Number of this rank's degrees of freedom.
            nodes: Number of its nodes of the top.
        """
        if not self._last:
            return Start(np.zeros(3), np.zeros(dofs), np.zeros(nodes, dtype=bool))
        (last, force) = self._last[-1]
        plane, displacement = last.plane.copy(), last.displacement
        if len(self._last) > 1:
            before, least = self._last[0]
            run, ahead = (
                (last.plane[0] - before.plane[0], (control.approach or 0.0) - last.plane[0])
                if control.force is None
                else (force - least, control.force - force)
            )
            share = float(np.clip(ahead / run, -_FARTHEST, _FARTHEST)) if run else 0.0
            plane = plane + share * (last.plane - before.plane)
            displacement = displacement + share * (displacement - before.displacement)
        return Start(plane, displacement, last.active)
