"""The micro model solved inside the iteration for the block's yielding: no laws, no tables."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry.control import Control
from geometry.errors import InputError, NotConverged
from geometry.patches import PatchGrid
from micro import MicroModel, Response
from multiscale.couplings.concurrent_newton import ConcurrentNewton, free, prescribed
from multiscale.couplings.contact_stiffness import Secant
from multiscale.couplings.sagging import SaggingContact, SmoothCorrection, Trial
from multiscale.load_step import LoadStep
from multiscale.loading import described
from multiscale.records import Arrays, packed, unpacked

Array = NDArray[np.float64]

TOLERANCE = 1e-8
"""What forces may be off by, and a prescribed force be missed by, relative to the force."""

_MOST = 40
_KEPT = 6  # secants, over load steps too
_LESS = 0.2  # of the force tried before
_GUESSED = 1e-4  # tolerance of what another iteration starts from
_ROUNDING = float(np.finfo(float).eps)  # of half the diagonal: what gaps are known to
_CLEAR = 1e-12  # of half the diagonal: clear of contact, where no force is wanted


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
    A coarse model of the surface may go ahead: every load step then starts from its plane, forces
    and stiffness, in which later steps correct the change alone.

    A plane free to turn that touches at one contact or two is held by neither, so it comes down
    about them in steps as large as the estimate proves worth, until contacts lie around the
    middle. Just above first touch that takes 20 to 35 presses from nothing, against 9 to 25 where
    many contacts touch; a prescribed approach, which may or may not touch in the end, can take
    90. Where contacts lie in fewer than three rectangles, or are single cells of a coarse grid,
    it may fail: what a contact's place within a rectangle adds to the moments is not estimated.

    Args:
        model: Micro model of the whole surface; its own error is to lie well below the tolerance.
        patches: Partition that the results are summed over; it does not change the solution.
        mean_heights: Mean height of each patch, shape (N,) [mm].
        correction: What the block yields beyond the half-space.
        coarse: Cheaper micro model of the same surface to start from; it does not change the
            solution.
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
        tolerance: float = TOLERANCE,
        comm: Any = None,
    ) -> None:
        if not tolerance > 0.0:
            raise InputError("the tolerance must be positive", value=tolerance, allowed="> 0")
        self._model, self._tolerance = model, tolerance
        self._contact = SaggingContact(model, patches, mean_heights, correction, comm)
        self._half = 0.5 * float(np.hypot(*correction.loads.sides))
        self._newton = ConcurrentNewton(self._contact, model.contact_modulus, self._half)
        self._last: _Found | None = None
        self._coarse: ConcurrentCoupling | None = None
        if coarse is not None:
            self._coarse = ConcurrentCoupling(
                coarse, patches, mean_heights, correction, tolerance=_GUESSED, comm=comm
            )

    def press(self, control: Control) -> LoadStep:
        """Solve one load step.

        Args:
            control: What is prescribed of the plane.

        Returns:
            The load step; its Newton iterations are presses of the micro model, without those of
            the coarse one and without the last, which sums the solution over the patches.

        Raises:
            NotConverged: When the iteration fails; the coupling is then as it was before.
        """
        found = self._solved(control, self._last)
        step = self._contact.summed(found.trial, found.presses)
        self._last = found
        return step

    def state(self) -> Arrays:
        """Return the latest iterates and secants, of the coarse model too; see `Restorable`.

        It is whole on rank 0 alone, which presses for all.
        """
        return packed(self._last)

    def restore(self, state: Arrays) -> None:
        """Go on from iterates and secants; see `Restorable`."""
        self._last = unpacked(state, (_Found, Trial, Response))

    def _solved(self, control: Control, last: _Found | None) -> _Found:
        """Iterate; where a plane free to turn hardly touches, from a force that holds it there."""
        apart = self._apart(control, last)
        if apart is not None:
            return _Found(apart, last.secants if last else (), 1, None)
        try:
            return self._found(control, last)
        except NotConverged as error:
            if control.approach is None or control.tilt is not None:
                raise
            try:
                near = self._held(control.approach, last)
                found = self._found(control, near._replace(coarse=None), led=False)
            except NotConverged:
                raise error from None  # it names what was asked for
            return found._replace(presses=found.presses + near.presses)

    def _apart(self, control: Control, last: _Found | None) -> Trial | None:
        """Return a prescribed plane that touches nothing; None where it may touch, or does."""
        if control.approach is None or control.tilt is None:
            return None
        nearest = control.approach + self._half * float(np.hypot(*control.tilt))
        if nearest > self._model.first_touch:
            return None
        nothing = np.zeros(len(self._contact.shape))
        trial = self._contact.press(prescribed(control), nothing, last.trial if last else None)
        return None if trial.found.any() else trial

    def _held(self, approach: float, last: _Found | None) -> _Found:
        """Return a balanced plane near an approach, or one turned the same way without contact."""
        presses = 0
        force = abs(approach - self._model.first_touch) * self._model.contact_modulus * self._half
        for _ in range(_MOST):
            last = self._found(Control(force=force, tilt=None), last, tolerance=_GUESSED)
            above = last.trial.plane[0] - approach
            plane = np.array([approach, *last.trial.plane[1:]])
            trial = self._contact.press(plane, np.zeros_like(last.trial.assumed), last.trial)
            presses += last.presses + 1
            if above <= 0.0:
                return last._replace(presses=presses)
            if not trial.found.any():
                return last._replace(trial=trial, presses=presses)
            force *= _LESS
        raise _unsettled(Control(approach=approach, tilt=None))

    def _found(
        self,
        control: Control,
        last: _Found | None,
        *,
        led: bool = True,
        tolerance: float | None = None,
    ) -> _Found:
        """Iterate from the last load step, or from where the coarse model has come from it."""
        ahead = self._ahead(control, last) if led else None
        known = ahead or last
        secants = list(known.secants) if known else []
        trial = (
            self._first(control, last, secants)
            if ahead is None
            else self._follow(control, last, ahead)
        )
        missed = 0
        for count in range(1, _MOST + 1):
            step = self._newton.step(control, trial, secants)
            missed = missed + 1 if step is None else 0
            if self._settled(control, trial, step, tolerance or self._tolerance):
                return _Found(trial, tuple(secants), count, ahead)
            before, trial = trial, self._newton.next(control, trial, step, count, missed)
            change = trial.local - before.local
            if before.found.any() and trial.found.any() and change.any():
                secants = [*secants, (change, trial.found - before.found)][-_KEPT:]
        raise _unsettled(control)

    def _ahead(self, control: Control, last: _Found | None) -> _Found | None:
        """Return what the coarse model finds; None where that says nothing."""
        if self._coarse is None or control.force == 0.0:
            return None
        try:
            return self._coarse._solved(control, last.coarse if last else None)
        except NotConverged:
            return None

    def _follow(self, control: Control, last: _Found | None, ahead: _Found) -> Trial:
        """Press where the coarse model is, or as far from the last load step as it went."""
        plane, forces, start = ahead.trial.plane, ahead.trial.found, None
        touching = forces.any() and last is not None and last.trial.found.any()
        if touching and last is not None and last.coarse is not None:
            start, behind = last.trial, last.coarse.trial
            plane = start.plane + plane - behind.plane
            forces = np.maximum(start.found + forces - behind.found, 0.0)
        plane = np.where(free(control), plane, prescribed(control))
        return self._contact.press(plane, forces, start)

    def _first(self, control: Control, last: _Found | None, secants: list[Secant]) -> Trial:
        """Press where the last load step's tangent points, or without any sag."""
        start = last.trial if last else None
        if start is not None and control.force != 0.0 and start.found.any():
            step = self._newton.step(control, start, secants)
            return self._newton.next(control, start, step, 2)
        plane = prescribed(control)
        if start is not None:
            plane[1:] = np.where(free(control)[1:], start.plane[1:], plane[1:])
        if control.approach is None:
            plane[0] = self._model.first_touch
            if control.force:
                plane[0] += control.force / (self._model.contact_modulus * self._half)
            else:
                plane[0] -= self._half * (float(np.hypot(*plane[1:])) + _CLEAR)
        return self._contact.press(plane, np.zeros(len(self._contact.shape)), start)

    def _settled(
        self,
        control: Control,
        trial: Trial,
        step: tuple[Array, Array] | None,
        tolerance: float,
    ) -> bool:
        """Whether the forces would change no more and the prescribed loads are met."""
        moves = free(control)
        if np.any(~moves & (trial.plane != prescribed(control))):
            return False
        if step is None:
            return not control.force and not trial.assumed.any()
        force = float(trial.response.force[0])
        scale = force * np.array([1.0, self._half, self._half])
        excess = np.abs(trial.excess(control)) / scale
        change = float(np.abs(step[1]).sum()) / force
        known = _ROUNDING * self._half / self._newton.depth(trial)  # near first touch less
        return change <= max(tolerance, known) and bool(np.all(excess[moves] <= tolerance))


def _unsettled(control: Control) -> NotConverged:
    turning = "; where few contacts touch prescribe load.tilt" if control.tilt is None else ""
    return NotConverged(
        f"the block's yielding at {described(control)}",
        reason="DIVERGED_MAX_IT",
        iterations=_MOST,
        remedy=f"take smaller load steps (load.steps){turning}",
    )
