"""Makes laws rise where noise made them fall, and measures by how much."""

from __future__ import annotations

from dataclasses import replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from multiscale.laws.patch_law import PatchLaw
from multiscale.laws.rows import LawRows

Array = NDArray[np.float64]
Rows = TypeVar("Rows", bound=LawRows)

_NOISE = 1e-3
"""Fall of a closure, relative to the range of closures, that counts as noise."""


def with_rising_pressure(rows: Rows) -> tuple[Rows, float]:
    """Return rows of a patch alone whose pressure rises with the approach.

    A rigid plane that comes nearer to a patch alone cannot lose force: pressures that fall are an
    unevenness of a micro model or the noise of a measurement. They become the nearest rising
    sequence in least squares. The displacement behind a closure is scaled with its pressure.

    Args:
        rows: Rows of increasing approaches, columns of shape (n,).

    Returns:
        The rows, and the largest change relative to the largest pressure.

    Source:
        Barlow, Bartholomew, Bremner & Brunk 1972, Statistical inference under order restrictions,
        ch. 1 (pool adjacent violators).
    """
    before = rows.pressure
    pressure = _rising(before)
    change = float(np.abs(pressure - before).max(initial=0.0)) / (before.max(initial=0.0) or 1.0)
    if change:
        scale = np.divide(pressure, before, out=np.ones(len(rows)), where=before > 0.0)
        closure = rows.approach - scale * (rows.approach - rows.closure)
        rows = replace(rows, closure=closure, pressure=pressure)
    return rows, change


def rising_rows(rows: Rows) -> tuple[Rows, float]:
    """Return rows of a patch alone that rise, without those that then carry no information.

    Of rows of equal pressure the first is kept. A closure that falls for good is kept, because the
    patch's stiffness has outgrown that of its own half-space. One that lies a little below those
    before it is left out.

    Args:
        rows: Rows of increasing approaches, columns of shape (n,).

    Returns:
        The rows that are kept, and the largest change: of a pressure relative to the largest, or
        of a closure relative to the range.
    """
    rows, change = with_rising_pressure(rows)
    closure, pressure = (np.maximum.accumulate(column) for column in (rows.closure, rows.pressure))
    fall, span = closure - rows.closure, float(np.ptp(rows.closure))
    noise = (fall > 0.0) & (fall < _NOISE * span)
    noise |= np.concatenate(([False], (np.diff(closure) == 0.0) & (fall[1:] == 0.0)))
    noise &= np.arange(len(rows)) < np.argmax(rows.closure)
    rising = np.concatenate(([True], pressure[1:] > pressure[:-1]))
    left_out = float(fall[noise].max(initial=0.0)) / (span or 1.0)
    return rows[rising & ~noise], max(change, left_out)


def repaired_law(law: PatchLaw) -> PatchLaw:
    """Return a law whose pressure rises; the same one where it does.

    Args:
        law: The law of a patch alone, as a table from elsewhere may have it.
    """
    if np.all(np.diff(law.rows.pressure) >= 0.0):
        return law
    rows, change = with_rising_pressure(law.rows)
    return replace(law, rows=rows, repaired=max(change, law.repaired))


def _rising(values: Array) -> Array:
    """Return the rising sequence nearest to values in least squares."""
    means: list[float] = []
    counts: list[int] = []
    for value in values.tolist():
        means.append(value)
        counts.append(1)
        while len(means) > 1 and means[-2] > means[-1]:
            count, mean = counts.pop(), means.pop()
            means[-1] = (counts[-1] * means[-1] + count * mean) / (counts[-1] + count)
            counts[-1] += count
    return np.repeat(means, counts)
