"""Work of the plane along a load history, and its balance with the energies of the contact.

The elastic energy is a convex function of the motions of the plane, and the forces on it are its
gradient. From one load step to the next it therefore rises by no less than the first forces, and by
no more than the last ones, times the motion between them. Under a hardness the same holds of
elastic energy and plastic work together where the plane comes nearer.

Theory: demos/theory.md, section 3.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from multiscale.loading.load_step import LoadStep

Array = NDArray[np.float64]

BALANCE = 1e-3
"""Energy that may be missing, relative to the largest, before a run says so. Finite slopes of
second order are no gradient of an energy; without them it is the residual of the contact."""


def with_work(step: LoadStep, before: LoadStep | None) -> LoadStep:
    """Return a load step with the work of the plane since the start.

    Between load steps the work is that of the trapezoidal rule, with its end correction where the
    stiffness is known and the slopes stay.

    Args:
        step: A load step.
        before: The one before it; None for the first.
    """
    if step.elastic_energy_mJ is None:
        return step
    stiffness: float | None
    if before is None:
        motion, load = np.array([step.approach_mm, *step.tilt]), np.zeros(3)
        done, stiffness = 0.0, 0.0  # nothing is touched
        if step.force_N == 0.0:
            motion[:] = 0.0
    else:
        motion, load = _motion(step) - _motion(before), _load(before)
        done, stiffness = before.work_mJ or 0.0, before.stiffness_N_per_mm
    work = 0.5 * float((load + _load(step)) @ motion)
    if stiffness is not None and step.stiffness_N_per_mm is not None and not motion[1:].any():
        work += motion[0] ** 2 * (stiffness - step.stiffness_N_per_mm) / 12.0
    return replace(step, work_mJ=done + work)


def missing_energy(steps: Sequence[LoadStep]) -> float:
    """Return the largest energy by which load steps break the balance, relative to the largest.

    Args:
        steps: Load steps one after another.
    """
    worst = largest = 0.0
    known = [step for step in steps if step.elastic_energy_mJ is not None]
    for before, step in pairwise(known):
        motion = _motion(step) - _motion(before)
        stored = [
            (each.elastic_energy_mJ or 0.0) + (each.plastic_work_mJ or 0.0)
            for each in (before, step)
        ]
        rise, largest = stored[1] - stored[0], max(largest, *stored)
        bounds = sorted((float(_load(before) @ motion), float(_load(step) @ motion)))
        worst = max(worst, bounds[0] - rise, rise - bounds[1])
    return worst / largest if largest else 0.0


def _motion(step: LoadStep) -> Array:
    return np.array([step.approach_mm, *step.tilt])


def _load(step: LoadStep) -> Array:
    return np.array([step.force_N, *step.moment_N_mm])
