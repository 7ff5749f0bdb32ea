"""Work of the plane along a load history, and its balance with the energies of the contact.

The elastic energy is a convex function of the motions of the plane, and the forces on it are its
gradient. From one load step to the next it therefore rises by no less than the first forces, and by
no more than the last ones, times the motion between them. Under a hardness the same holds of
elastic energy and plastic work together where the plane comes nearer.

Theory: docs/theory.md, section 14.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from multiscale.loading.load_step import LoadStep
from support.arrays import Array

BALANCE = 1e-3
"""Energy that may be missing, relative to the largest, before a run says so. In 150 load steps on
64² cells (half-space and cube, level and free planes) no bound was broken; work and energy differed
by 6e-5, 6e-4 and 1e-3 at rms gradients of 0.2, 0.4 and 0.8, whose second order is no gradient of an
energy, and by 5e-6 without finite slopes, which the trapezoidal rule leaves."""


def with_work(step: LoadStep, before: LoadStep | None) -> LoadStep:
    """Return a load step with the work of the plane since the start.

    Up to the first load step it is the energy that is stored by then, elastic and plastic. Between
    load steps it is that of the trapezoidal rule, with its end correction where the stiffness is
    known and the slopes stay or have no moment. Where nothing yields anew after cells have yielded,
    the load may have turned back at the step before, whose stiffness is then that of the other
    side: instead, the forces are a parabola with the stiffness of this step.

    Args:
        step: A load step.
        before: The one before it; None for the first.
    """
    if step.elastic_energy_mJ is None:
        return step
    if before is None:
        stored = step.elastic_energy_mJ + (step.plastic_work_mJ or 0.0)
        return replace(step, work_mJ=stored)
    motion, load, ahead = _motion(step) - _motion(before), _load(before), _load(step)
    work = 0.5 * float((load + ahead) @ motion)
    turning = np.abs(motion[1:]) @ (np.abs(load[1:]) + np.abs(ahead[1:]))
    stiffness, earlier = step.stiffness_N_per_mm, before.stiffness_N_per_mm
    if earlier is not None and stiffness is not None and turning <= 1e-6 * abs(work):
        bent = 0.5 * motion[0] * (earlier - stiffness)
        if before.plastic_work_mJ and not step.stiffness_error_N_per_mm:
            bent = ahead[0] - load[0] - motion[0] * stiffness
        work += motion[0] * bent / 6.0
    return replace(step, work_mJ=(before.work_mJ or 0.0) + work)


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
