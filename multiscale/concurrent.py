"""The micro model solved inside the iteration for the block's yielding: no laws, no tables."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from geometry.control import Control
from geometry.errors import InputError, NotConverged
from geometry.patches import PatchGrid
from micro import MicroModel
from multiscale.contact_stiffness import ContactStiffness, Secant, corrected
from multiscale.history import LoadStep
from multiscale.loading import described
from multiscale.sagging import SaggingContact, SmoothCorrection, Trial

Array = NDArray[np.float64]

_MOST = 40
_POWER = 1.5  # exponent of Hertz' law
_COARSE = 3  # presses that may bring a prescribed force within a factor of two
_KEPT = 6  # secants, over load steps too
_GUESSED = 1e-4  # tolerance on the coarse model
_CLEAR = 1e-12  # of contact, where no force is wanted [mm]
_FARTHEST = 1.0  # of the contacts' depth, that one step may change any local approach


class _Found(NamedTuple):
    """Where an iteration ended, and what the next one may start from."""

    trial: Trial
    secants: tuple[Secant, ...]
    presses: int
    coarse: _Found | None


class ConcurrentCoupling:
    """A rough surface on a block: half-space contact under a plane less what the block yields.

    The plane comes near the half-space's surface by δ(x) − D(x)[P], D linear in the forces P on the
    correction's rectangles. P and what is free of the plane are found together, by a Newton
    iteration whose contact stiffness is estimated from contact areas and learns from every press.

    Args:
        model: Micro model of the whole surface.
        patches: Partition that the results are summed over; it does not change the solution.
        mean_heights: Mean height of each patch, shape (N,) [mm].
        correction: What the block yields beyond the half-space.
        tolerance: Largest error left in the forces, and largest residual of a prescribed force,
            relative to the force; moments count relative to force times half the diagonal.
        comm: MPI communicator (mpi4py) or None; rank 0 presses for all.

    Raises:
        InputError: When the tolerance is not positive.
    """

    def __init__(
        self,
        model: MicroModel,
        patches: PatchGrid,
        mean_heights: Array,
        correction: SmoothCorrection,
        *,
        coarse: MicroModel | None = None,
        tolerance: float = 1e-8,
        comm: Any = None,
    ) -> None:
        if not tolerance > 0.0:
            raise InputError("the tolerance must be positive", value=tolerance, allowed="> 0")
        self._model, self._tolerance = model, tolerance
        self._contact = SaggingContact(model, patches, mean_heights, correction, comm)
        loads = correction.loads
        self._half = 0.5 * float(np.hypot(*loads.lengths))
        self._stiffness = ContactStiffness(loads, model.contact_modulus)
        self._last: _Found | None = None
        self._coarse = None
        if coarse is not None:
            self._coarse = ConcurrentCoupling(
                coarse, patches, mean_heights, correction, tolerance=_GUESSED, comm=comm
            )

    def press(self, control: Control) -> LoadStep:
        """Solve one load step.

        Args:
            control: What is prescribed of the plane.

        Returns:
            The load step; its Newton iterations are presses of the micro model.

        Raises:
            NotConverged: When the iteration fails; the coupling is then as it was before.
        """
        found = self._found(control, self._last)
        result = self._contact.summed(found.trial, found.presses)
        self._last = found
        return result

    def _found(self, control: Control, last: _Found | None) -> _Found:
        """Iterate to equilibrium from the last load step."""
        coarse = self._guessed(control, last)
        secants = list((coarse or last).secants) if coarse or last else []
        trial = self._first(control, last, coarse)
        for count in range(1, _MOST + 1):
            step = self._step(control, trial, secants)
            if self._settled(control, trial, step):
                return _Found(trial, tuple(secants[-_KEPT:]), count, coarse)
            before, trial = trial, self._next(control, trial, step, count, coarse is not None)
            change = trial.local - before.local
            if before.found.any() and trial.found.any() and change.any():
                secants.append((change, trial.found - before.found))
                del secants[:-_KEPT]
        raise NotConverged(
            f"the block's yielding at {described(control)}",
            reason="DIVERGED_MAX_IT",
            iterations=_MOST,
            remedy="take smaller load steps (load.steps)",
        )

    def _guessed(self, control: Control, last: _Found | None) -> _Found | None:
        """Return what the coarse model finds; None without one."""
        if self._coarse is None or control.force == 0.0:
            return None
        try:
            found = self._coarse._found(control, None if last is None else last.coarse)
        except NotConverged:
            return None
        return found if found.trial.found.any() else None

    def _first(self, control: Control, last: _Found | None, coarse: _Found | None) -> Trial:
        """Press where coarse model or last load step's tangent point, or without any sag."""
        if coarse is not None:
            plane, assumed = coarse.trial.plane, coarse.trial.found
            before = None
            if last is not None and last.coarse is not None and last.trial.found.any():
                before = last.trial
                plane = plane + before.plane - last.coarse.trial.plane
                assumed = assumed + before.found - last.coarse.trial.found
            plane = np.where(self._free(control), plane, self._prescribed(control))
            return self._contact.press(plane, assumed, before)
        if control.force != 0.0 and last is not None and last.trial.found.any():
            step = self._step(control, last.trial, list(last.secants))
            if step is not None:
                return self._next(control, last.trial, step, 2)
        tilt = control.tilt or (0.0, 0.0)
        approach = control.approach
        if approach is None:
            approach = self._model.first_touch
            if control.force:
                approach += control.force / (self._model.contact_modulus * self._half)
            else:
                approach -= self._half * float(np.hypot(*tilt)) + _CLEAR
        plane = np.array([approach, *tilt])
        start = None if last is None else last.trial
        return self._contact.press(plane, np.zeros(len(self._contact.shape)), start)

    def _free(self, control: Control) -> NDArray[np.bool_]:
        return np.array([control.approach is None] + 2 * [control.tilt is None])

    def _prescribed(self, control: Control) -> Array:
        return np.array([control.approach or 0.0, *(control.tilt or (0.0, 0.0))])

    def _step(
        self, control: Control, trial: Trial, secants: list[Secant]
    ) -> tuple[Array, Array] | None:
        """Return the Newton step of plane and forces, from the forces found; None off contact."""
        found = trial.found
        if not found.any():
            return None
        stiffness = corrected(self._stiffness.estimate(trial.response), secants)
        target, free = self._targets(control, trial)
        prescribed = target - trial.plane
        prescribed[free] = 0.0
        lag = self._contact.yielding @ (found - trial.assumed)
        rows = self._contact.shape[:, free].T
        matrix = np.block(
            [
                [
                    np.eye(found.size) + stiffness @ self._contact.yielding,
                    -stiffness @ self._contact.shape[:, free],
                ],
                [rows, np.zeros((rows.shape[0], rows.shape[0]))],
            ]
        )
        right = np.concatenate(
            [
                stiffness @ (self._contact.shape @ prescribed - lag),
                -self._excess(control, trial)[free],
            ]
        )
        try:
            solution = np.linalg.solve(matrix, right)
        except np.linalg.LinAlgError:
            solution = np.linalg.lstsq(matrix, right, rcond=None)[0]
        prescribed[free] = solution[found.size :]
        return prescribed, solution[: found.size]

    def _targets(self, control: Control, trial: Trial) -> tuple[Array, NDArray[np.bool_]]:
        """Return the prescribed plane and which parts of it are free."""
        free = self._free(control)
        target = np.where(free, trial.plane, self._prescribed(control))
        return target, free

    def _excess(self, control: Control, trial: Trial) -> Array:
        """Return force and moments beyond those prescribed, shape (3,)."""
        response = trial.response
        return np.array([response.force[0] - (control.force or 0.0), *response.moment[0]])

    def _settled(self, control: Control, trial: Trial, step: tuple[Array, Array] | None) -> bool:
        """Whether the forces would change no more and the prescribed loads are met."""
        target, free = self._targets(control, trial)
        if not np.array_equal(target, trial.plane):
            return False
        if step is None:
            return not control.force and not trial.assumed.any()
        force = float(trial.response.force[0])
        scale = force * np.array([1.0, self._half, self._half])
        excess = np.abs(self._excess(control, trial)) / scale
        change = float(np.abs(step[1]).sum()) / force
        return change <= self._tolerance and bool(np.all(excess[free] <= self._tolerance))

    def _next(
        self,
        control: Control,
        trial: Trial,
        step: tuple[Array, Array] | None,
        count: int,
        guided: bool = False,
    ) -> Trial:
        """Press where the Newton step leads, within bounds."""
        if step is None:
            return self._sought(control, trial, count)
        total = float(trial.found.sum())
        force = control.force or total
        rough = not guided and count <= _COARSE and not 0.5 <= total / force <= 2.0
        if (not trial.assumed.any() and not guided) or rough:
            level = self._level(control, trial)
            if level is not None:
                return level
        turn, lag = step[0], trial.found + step[1] - trial.assumed
        change = np.abs(self._contact.shape @ turn - self._contact.yielding @ lag).max()
        part = min(1.0, _FARTHEST * self._depth(trial) / change) if change > 0.0 else 1.0
        plane = trial.plane + np.where(self._targets(control, trial)[1], part, 1.0) * turn
        return self._contact.press(plane, trial.assumed + part * lag, trial)

    def _depth(self, trial: Trial) -> float:
        """Return the depth of all contacts taken as one [mm]."""
        stiffness = self._stiffness.estimate(trial.response).sum()
        return _POWER * float(trial.found.sum() / stiffness)

    def _sought(self, control: Control, trial: Trial, count: int) -> Trial:
        """Press nearer, as there was no contact: with less sag, then by a lower plane."""
        plane, _ = self._targets(control, trial)
        if not trial.assumed.any() and control.force:
            reach = control.force / (self._model.contact_modulus * self._half)
            plane[0] += reach * 2.0**count
        less = 0.5 * trial.assumed if count < _MOST // 4 else np.zeros_like(trial.assumed)
        return self._contact.press(plane, less, trial)

    def _level(self, control: Control, trial: Trial) -> Trial | None:
        """Press by the law P ~ h^(3/2) of all contacts as one; None where it says nothing."""
        found, depth = trial.found, self._depth(trial)
        total = float(found.sum())
        mean = float(found @ self._contact.yielding @ found) / total
        known = float(found @ self._contact.yielding @ trial.assumed) / total
        plane = trial.plane.copy()
        if control.force:
            part = (control.force / total) ** (1.0 / _POWER)
            plane[0] += (part - 1.0) * depth + mean * part**_POWER - known
        elif mean > known:
            part = brentq(lambda t: t * depth + mean * t**_POWER - depth - known, 0.0, 1.0)
        else:
            return None
        return self._contact.press(plane, found * part**_POWER, trial)
