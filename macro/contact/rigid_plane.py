"""A rigid plane over the places of a rough top: closures, loads, what is prescribed of it."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from geometry.errors import NotConverged
from geometry.rigid_plane import Control
from macro.contact.plane_equilibrium import LOOSE, Excess, settle

Array = NDArray[np.float64]


class Task(NamedTuple):
    """What a load step asks of the plane.

    Attributes:
        plane: Where the plane is, as far as that is prescribed; elsewhere the start; shape (3,).
        free: Which motions follow from the loads, shape (3,).
        force: Force that is wanted, if one is [N].
    """

    plane: Array
    free: NDArray[np.bool_]
    force: float | None

    @property
    def wanted(self) -> Array:
        """Loads wanted along the free motions, shape (k,) [N]."""
        return np.array([self.force or 0.0, 0.0, 0.0])[self.free]


class RigidPlane:
    """A rigid plane above this rank's places on the top.

    Args:
        x: Abscissae of the places, shape (n,) [mm].
        y: Their ordinates [mm].
        rest: Their distances from the plane at no approach and no tilt [mm].
        lengths: Sides of the interface, whose middle the plane turns about [mm].
        comm: MPI communicator.

    Attributes:
        rest: As given.
        middle: Middle of the interface, shape (2,) [mm].
        half: Half the diagonal of the interface: what moments are divided by [mm].
        unit: Motions of the plane that move its edge by one, shape (3,).
    """

    def __init__(
        self, x: Array, y: Array, rest: Array, lengths: tuple[float, float], comm: Any
    ) -> None:
        self.rest, self._comm = rest, comm
        self.middle = 0.5 * np.asarray(lengths)
        self.half = 0.5 * float(np.hypot(*lengths))
        self.unit = np.array([1.0, 1.0 / self.half, 1.0 / self.half])
        self._lever = np.column_stack((np.ones_like(x), x - self.middle[0], y - self.middle[1]))

    def task(self, control: Control, plane: Array) -> Task:
        """Return what a load step asks; without any force the plane just touches the top.

        Args:
            control: What the load step prescribes.
            plane: Where the plane is, or where it may start, shape (3,).
        """
        force, plane = control.force, plane.copy()
        turns = control.tilt is None and force != 0.0
        if control.tilt is not None:
            plane[1:] = control.tilt
        if control.approach is not None:
            plane[0] = control.approach
        elif force == 0.0:
            plane[0] = self.touch(plane[1:])
        return Task(plane, np.array([bool(force), turns, turns]), force or None)

    def touch(self, tilt: Array) -> float:
        """Return the approach at which a tilted plane first touches the undeformed top [mm]."""
        least = float(np.min(self.rest - self._lever[:, 1:] @ tilt, initial=np.inf))
        return float(self._comm.allreduce(least, op=MPI.MIN))

    def closure(self, plane: Array, sag: Array) -> Array:
        """Return how far the plane is below the places, negative where it is above, (n,) [mm].

        Args:
            plane: Approach [mm] and slopes, shape (3,).
            sag: Downward displacements of the places, shape (n,) [mm].
        """
        return self._lever @ plane - sag - self.rest

    def loads(self, forces: Array) -> Array:
        """Return force and first moments about the middle, shape (3,) [N, N mm].

        Args:
            forces: Forces at the places, shape (n,) [N].
        """
        return self._sum(self._lever.T @ forces)

    def levers(self, free: NDArray[np.bool_]) -> Array:
        """Return the change of closures by free motions that move the edge by one, (n, k)."""
        return self._lever[:, free] * self.unit[free]

    def held(self, free: NDArray[np.bool_], at: NDArray[np.bool_]) -> Array:
        """Return the combinations of free motions that move some of the places, shape (k, k').

        They are scaled so that ``levers(free)[at] @ held(free, at)`` has orthonormal columns, all
        ranks together.

        Args:
            free: Motions that are free, shape (3,).
            at: Which of this rank's places are meant, shape (n,).
        """
        levers = self.levers(free)[at]
        values, vectors = np.linalg.eigh(self._sum(levers.T @ levers))
        found = values > LOOSE * max(values.max(initial=0.0), 1.0)
        scaled: Array = vectors[:, found] / np.sqrt(values[found])
        return scaled

    def settled(self, task: Task, sag: Array, stiffness: Array) -> Array:
        """Return where the plane comes to rest on springs at the places, shape (3,).

        Args:
            task: What is asked of the plane.
            sag: Downward displacements of the places, shape (n,) [mm].
            stiffness: Stiffnesses of springs that only push, shape (n,) [N/mm].

        Raises:
            NotConverged: When nothing can hold the plane.
        """
        plane, free = task.plane.copy(), task.free
        if free.any():
            springs = _Springs(self, task, sag, stiffness)
            plane[free] = self.unit[free] * settle(springs, plane[free] / self.unit[free])
        return plane

    def _sum(self, values: Array) -> Array:
        return self._comm.allreduce(values, op=MPI.SUM)


class _Springs:
    """Free motions of a plane over springs; see `settle`."""

    def __init__(self, plane: RigidPlane, task: Task, sag: Array, stiffness: Array) -> None:
        self._plane, self._task, self._stiffness = plane, task, stiffness
        self._levers, self.half = plane.levers(task.free), plane.half
        self._depth = plane.closure(np.where(task.free, 0.0, task.plane), sag)

    def excess(self, motion: Array) -> Excess:
        """Return the loads beyond those wanted."""
        depth = self._depth + self._levers @ motion
        loads = self._plane.loads(self._stiffness * np.maximum(depth, 0.0)) * self._plane.unit
        force = float(loads[0])
        return Excess(loads[self._task.free] - self._task.wanted, force, self._task.force or force)

    def stiffness(self, motion: Array) -> Array:
        """Return the derivative of the loads."""
        pressed = np.where(self._depth + self._levers @ motion > 0.0, self._stiffness, 0.0)
        stiffness: Array = self._plane._sum(self._levers.T @ (pressed[:, None] * self._levers))
        return stiffness

    def reach(self, motion: Array) -> float:
        """Return the displacement of the plane's edge, at most [mm]."""
        fixed = np.where(self._task.free, 0.0, self._task.plane / self._plane.unit)
        return float(np.abs(fixed).sum() + np.abs(motion).sum())


def not_found(control: Control, reason: str, iterations: int) -> NotConverged:
    """Return the error of a load step whose contact was not found.

    Args:
        control: What the load step prescribes.
        reason: Name of the reason.
        iterations: Iterations that were made.
    """
    return NotConverged(
        f"the contact of the rough block under {_described(control)}",
        reason=reason,
        iterations=iterations,
        remedy="take smaller load steps (load.steps)",
    )


def _described(control: Control) -> str:
    """Say under what a load step presses, for an error."""
    if control.force is not None:
        return f"a force of {control.force:.6g} N"
    return f"an approach of {control.approach:.6g} mm"
