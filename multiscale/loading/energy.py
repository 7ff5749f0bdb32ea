"""Work of the plane along a load history, its balance with the energies, and what yields.

The elastic energy is a convex function of the motions of the plane, and the forces on it are its
gradient. From one load step to the next it therefore rises by no less than the first forces, and by
no more than the last ones, times the motion between them. Under a hardness the same holds of
elastic energy and plastic work together where the plane comes nearer.

Theory: docs/theory.md, section 14.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from patchlaw.multiscale.loading.load_step import LoadStep
from patchlaw.multiscale.readable import Caution, number, percent, quantities, quantity
from patchlaw.support.arrays import Array

BALANCE = 1e-3
"""Energy that may be missing, relative to the largest, before a run says so. In 150 load steps on
64² cells (half-space and cube, level and free planes) no bound was broken; work and energy differed
by 6e-5, 6e-4 and 1e-3 at rms gradients of 0.2, 0.4 and 0.8, whose second order is no gradient of an
energy, and by 5e-6 without finite slopes, which the trapezoidal rule leaves."""
_ROUNDING = 1e-6
"""Changes of the force, over the largest, that count as none."""


def work_of(step: LoadStep, before: LoadStep | None) -> float | None:
    """Return the work of the plane since the start [mJ]; None without energies.

    Up to the first load step it is the energy that is stored by then, elastic and plastic. Between
    load steps it is that of the trapezoidal rule, with its end correction where the stiffness is
    known and the slopes stay or have no moment: by stiffnesses or, where it is smaller, by their
    inverses, since stiffnesses grow without bound towards full contact of a period. Where nothing
    yields anew after cells have yielded, the load may have turned back at the step before, whose
    stiffness is then that of the other side: instead, the forces are a parabola with the stiffness
    of this step.

    Args:
        step: A load step.
        before: The one before it; None for the first.
    """
    if step.elastic_energy_mJ is None:
        return None
    if before is None:
        return step.elastic_energy_mJ + (step.plastic_work_mJ or 0.0)
    motion, load, ahead = _motion(step) - _motion(before), _load(before), _load(step)
    work = 0.5 * float((load + ahead) @ motion)
    turning = np.abs(motion[1:]) @ (np.abs(load[1:]) + np.abs(ahead[1:]))
    stiffness, earlier = step.approach_stiffness_N_per_mm, before.approach_stiffness_N_per_mm
    if earlier is not None and stiffness is not None and turning <= 1e-6 * abs(work):
        rise = float(ahead[0] - load[0])
        if before.plastic_work_mJ and not step.approach_stiffness_error_N_per_mm:
            bent = motion[0] * (rise - motion[0] * stiffness)
        else:
            bent = 0.5 * motion[0] ** 2 * (earlier - stiffness)
            if earlier > 0.0 and stiffness > 0.0:
                bent = min(bent, 0.5 * rise**2 * (1.0 / stiffness - 1.0 / earlier), key=abs)
        work += bent / 6.0
    return (before.work_mJ or 0.0) + work


def missing_energy(steps: Sequence[LoadStep]) -> float:
    """Return the largest energy by which load steps break the balance, relative to the largest.

    Args:
        steps: Load steps one after another.
    """
    worst = largest = 0.0
    known = [step for step in steps if step.elastic_energy_mJ is not None]
    if known and known[-1].slid_mm:  # what wears off takes energy with it
        known = [step for step in known if not step.slid_mm]
    softer = _softer_body(known)
    for before, step in pairwise(known):
        motion = _motion(step) - _motion(before)
        stored = [
            (each.elastic_energy_mJ or 0.0) + (each.plastic_work_mJ or 0.0)
            for each in (before, step)
        ]
        rise, largest = stored[1] - stored[0], max(largest, *stored)
        bounds = sorted((float(_load(before) @ motion), float(_load(step) @ motion)))
        slack = 0.5 * softer * (step.force_N - before.force_N) ** 2
        worst = max(worst, bounds[0] - rise - slack, rise - bounds[1] - slack)
    return worst / largest if largest else 0.0


def _softer_body(steps: Sequence[LoadStep]) -> float:
    """Return the compliance of a body with which no approach falls as the force rises [mm/N].

    That of a period in full contact does, with finite slopes. Its energy is convex together with
    that of a smooth body below it.
    """
    most, least = 0.0, _ROUNDING * max((step.force_N for step in steps), default=0.0)
    for before, step in pairwise(steps):
        moved, rise = step.approach_mm - before.approach_mm, step.force_N - before.force_N
        if abs(rise) > least:
            most = max(most, -moved / rise)
    return most


def _motion(step: LoadStep) -> Array:
    return np.array([step.approach_mm, *step.tilt])


def _load(step: LoadStep) -> Array:
    return np.array([step.force_N, *step.moment_N_mm])


def yielding_notes(steps: Sequence[LoadStep], hardness: float | None, said: str) -> Iterator[str]:
    """Yield what has yielded or, of elastic contacts, what would bear their pressures.

    Args:
        steps: The load steps.
        hardness: Largest contact pressure of cells [MPa]; None where these are elastic.
        said: The hardness in words, by region where these have their own; empty where nothing
            yields.
    """
    if not said:
        yield from _strength_notes(steps)
        return
    known = [step for step in steps if step.plastic_depth_mm is not None]
    if not known:
        yield (
            f"hardness {said}: the laws are those of rising loads; no plastic "
            "depth stands behind them"
        )
        return
    last = known[-1]
    assert hardness is not None, "cells that yield have one"
    volume = (last.plastic_work_mJ or 0.0) / hardness
    most = max(known, key=lambda step: step.yielding_area_fraction or 0.0)
    depth = quantity(last.plastic_depth_mm or 0.0, "mm")
    yield (
        f"hardness {said}: after load step {last.step} a plastic volume of "
        f"{number(1e9 * volume)} µm³ and a depth of up to {depth} are left; at most "
        f"{percent(most.yielding_area_fraction or 0.0, 3)} of the nominal area bears the "
        f"hardness, at load step {most.step}"
    )


def _strength_notes(steps: Sequence[LoadStep]) -> Iterator[str]:
    """Yield the largest and the mean pressure of elastic contacts, and what bears them."""
    known = [step for step in steps if step.peak_pressure_MPa and step.contact_area_fraction]
    if not known:
        return
    step = max(known, key=lambda each: each.peak_pressure_MPa or 0.0)
    peak = step.peak_pressure_MPa or 0.0
    mean = step.mean_pressure_MPa / step.contact_area_fraction
    # hardness over yield strength of metals, Tabor 1951, ch. 3
    highest, inner, low, high = quantities((peak, mean, peak / 3.0, peak / 2.8), "MPa", 3)
    yield (
        f"elastic contacts: pressures up to {highest}, in the mean of the real "
        f"contact area {inner}, at load step {step.step}. A hardness above the "
        "first bears them without yielding, that is a yield strength of "
        f"{low} to {high} (hardness is 2.8 "
        "to 3 times the yield strength: Tabor 1951); for less, state micro.hardness"
    )


def energy_notes(steps: Sequence[LoadStep], *, conservative: bool = True) -> Iterator[str]:
    """Yield the energies at the last load step, and a warning where they are not balanced.

    Args:
        steps: The load steps.
        conservative: Whether the forces are the gradient of these energies. They are not where
            tractions displace the surface across: these store energy too, and friction loses some.
    """
    known = [step for step in steps if step.elastic_energy_mJ is not None]
    if not known:
        return
    last = known[-1]
    parts = {
        "elastic": last.elastic_energy_mJ or 0.0,
        "plastic work": last.plastic_work_mJ or None,
        "work of the plane": last.work_mJ,
    }
    shown = {name: one for name, one in parts.items() if one is not None}
    energies = quantities(shown.values(), "mJ")
    text = ", ".join(" ".join(pair) for pair in zip(shown, energies, strict=True))
    worn = "; the rest went with what has worn off" if last.slid_mm else ""
    yield f"energies at load step {last.step}: {text} (trapezoidal rule between load steps{worn})"
    missing = missing_energy(known) if conservative else 0.0
    if missing > BALANCE:
        yield Caution(
            f"warning: energies are not balanced: {percent(missing)} of the largest is missing "
            "between two load steps; finite slopes of steep surfaces may be the cause "
            "(micro.finite_slopes = false leaves them out)"
        )
