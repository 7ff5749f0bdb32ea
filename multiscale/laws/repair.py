"""Makes laws rise where noise made them fall, and says by how much."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from multiscale.laws.patch_law import PatchLaw

Array = NDArray[np.float64]

_UNEVEN = 1e-3  # of the range of closures: a fall below is no fall
_TOLD = 1e-6  # repairs below are rounding and the tolerance of the micro model
_COLUMNS = ("approach", "closure", "pressure", "contact_area_fraction", "contacts", "relief")


def risen(rows: Array) -> tuple[Array, float]:
    """Make the pressure of a patch alone rise as the plane comes nearer.

    A rigid plane that comes nearer to a patch alone cannot lose force: pressures that fall are an
    unevenness of a micro model or the noise of a measurement. They become the nearest rising
    sequence in least squares; the displacement behind a closure goes with its pressure.

    Args:
        rows: Rows of increasing approaches with the columns of `refinement.refined`, (n, 6 or 7).

    Returns:
        The rows, and the largest change relative to the largest pressure.

    Source:
        Barlow, Bartholomew, Bremner & Brunk 1972, Statistical inference under order restrictions,
        ch. 1 (pool adjacent violators).
    """
    before = rows[:, 2]
    pressure = _rising(before)
    change = float(np.abs(pressure - before).max(initial=0.0)) / (before.max(initial=0.0) or 1.0)
    if change:
        part = np.divide(pressure, before, out=np.ones(len(rows)), where=before > 0.0)
        rows = rows.copy()
        rows[:, 1] = rows[:, 0] - part * (rows[:, 0] - rows[:, 1])
        rows[:, 2] = pressure
    return rows, change


def evened(rows: Array) -> tuple[Array, float]:
    """Make the rows of a patch alone rise, and leave out what then says nothing more.

    Of rows of equal pressure the first is kept. A closure that falls for good is kept: the patch's
    stiffness has outgrown its own half-space. One a little below those before is left out.

    Args:
        rows: As for `risen`.

    Returns:
        The rows that are kept, and the largest change: of a pressure relative to the largest, or
        of a closure relative to the range.
    """
    rows, change = risen(rows)
    highest = np.maximum.accumulate(rows[:, 1:3], axis=0)
    fall, span = highest[:, 0] - rows[:, 1], float(np.ptp(rows[:, 1]))
    uneven = (fall > 0.0) & (fall < _UNEVEN * span)
    uneven |= np.concatenate(([False], (np.diff(highest[:, 0]) == 0.0) & (fall[1:] == 0.0)))
    uneven &= np.arange(len(rows)) < np.argmax(rows[:, 1])
    rising = np.concatenate(([True], highest[1:, 1] > highest[:-1, 1]))
    left_out = float(fall[uneven].max(initial=0.0)) / (span or 1.0)
    return rows[rising & ~uneven], max(change, left_out)


def evened_law(law: PatchLaw) -> PatchLaw:
    """Return a law whose pressure rises; the same one where it does.

    Args:
        law: The law of a patch alone, as a table from elsewhere may have it.
    """
    if np.all(np.diff(law.pressure) >= 0.0):
        return law
    rows, change = risen(np.column_stack([getattr(law, name) for name in _COLUMNS]))
    repaired = max(change, law.repaired)
    return replace(law, closure=rows[:, 1], pressure=rows[:, 2], repaired=repaired)


def repair_notes(laws: Sequence[PatchLaw]) -> Iterator[str]:
    """Yield a sentence when laws had to be repaired.

    Args:
        laws: The laws of all patches.
    """
    changes = [law.repaired for law in laws if law.repaired > _TOLD]
    if changes:
        yield (
            f"monotone repair: in the laws of {len(changes)} of {len(laws)} patches pressure or "
            f"closure fell as the plane came nearer; evened out, by up to {max(changes):.1e} of "
            "their largest"
        )


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
