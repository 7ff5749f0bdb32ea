"""A rough surface under a plane less the sag of the block, by forces on load rectangles."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from geometry.collective import on_root
from geometry.control import Control
from geometry.partition import Partition
from geometry.patches import PatchGrid
from micro import MicroModel, Response, RigidPlane
from multiscale.coupling import response_step
from multiscale.load_step import LoadStep

Array = NDArray[np.float64]


class SmoothCorrection(Protocol):
    """What a block's surface yields beyond the half-space."""

    @property
    def loads(self) -> Partition:
        """The M rectangles whose forces drive it."""

    def sag(self, forces: Array) -> Callable[[Array, Array], Array]:
        """Return the displacement (x, y) → [mm], linear in the forces (M,) [N]."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Trial:
    """The micro model under one plane, with the sag by assumed forces.

    Attributes:
        plane: Approach at the middle [mm] and slopes, shape (3,).
        assumed: Forces on the load rectangles that the sag is by, shape (M,) [N].
        local: Rigid approaches less sag at the middles of the load rectangles, shape (M,) [mm].
        response: What the micro model answers, summed over the load rectangles.
        start: Where the micro model may start from next; None but on rank 0.
    """

    plane: Array
    assumed: Array
    local: Array
    response: Response
    start: Any

    @property
    def found(self) -> Array:
        """Forces found on the load rectangles, shape (M,) [N]."""
        return np.asarray(self.response.patch_force[0])

    def excess(self, control: Control) -> Array:
        """Return force and moments beyond those prescribed, shape (3,) [N, N mm]."""
        force = self.response.force[0] - (control.force or 0.0)
        return np.array([force, *self.response.moment[0]])


class SaggingContact:
    """A micro model pressed by rank 0 for all ranks, and the yielding at its load rectangles.

    Args:
        model: Micro model of the whole surface.
        patches: Partition that load steps are summed over.
        mean_heights: Mean height of each patch, shape (N,) [mm].
        correction: What the block yields beyond the half-space.
        comm: MPI communicator (mpi4py) or None.

    Attributes:
        loads: The load rectangles.
        shape: Approach at the load rectangles by unit approach and slopes, shape (M, 3).
        yielding: Sag at the load rectangles by unit forces on them, shape (M, M) [mm/N].
    """

    def __init__(
        self,
        model: MicroModel,
        patches: PatchGrid,
        mean_heights: Array,
        correction: SmoothCorrection,
        comm: Any,
    ) -> None:
        self._model, self._patches, self._heights = model, patches, mean_heights
        self._correction, self._comm = correction, comm
        self.loads = loads = correction.loads
        self._middle = loads.middle
        self.shape = np.column_stack([np.ones(loads.count), loads.centres - self._middle])
        x, y = loads.centres.T
        units = np.eye(loads.count)
        self.yielding = np.column_stack([correction.sag(unit)(x, y) for unit in units])

    @property
    def first_touch(self) -> float:
        """Approach of a level plane at first contact [mm]."""
        return self._model.first_touch

    def press(self, plane: Array, assumed: Array, before: Trial | None) -> Trial:
        """Press the micro model, the sag by assumed forces.

        Args:
            plane: Approach at the middle [mm] and slopes, shape (3,).
            assumed: Forces on the load rectangles, shape (M,) [N].
            before: A trial nearby to start from.
        """
        loads, rigid = self.loads, self._rigid(plane, assumed)
        start = None if before is None else before.start
        kept: list[Any] = [None]

        def work() -> Response:
            zeros = np.zeros(loads.count)
            response, kept[0] = self._model.press(
                rigid, patches=loads, mean_heights=zeros, start=start
            )
            return response

        response = on_root(self._comm, work)
        local = self.shape @ plane - self.yielding @ assumed
        return Trial(plane=plane, assumed=assumed, local=local, response=response, start=kept[0])

    def _rigid(self, plane: Array, assumed: Array) -> RigidPlane:
        return RigidPlane(
            approach=float(plane[0]),
            tilt=(float(plane[1]), float(plane[2])),
            centre=(float(self._middle[0]), float(self._middle[1])),
            sag=self._correction.sag(assumed) if assumed.any() else None,
        )

    def summed(self, trial: Trial, count: int) -> LoadStep:
        """Return a trial as a load step, summed over the scene's patches.

        Args:
            trial: The trial.
            count: Presses that led to it.
        """
        rigid = self._rigid(trial.plane, trial.assumed)

        def work() -> tuple[Response, Array]:
            response = self._model.press(
                rigid, patches=self._patches, mean_heights=self._heights, start=trial.start
            ).response
            return response, rigid.means(self._patches) - response.patch_displacement[0]

        response, closure = on_root(self._comm, work)
        return response_step(
            response, self._patches, plane=trial.plane, closure=closure, iterations=count
        )
