"""What laws of samples miss at the edges of their face.

A law knows its roughness without end. At the edge of a face contacts are cut, bear on material that
ends there, and lie nearer to the edge or further away than their mean density says. A face of two
by two periods of a sample between free sides tells how much: its cells, with the edges at four
places of the period, against the law of the same cells on the same body. What the law carries too
much or too little is a strip along the edge.

Theory: docs/theory.md, section 13.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np

from patchlaw.geometry import Control, Material, Surface
from patchlaw.micro import FreeSides, HalfSpaceModel
from patchlaw.multiscale.laws.patch_law import PatchLaw
from patchlaw.support import Array, NotConverged

_PERIODS, _COARSE, _MOST_CELLS = 2, 16, 64
"""Periods along the face, cells along it that the law is solved on, and cells along a period that
its contacts are solved on at most."""
_STEPS, _TOLERANCE, _RESIDUAL = 60, 1e-9, 1e-4
"""Most steps of Newton's method on the law, its residual, and that of the contacts."""


def edge_width(model: HalfSpaceModel, law: PatchLaw, closure: float, material: Material) -> float:
    """Return the width of the strip along a free edge whose pressure a law errs by [mm].

    Args:
        model: The periodic half-space of the sample, without finite slopes.
        law: The law. Its pressures change from that at the closure as those of the sample do from
            the same one.
        closure: Closure, at which the law bears something [mm].
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
    area, pressure = lengths[0] * lengths[1], float(law.pressure(closure))
    nearer, stiffness = _by_law(law, closure, _compliance_of(sides, model.contact_modulus))
    # far from the edges it is as without end
    endless = period.press(Control(force=pressure * period.surface.area))
    values = np.tile(endless.guess.values, (_PERIODS, _PERIODS))
    found = []
    for place in ((0, 0), (nx // 2, 0), (0, ny // 2), (nx // 2, ny // 2)):
        moved = replace(face.surface, heights=np.roll(heights, place, axis=(0, 1)))
        start = replace(endless.guess, values=np.roll(values, place, axis=(0, 1)))
        state = replace(face, surface=moved).press(Control(force=pressure * area), start=start)
        found.append(state.plane.approach - endless.plane.approach - nearer)
    return float(np.abs(found).max()) * stiffness * area / (pressure * 2.0 * sum(lengths))


def _by_law(law: PatchLaw, closure: float, compliance: Array) -> tuple[float, float]:
    """Return how much nearer edges let the plane come under a law, and its stiffness there.

    Args:
        law: The law.
        closure: Closure without edges [mm].
        compliance: Displacements of the cells of the face by their pressures [mm/MPa].

    Returns:
        The distance [mm], and the derivative of the mean pressure [MPa/mm].
    """
    count, pressure = len(compliance), float(law.pressure(closure))
    pressures = np.full(count, pressure)
    # the law is convex where contacts are few: from a plane under which all cells bear more
    approach = closure + float((compliance @ pressures).max())
    for _ in range(_STEPS):
        point = law.at(approach - compliance @ pressures, extend=True)
        if not point.stiffness.any():
            break
        residual = np.append(pressures - point.pressure, pressures.mean() - pressure)
        tangent = np.eye(count + 1)
        tangent[:-1, :-1] += point.stiffness[:, None] * compliance
        tangent[:-1, -1], tangent[-1, :-1], tangent[-1, -1] = -point.stiffness, 1.0 / count, 0.0
        change = np.linalg.solve(tangent, residual)
        pressures, approach = pressures - change[:-1], approach - change[-1]
        if np.abs(residual).max() < _TOLERANCE * pressure:
            rise = np.linalg.solve(tangent[:-1, :-1], point.stiffness)
            return float(approach) - closure, float(rise.mean())
    raise NotConverged(
        "the law at the edge of a face",
        reason="its pressures were not found",
        iterations=_STEPS,
        remedy="take more cells of the sample",
    )


@lru_cache(maxsize=8)
def _compliance_of(sides: FreeSides, contact_modulus: float) -> Array:
    """Return the displacements of a quarter of a flat face's cells, shape (n, n) [mm/MPa].

    They are those by pressures on each and on its three mirror images.
    """
    flat = Surface(heights=np.zeros((_COARSE, _COARSE)), lengths=sides.lengths)
    cells = HalfSpaceModel(flat, contact_modulus=contact_modulus, sides=sides)
    grid, half = cells.compliance.on_grid(flat.grid, flat.spacing), _COARSE // 2
    units = []
    for x, y in np.ndindex(half, half):
        unit = np.zeros(flat.grid)
        unit[[x, ~x, x, ~x], [y, y, ~y, ~y]] = 1.0
        units.append(grid.displacement(unit)[:half, :half].ravel())
    return np.stack(units, axis=1)
