"""What must hold of any scene: sums, loads met, no force before first touch; see also the twins."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

TINY = 1e-6  # of the largest approach: just touched


class Found(NamedTuple):
    """One check of one scene.

    Attributes:
        invariant: What was checked.
        error: How much it is missed by, relative.
        allowed: How much it may be.
    """

    invariant: str
    error: float
    allowed: float

    @property
    def holds(self):
        """Whether it is kept."""
        return bool(self.error <= self.allowed)


def checks(case, folder):
    """Yield all checks of a scene.

    Args:
        case: The scene.
        folder: Where heights are written.
    """
    half, whole = 0.5 * case.approach, case.approach
    points = {"approach": [TINY * whole, half, whole, half, whole], "steps": 1}
    base = case.history(folder, **points)
    modulus = case.block["young_modulus"] / (1.0 - case.block["poisson_ratio"] ** 2)
    if base.force_N.max() < 1e-12 * modulus * np.prod(case.lengths):
        return  # a plane that is free to turn clear presses with rounding, which nothing repeats
    yield from _alone(case, base)
    force = 0.6 * float(base.force_N.max())
    if force > 0.0:
        cycled = case.history(folder, force=[force, 0.5 * force], steps=1, cycles=2)
        yield Found("force hit", abs(cycled.force_N[0] / force - 1.0), 1e-8)
        yield Found("force hit again", abs(cycled.force_N[2] / force - 1.0), 1e-8)
        yield Found(
            "force cycles",
            float(
                len(cycled) != 4 + 6 * (case.shear_path == "after" and case.friction is not None)
            ),
            0.0,
        )
    if case.kind == "consistent":
        together = replace(case, kind="concurrent").history(folder, **points)
        largest = together.force_N.max() or 1.0
        apart = np.abs(together.force_N - base.force_N).max() / largest
        yield Found("consistent against concurrent", float(apart), _stated(case))


def _alone(case, history):
    """Yield what must hold of one history."""
    force, count = history.force_N, np.prod(case.patches)
    area = np.prod(case.lengths) / count
    sums = history.patch_pressure_MPa.sum(axis=1) * area
    largest = force.max()
    yield Found("patch sums", float(np.abs(sums - force).max() / (largest or 1.0)), 1e-12)
    fractions = np.array([step.patches.contact_area_fraction.mean() for step in history])
    most = history.contact_area_fraction.max() or 1.0
    apart = np.abs(fractions - history.contact_area_fraction).max() / most
    yield Found("patch areas", float(apart), 1e-12)
    scale = largest or 1.0
    if case.hardness is None:
        yield Found("up and down", float(abs(force[3] - force[1]) / scale), 1e-8)
    else:
        yield from _yielding(case, history)
    yield Found("reloaded", float(abs(force[4] - force[2]) / scale), 1e-8)
    yield Found("unloading is below loading", float((force[3] - force[1]) / scale), 1e-8)
    if case.friction is not None:
        yield from _sheared(case, history)
    if case.leak:
        yield from _leaking(history)
    energies = history.elastic_energy_mJ
    if np.isfinite(energies).all():
        yield Found("elastic energy", float(-energies.min()), 0.0)
    falls = max(force[0] - force[1], force[1] - force[2])
    yield Found("force rises", float(falls / scale), 1e-13)  # rounding
    if case.tilt == (0.0, 0.0):
        modulus = case.block["young_modulus"] / (1.0 - case.block["poisson_ratio"] ** 2)
        # a punch over a circle around the face; a patch alone, or a flat block, may be stiffer
        punch = modulus * np.hypot(*case.lengths) * history.approach_mm[0] * (1.0 + 4.0 * count)
        yield Found("touch", float(force[0] / punch), 1.0)


def _yielding(case, history):
    """Yield what must hold of one history under a hardness."""
    force, nominal = history.force_N, case.nominal_area
    area = history.contact_area_fraction
    yield Found(
        "area bears the force", float((force / (case.hardness * nominal) - area).max()), 1e-12
    )
    if case.kind not in ("analytic", "concurrent"):
        return
    yielding = history.yielding_area_fraction
    yield Found("area yields", float((yielding - area).max()), 1e-12)
    yield Found(
        "yielding area bears",
        float((case.hardness * yielding * nominal / np.maximum(force, 1e-300) - 1.0).max()),
        1e-10,
    )
    peak = history.peak_pressure_MPa
    yield Found("peak", float(peak.max() / case.hardness - 1.0), 1e-10)
    # reached once, the hardness is borne by some cell, and what it leaves is a depth
    reached = bool((peak >= case.hardness * (1.0 - 1e-9)).any())
    yield Found(
        "depth where it yields", float(reached and not history.plastic_depth_mm.max() >= 0.0), 0.0
    )
    yield Found("yielding is told", float(reached and not yielding.max() > 0.0), 0.0)
    work = history.plastic_work_mJ
    yield Found("plastic work grows", float(-np.diff(work).min() / (work.max() or 1.0)), 1e-9)


def _sheared(case, history):
    """Yield what must hold of one history with friction."""
    shear = np.hypot(history.shear_force_x_N, history.shear_force_y_N)
    most = case.friction * history.force_N
    scale = most.max() or 1.0
    yield Found("friction bounds the shear force", float((shear - most).max() / scale), 1e-10)
    yield Found(
        "slip within the contact",
        float((history.slip_area_fraction - history.contact_area_fraction).max()),
        1e-12,
    )
    lost = history.dissipated_mJ
    yield Found("friction takes energy", float(-np.diff(lost).min() / (lost.max() or 1.0)), 1e-12)
    yield Found("shear finite", float(not np.isfinite(shear).all()), 0.0)


def _leaking(history):
    """Yield what must hold of one history with a fluid in the gap."""
    for rate, percolates in (
        (history.leak_x_mm3_per_s, history.percolates_x),
        (history.leak_y_mm3_per_s, history.percolates_y),
    ):
        yield Found("no leak against the pressure", float(-rate.min()), 0.0)
        yield Found("leaks where it percolates", float(((rate > 0) != (percolates > 0)).any()), 0.0)
        yield Found("a higher load leaks less", float(max(np.diff(rate[:3]).max(), 0.0)), 0.0)


def _stated(case):
    """Return the error that the README states of consistent laws, against concurrent contacts.

    Half-space contacts on a cube under a level plane are best; asperities know of no
    free sides, and few patches or a tilt want small bending.
    """
    cube = 0.5 <= case.block["height"] <= 2.0 and case.tilt == (0.0, 0.0)
    laws = 2.0 * case.tolerance
    if case.micro["model"] == "half-space" and cube:
        return laws + 0.003
    return laws + (0.07 if min(case.patches) < 4 or case.micro["model"] != "half-space" else 0.02)
