"""What must hold of any scene: symmetry, units, sums, loads met, no force before first touch."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from patchlaw.multiscale.loading.load_step import LOOSE

TINY = 1e-6  # of the largest approach: just touched
UNITS = ((("m", 1e3), ("GPa", 1e3)), (("um", 1e-3), ("Pa", 1e-6)))

SHARED = 1e-6  # ellipses are shared among patches to 4e-7, and their cuts are other ones turned


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
    solved = _solved(case)
    ellipses = case.micro["model"] != "half-space"
    shared = max(solved, SHARED) if ellipses else solved
    mirrored = case.mirrored().history(folder, **points)
    yield from _same("mirrored", case, base, mirrored, lambda f: f[::-1], solved, shared)
    turned = case.turned().history(folder, **points)
    yield from _same("turned", case, base, turned, lambda f: f.T[::-1], solved, shared)
    for units in UNITS:
        written = replace(case, units=units).history(folder, **points)
        yield from _same("units", case, base, written, lambda f: f, solved, solved)
    for length, modulus in ((1e3, 1e-3), (1e-3, 10.0)):
        other = case.scaled(length, modulus)
        changed = {"approach": [length * value for value in points["approach"]], "steps": 1}
        found = other.history(folder, **changed)
        yield from _same(
            "scaled", case, base, found, lambda f: f, solved, solved, (length, modulus)
        )
    raised = replace(case, heights=case.heights + 0.37 * case.approach + 1e-3)
    found = raised.history(folder, **points)
    yield from _same("raised", case, base, found, lambda f: f, solved, solved)
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


MOVED = {
    "mirrored": np.array([[-1.0, 0.0], [0.0, 1.0]]),
    "turned": np.array([[0.0, -1.0], [1.0, 0.0]]),
}


def _same_shear(name, case, base, other, units):
    """Yield how much shear forces and losses of two histories differ, the first one moved."""
    move = MOVED.get(name, np.eye(2))
    given = move @ [base.shear_force_x_N, base.shear_force_y_N]
    found = np.array([other.shear_force_x_N, other.shear_force_y_N]) / units[0]
    scale = case.friction * base.force_N.max() or 1.0
    yield Found(f"{name}: shear force", float(np.abs(found - given).max() / scale), 1e-6)
    lost, again = base.dissipated_mJ, other.dissipated_mJ / units[1]
    # where all but nothing slips, the loss is what iterations leave
    scale = max(lost.max(), 1e-3 * scale * case.approach)
    yield Found(f"{name}: dissipated", float(np.abs(lost - again).max() / scale), 1e-5)


def _same_leak(name, base, other, unit):
    """Yield how much the leaks of two histories differ, the first one moved."""
    if any(LOOSE in step.warnings for step in base):
        return  # gaps depend on a tilt that nothing decides
    swap = np.abs(MOVED.get(name, np.eye(2)))
    given = swap @ [base.leak_x_mm3_per_s, base.leak_y_mm3_per_s]
    found = np.array([other.leak_x_mm3_per_s, other.leak_y_mm3_per_s]) / unit
    yield Found(f"{name}: leak", float(np.abs(found - given).max() / given.max()), 1e-6)
    closed = swap @ [base.percolates_x, base.percolates_y]
    again = np.array([other.percolates_x, other.percolates_y])
    yield Found(f"{name}: closed", float(np.abs(again - closed).max()), 0.0)


def _same(name, case, base, other, change, solved, shared, scale=(1.0, 1.0)):
    """Yield how much two histories differ, the first one changed."""
    length, modulus = scale
    unit = modulus * length**2
    if case.friction is not None:
        yield from _same_shear(name, case, base, other, (unit, unit * length))
    if case.leak:
        yield from _same_leak(name, base, other, length**3)
    largest = base.force_N.max() or 1.0
    yield Found(
        f"{name}: force", float(np.abs(other.force_N / unit - base.force_N).max() / largest), solved
    )
    most = base.contact_area_fraction.max() or 1.0
    apart = np.abs(other.contact_area_fraction - base.contact_area_fraction).max() / most
    # cells, and so the area, come and go one by one
    yield Found(f"{name}: area", float(apart), 100.0 * solved)
    given, found = base.patch_pressure_MPa, other.patch_pressure_MPa / modulus
    expected = np.array([change(row.reshape(case.patches)).ravel() for row in given])
    scale = given.max() or 1.0
    yield Found(f"{name}: patches", float(np.abs(found - expected).max() / scale), shared)


def _solved(case):
    """Return what a coupling and its micro model are solved to, relative to the force."""
    if case.micro["model"] == "half-space" or case.kind in ("concurrent", "consistent"):
        return 1e-8  # residuals of pressures and forces; rounding of the body's compliance
    return 1e-9


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
