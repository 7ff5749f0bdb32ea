"""Newton steps of a plane and of the forces that a block yields by, and where they may not go."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from geometry.control import Control
from multiscale.couplings.contact_stiffness import ContactStiffness, Secant, corrected
from multiscale.couplings.sagging import SaggingContact, Trial

Array = NDArray[np.float64]

_POWER = 1.5  # exponent of Hertz' law
_COARSE = 3  # presses that may bring a prescribed force within a factor of two
_FARTHEST = 1.0  # of the contacts' depth, that one step may change any local approach
_FORESEEN = 0.2  # of the force, by which a step worth going on with may be wrong
_NEAREST = 0.1  # of the contacts' depth, that the plane may always turn by
_DAMPINGS = np.geomspace(1e-12, 1e3, 151)[:, None, None]  # of the stiffness; the least is none
_LOST = 0.75  # of the force, that a step is to lose before the plane is turned to part
_PARTING = 1.1 * _POWER  # Newton steps to where P ~ h^(3/2) ends, and some
_TURNED = 0.3  # of the depth of a level plane, that the plane may turn by where nothing touches
_PATIENCE = 10  # presses without contact before the sag is given up


def free(control: Control) -> NDArray[np.bool_]:
    """Return which of approach and slopes are not prescribed, shape (3,)."""
    return np.array([control.approach is None] + 2 * [control.tilt is None])


def prescribed(control: Control) -> Array:
    """Return approach and slopes, 0 where they are free, shape (3,)."""
    return np.array([control.approach or 0.0, *(control.tilt or (0.0, 0.0))])


def damped_turn(stiffness: Array, missing: Array, arms: Array, farthest: float) -> Array:
    """Return how a plane moves by loads, damped as far as it turns on too few contacts.

    One contact, or two, do not hold a plane that is free to turn: the plane comes down about
    them until others touch. The least damping of the slopes is taken that the border moves by no
    more than it may; what the contacts hold is as Newton's step has it.

    Args:
        stiffness: Change of the k loads with the k free motions, symmetric, shape (k, k).
        missing: Loads to be gained, shape (k,) [N, N mm].
        arms: What a motion turns by: 0 for the approach, half the diagonal for slopes,
            shape (k,) [mm].
        farthest: How far the border may move as the plane turns [mm].

    Source:
        Nocedal & Wright 2006, doi 10.1007/978-0-387-40065-5, sec. 4.3 and 10.3
        (Levenberg and Marquardt).
    """
    scale = float(np.abs(np.diagonal(stiffness) / np.where(arms > 0.0, arms, 1.0) ** 2).max())
    damped = stiffness + scale * _DAMPINGS * np.diag(arms**2)
    turns = np.linalg.pinv(damped) @ missing
    near = np.abs(turns * arms).sum(axis=1) <= farthest
    near[-1] = True
    return np.asarray(turns[int(np.argmax(near))])


def _answers(stiffness: Array, yielding: Array, ways: Array) -> Array:
    """Return the forces by which contacts on what yields answer ways of the plane, shape (M, k)."""
    forces = np.zeros_like(ways)
    near = np.flatnonzero(stiffness.any(axis=1))  # the others carry nothing
    own = stiffness[np.ix_(near, near)]
    matrix = np.eye(near.size) + own @ yielding[np.ix_(near, near)]
    try:
        forces[near] = np.linalg.solve(matrix, own @ ways[near])
    except np.linalg.LinAlgError:
        forces[near] = np.linalg.lstsq(matrix, own @ ways[near], rcond=None)[0]
    return forces


class ConcurrentNewton:
    """Steps from one press of the micro model to the next.

    Args:
        contact: What is pressed.
        contact_modulus: E* [MPa].
        half: Half the diagonal of the loaded rectangle [mm].
    """

    def __init__(self, contact: SaggingContact, contact_modulus: float, half: float) -> None:
        self._contact = contact
        self._reach = 1.0 / (contact_modulus * half)
        self._arms = np.array([0.0, half, half])
        self._stiffness = ContactStiffness(contact.loads, contact_modulus)

    def step(
        self, control: Control, trial: Trial, secants: Sequence[Secant]
    ) -> tuple[Array, Array] | None:
        """Return the Newton step of the plane and that of the forces, from the forces found.

        Args:
            control: What is prescribed.
            trial: The latest press.
            secants: Secants of the contact's stiffness, the earliest first.

        Returns:
            Changes of approach and slopes, shape (3,), and of the forces, shape (M,); None where
            there is no contact.
        """
        found, moves = trial.found, free(control)
        if not found.any():
            return None
        shape, yielding = self._contact.shape, self._contact.yielding
        stiffness = corrected(self._stiffness.estimate(trial.response), secants)
        turn = np.where(moves, 0.0, prescribed(control) - trial.plane)
        lag = yielding @ (found - trial.assumed)
        sides = np.column_stack([shape @ turn - lag, shape[:, moves]])
        answered = _answers(stiffness, yielding, sides)
        alone, by_plane = answered[:, 0], answered[:, 1:]
        if moves.any():
            loads = shape[:, moves].T
            missing = -trial.excess(control)[moves] - loads @ alone
            arms, farthest = self._arms[moves], self._trusted(trial, secants)
            turn[moves] = damped_turn(loads @ by_plane, missing, arms, farthest)
        return turn, alone + by_plane @ turn[moves]

    def _trusted(self, trial: Trial, secants: Sequence[Secant]) -> float:
        """Return how far the border may move as the plane turns, by the worth of the last step."""
        farthest = self._farthest(trial)
        if not secants:
            return farthest
        went = float(np.abs(secants[-1][0]).max())
        found, assumed = trial.found, trial.assumed
        if float(np.abs(found - assumed).sum()) <= _FORESEEN * float(found.sum()):
            return max(farthest, 2.0 * went)
        return min(farthest, max(0.5 * went, _NEAREST * self.depth(trial)))

    def next(
        self,
        control: Control,
        trial: Trial,
        step: tuple[Array, Array] | None,
        count: int,
        missed: int = 0,
    ) -> Trial:
        """Press where the Newton step leads, within bounds.

        Args:
            control: What is prescribed.
            trial: The latest press.
            step: The Newton step from there.
            count: Presses so far.
            missed: How many of the last of them met no contact.
        """
        if step is None:
            return self._sought(control, trial, missed)
        total = float(trial.found.sum())
        rough = count <= _COARSE and not 0.5 <= total / (control.force or total) <= 2.0
        if not trial.assumed.any() or rough:
            level = self._level(control, trial)
            if level is not None:
                return level
        turn, lag = step[0], trial.found + step[1] - trial.assumed
        if self._leaves(control, trial, step[1]):
            plane = trial.plane + self._parting(trial, turn) * turn
            return self._contact.press(plane, np.zeros_like(trial.assumed), trial)
        change = np.abs(self._contact.shape @ turn - self._contact.yielding @ lag)
        if control.tilt is None:  # elsewhere the turn is bounded
            change = change[trial.found > 0.0]
        part = 1.0 / max(1.0, float(change.max()) / (_FARTHEST * self.depth(trial)))
        plane = trial.plane + part * turn
        plane = np.where(free(control), plane, prescribed(control))
        return self._contact.press(plane, trial.assumed + part * lag, trial)

    def _leaves(self, control: Control, trial: Trial, change: Array) -> bool:
        """Whether a plane free to turn seems to turn clear of the surface."""
        turns = control.approach is not None and control.tilt is None
        return turns and float(change.sum()) < -_LOST * float(trial.found.sum())

    def _parting(self, trial: Trial, turn: Array) -> float:
        """Return how far to turn to part, as P ~ h^(3/2) reaches 0 beyond Newton's step."""
        change = float(np.abs(self._contact.shape @ turn).max())
        return min(_PARTING, self._farthest(trial) / change) if change > 0.0 else 1.0

    def _farthest(self, trial: Trial) -> float:
        """Return how far the plane may turn at once where nothing touches [mm]."""
        return max(self.depth(trial), _TURNED * (trial.plane[0] - self._contact.first_touch))

    def depth(self, trial: Trial) -> float:
        """Return the depth of all contacts of a press, taken as one [mm]."""
        stiffness = self._stiffness.estimate(trial.response).sum()
        return _POWER * float(trial.found.sum() / stiffness)

    def _sought(self, control: Control, trial: Trial, missed: int) -> Trial:
        """Press nearer, as there was no contact: with less sag, and a lower plane if it is free."""
        plane = np.where(free(control), trial.plane, prescribed(control))
        if control.force:
            plane[0] += control.force * self._reach * 2.0**missed
        patient = missed < _PATIENCE and not (control.approach is not None and control.tilt is None)
        less = 0.5 * trial.assumed if patient else np.zeros_like(trial.assumed)
        return self._contact.press(plane, less, trial)

    def _level(self, control: Control, trial: Trial) -> Trial | None:
        """Press by the law P ~ h^(3/2) of all contacts as one; None where it says nothing."""
        found, depth = trial.found, self.depth(trial)
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
