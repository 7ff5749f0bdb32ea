"""The whole rough surface on a finite block, solved together at every load step, without laws."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from geometry.control import Control
from geometry.errors import NotConverged
from geometry.patches import PatchGrid
from micro import MicroModel, Response, RigidPlane
from multiscale.balance import Balance
from multiscale.coupling import response_step
from multiscale.history import LoadStep

if TYPE_CHECKING:  # finite elements are imported only by scenes that need them
    from macro.correction import Correction

Array = NDArray[np.float64]

TOLERANCE = 1e-8
"""Change of the forces on the block between iterations, relative to the whole force."""

_MOST_ITERATIONS = 60
_MEMORY = 5  # earlier iterations that the next one is extrapolated from


class ConcurrentCoupling:
    """The micro model pressed by a plane that sags by what the block yields beyond a half-space.

    The forces P of the contacts, gathered on rectangles, move the block's top by D P more than
    the half-space that the micro model stands on; to the contacts this is a plane that has come
    less near. P = contact(δ − D P) is solved by Anderson's accelerated iteration (Walker & Ni
    2011, doi 10.1137/10078356X), each from the contacts of the one before.

    Args:
        model: Micro model of the whole surface.
        patches: Partition that the results are summed over; it does not change the solution.
        mean_heights: Mean height of each patch, shape (N,) [mm].
        correction: D.
    """

    def __init__(
        self, model: MicroModel, patches: PatchGrid, mean_heights: Array, correction: Correction
    ) -> None:
        self._model, self._correction = model, correction
        self._patches, self._mean_heights = patches, mean_heights
        self._forces: Array = np.zeros(correction.loads.count)
        self._start: Any = None
        self._iterations = 0
        half = 0.5 * float(np.hypot(*patches.lengths))
        self._balance = Balance(half=half, first_touch=model.first_touch)

    def press(self, control: Control) -> LoadStep:
        """Solve one load step; see `Coupling.press`."""
        self._iterations = 0
        plane, rigid = self._balance.solve(self._loads, control)
        response = self._pressed(rigid, self._patches, self._mean_heights)
        return response_step(
            response,
            self._patches,
            plane=plane,
            closure=rigid.means(self._patches) - response.patch_displacement[0],
            iterations=self._iterations,
        )

    def _loads(self, plane: Array) -> tuple[Array, RigidPlane]:
        """Return force and moments of a plane on the block, and the plane as contacts see it."""
        loads = self._correction.loads
        forces, steps = self._forces, _Anderson(_MEMORY)
        for _ in range(_MOST_ITERATIONS):
            self._iterations += 1
            rigid = self._rigid(plane, forces)
            response = self._pressed(rigid, loads, np.zeros(loads.count))
            found = response.patch_force[0]
            if np.abs(found - forces).sum() <= TOLERANCE * found.sum():
                self._forces = found
                return np.array([response.force[0], *response.moment[0]]), rigid
            forces = np.maximum(steps.next(forces, found), 0.0)
        raise NotConverged(
            f"block and contacts at an approach of {plane[0]:.6g} mm",
            reason="DIVERGED_MAX_IT",
            iterations=_MOST_ITERATIONS,
            remedy="take more load steps (load.steps)",
        )

    def _rigid(self, plane: Array, forces: Array) -> RigidPlane:
        middle = np.add(self._patches.origin, np.multiply(0.5, self._patches.lengths))
        return RigidPlane(
            approach=float(plane[0]),
            tilt=(float(plane[1]), float(plane[2])),
            centre=(float(middle[0]), float(middle[1])),
            sag=self._correction.sag(forces),
        )

    def _pressed(self, rigid: RigidPlane, patches: PatchGrid, mean_heights: Array) -> Response:
        response, self._start = self._model.press(
            rigid, patches=patches, mean_heights=mean_heights, start=self._start
        )
        return response


class _Anderson:
    """Anderson's acceleration of a fixed-point iteration x = g(x)."""

    def __init__(self, memory: int) -> None:
        self._memory = memory
        self._tried: list[Array] = []
        self._found: list[Array] = []

    def next(self, tried: Array, found: Array) -> Array:
        """Return the next x from all pairs (x, g(x)) so far."""
        self._tried = [*self._tried, tried][-self._memory :]
        self._found = [*self._found, found][-self._memory :]
        if len(self._tried) == 1:
            return found
        values = np.array(self._found)
        misses = values - np.array(self._tried)
        share, *_ = np.linalg.lstsq(np.diff(misses, axis=0).T, misses[-1], rcond=1e-10)
        return np.asarray(found - share @ np.diff(values, axis=0))
