"""What laws of samples miss at the edges of their face.

A law knows its roughness without end. At the edge of a face contacts are cut, bear on material that
ends there, and lie nearer to the edge or further away than their mean density says. A face of two
by two periods of a sample between free sides tells how much: its cells, with the edges at four
places of the period, against the law of the same cells on the same body. What the law carries too
much or too little is a strip along the edge.

Theory: docs/theory.md, section 13.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import scipy

from patchlaw.geometry import Control, Material, Surface
from patchlaw.micro.boundary_elements.free_sides import FreeSides
from patchlaw.micro.half_space.model import HalfSpaceModel
from patchlaw.support import Array, NotConverged

_PERIODS, _COARSE, _MOST_CELLS = 2, 16, 64
"""Periods along the face, cells along it that the law is solved on, and cells along a period that
its contacts are solved on at most."""
_LEAST, _MOST, _ROWS = 0.125, 8.0, 7
"""Least and largest pressure that the law is known at, over the mean one, and their number."""
_ROUNDING = 1e-9
"""Growth of closures, over the largest, that may be rounding."""
_STEPS, _TOLERANCE, _RESIDUAL = 60, 1e-9, 1e-5
"""Most steps of Newton's method on the law, its residual, and that of the contacts."""


def edge_width(model: HalfSpaceModel, pressure: float, material: Material) -> float:
    """Return the width of the strip along a free edge whose pressure a law errs by [mm].

    Args:
        model: The periodic half-space of the sample, without finite slopes.
        pressure: Mean pressure [MPa].
        material: The material that ends at the edge.

    Raises:
        NotConverged: When a contact problem cannot be solved.
    """
    nx, ny = (min(count, _MOST_CELLS) for count in model.surface.grid)
    period = replace(model.resampled((nx, ny)), tolerance=_RESIDUAL)
    heights = np.tile(period.surface.heights, (_PERIODS, _PERIODS))
    lengths = _PERIODS * model.surface.lengths[0], _PERIODS * model.surface.lengths[1]
    sides = FreeSides(
        lengths=lengths,
        poisson_ratio=material.poisson_ratio,
        decay_length=0.25 * min(lengths),
        share=model.contact_modulus / material.contact_modulus,
    )
    whole = Surface(heights=heights, lengths=lengths)
    face = replace(period, surface=whole, periodic=False, sides=sides)
    area, perimeter = lengths[0] * lengths[1], 2.0 * sum(lengths)
    approach, stiffness = _by_law(period, face, pressure)
    # far from the edges it is as without end
    endless = period.press(Control(force=pressure * period.surface.area)).guess
    values = np.tile(endless.values, (_PERIODS, _PERIODS))
    found = []
    for place in ((0, 0), (nx // 2, 0), (0, ny // 2), (nx // 2, ny // 2)):
        moved = replace(face.surface, heights=np.roll(heights, place, axis=(0, 1)))
        start = replace(endless, values=np.roll(values, place, axis=(0, 1)))
        state = replace(face, surface=moved).press(Control(force=pressure * area), start=start)
        found.append((state.plane.approach - approach) * stiffness / (pressure * perimeter))
    return float(np.abs(found).max())


def _by_law(period: HalfSpaceModel, face: HalfSpaceModel, pressure: float) -> tuple[float, float]:
    """Return approach and stiffness of a face under a law, on its own compliance [mm, N/mm].

    Args:
        period: The sample that the law belongs to.
        face: A model of the face, which has its lengths, sides and contact modulus.
        pressure: Mean pressure on the face [MPa].
    """
    law, (loads, closures) = _law_of(period, pressure)
    flat = Surface(heights=np.zeros((_COARSE, _COARSE)), lengths=face.surface.lengths)
    compliance = _compliance_of(replace(face, surface=flat, highest=None))
    count = len(compliance)
    pressures = np.full(count, pressure)
    # the law is convex where contacts are few: from a plane under which all cells bear more
    approach = float(np.interp(pressure, loads, closures) + (compliance @ pressures).max())
    for _ in range(_STEPS):
        value, rate = law(approach - compliance @ pressures)
        if not rate.any():
            break
        residual = np.append(pressures - value, pressures.mean() - pressure)
        tangent = np.eye(count + 1)
        tangent[:-1, :-1] += rate[:, None] * compliance
        tangent[:-1, -1], tangent[-1, :-1], tangent[-1, -1] = -rate, 1.0 / count, 0.0
        change = np.linalg.solve(tangent, residual)
        pressures, approach = pressures - change[:-1], approach - change[-1]
        if np.abs(residual).max() < _TOLERANCE * pressure:
            rise = np.linalg.solve(np.eye(count) + rate[:, None] * compliance, rate)
            return float(approach), float(rise.mean() * face.surface.area)
    raise NotConverged(
        "the law at the edge of a face",
        reason="its pressures were not found",
        iterations=_STEPS,
        remedy="take more cells of the sample",
    )


def _law_of(
    period: HalfSpaceModel, pressure: float
) -> tuple[Callable[[Array], tuple[Array, Array]], tuple[Array, Array]]:
    """Return the law of a sample, and the pressures and closures of its rows.

    Args:
        period: The sample.
        pressure: Mean pressure that it is known around [MPa].

    Returns:
        A function of closures, which returns pressures and their derivatives, and the rows.
    """
    area, most = period.surface.area, _MOST * pressure
    if period.hardness is not None:
        most = min(most, 0.95 * period.hardness)
    loads = np.concatenate([[0.0], np.geomspace(_LEAST * pressure, most, _ROWS)])
    pressed, start = [period.first_touch], None
    for load in loads[1:]:
        state = period.press(Control(force=load * area), start=start)
        pressed.append(state.plane.approach)
        start = state.guess
    closures = np.array(pressed)
    # next to full contact closures may not grow by more than rounding
    rising = np.diff(closures, prepend=-np.inf) > _ROUNDING * abs(closures[-1])
    closures, loads = closures[rising], loads[rising]
    law = scipy.interpolate.PchipInterpolator(closures, loads)
    slope = law.derivative()

    def of(closure: Array) -> tuple[Array, Array]:
        inside = np.clip(closure, closures[0], closures[-1])
        rate = slope(inside) * (closure > closures[0])
        return law(inside) + slope(closures[-1]) * np.maximum(closure - closures[-1], 0.0), rate

    return of, (loads, closures)


def _compliance_of(cells: HalfSpaceModel) -> Array:
    """Return the displacements of a quarter of a flat face's cells, shape (n, n) [mm/MPa].

    They are those by pressures on each and on its three mirror images.
    """
    grid, half = cells.compliance.on_grid(cells.surface.grid, cells.surface.spacing), _COARSE // 2
    units = []
    for x, y in np.ndindex(half, half):
        unit = np.zeros(cells.surface.grid)
        unit[[x, ~x, x, ~x], [y, y, ~y, ~y]] = 1.0
        units.append(grid.displacement(unit)[:half, :half].ravel())
    return np.stack(units, axis=1)
