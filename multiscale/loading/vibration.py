"""A natural mode about a load step, and the table of those of all load steps."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, fields
from typing import Any


@dataclass(frozen=True, slots=True, kw_only=True)
class Mode:
    """A natural mode, a row of ``modes.csv``.

    Attributes:
        mode: Number of the mode, from 1 by rising frequency.
        frequency_Hz: Frequency [Hz]; 0 of a motion that does not vibrate.
        frequency_error_Hz: Sum of its errors by elements, load and laws, and residual; None where
            they were not measured [Hz].
        damping_per_s: Rate at which the vibration decays, below zero where it grows [1/s].
        contact_share: Share of the contact in the squared frequency.
        participation_x: Mass that moves along x in this mode, over the whole mass; likewise y, z.
        residual: Residual of the mode in the full problem, relative to its forces.
        element_error_Hz: Error by the elements; None where it was not measured [Hz].
    """

    mode: int
    frequency_Hz: float
    frequency_error_Hz: float | None = None
    damping_per_s: float
    contact_share: float
    participation_x: float
    participation_y: float
    participation_z: float
    residual: float
    element_error_Hz: float | None = None


COLUMNS = tuple(one.name for one in fields(Mode))
"""The columns of ``modes.csv`` after the number of the load step."""


def mode_rows(steps: Iterable[Any]) -> Iterator[list[Any]]:
    """Yield the rows of ``modes.csv``, those of all load steps."""
    for step in steps:
        yield from ([step.step, *(getattr(one, name) for name in COLUMNS)] for one in step.modes)


def modes_by_step(rows: Iterable[Mapping[str, str]]) -> dict[int, tuple[Mode, ...]]:
    """Return the modes of all load steps from the rows of ``modes.csv``."""
    found: dict[int, tuple[Mode, ...]] = {}
    for row in rows:
        known: dict[str, Any] = {name: float(row[name]) for name in COLUMNS if row[name]}
        one = Mode(**known | {"mode": int(row["mode"])})
        found[int(row["step"])] = (*found.get(int(row["step"]), ()), one)
    return found


def merged(modes: Iterable[Mode]) -> Iterator[tuple[Mode, Mode]]:
    """Yield pairs of modes that have merged: of one frequency, of which one grows."""
    before: Mode | None = None
    for one in modes:
        if before and before.damping_per_s < 0.0 < one.damping_per_s and one.frequency_Hz:
            yield before, one
        before = one
