"""Numbers as people say them: times in minutes and hours, quantities with a prefix."""

from __future__ import annotations

from collections.abc import Callable

Observer = Callable[[str, int, int], None]
"""Told what a run is at: a phase, or parts of one, how many are done, and of how many at most; 0 of
0 where they are not counted."""

_PREFIXES = {
    "mm": (("m", 1e3), ("mm", 1.0), ("µm", 1e-3), ("nm", 1e-6)),
    "N": (("MN", 1e6), ("kN", 1e3), ("N", 1.0), ("mN", 1e-3), ("µN", 1e-6)),
    "MPa": (("GPa", 1e3), ("MPa", 1.0), ("kPa", 1e-3), ("Pa", 1e-6)),
}


def duration(seconds: float) -> str:
    """Return a time as people say it, such as ``0.35 s``, ``1 min 20 s``, ``2 h 5 min``.

    Args:
        seconds: The time [s].
    """
    if seconds < 59.95:
        return f"{seconds:.{3 if seconds >= 9.95 else 2}g} s"
    minutes, rest = divmod(round(seconds), 60)
    if minutes < 60:
        return f"{minutes} min {rest} s" if rest else f"{minutes} min"
    hours, minutes = divmod(round(seconds / 60.0), 60)
    return f"{hours} h {minutes} min" if minutes else f"{hours} h"


def quantity(value: float, unit: str, digits: int = 4) -> str:
    """Return a quantity in the prefix that suits its size, such as ``8 µm`` or ``4 GPa``.

    Args:
        value: The magnitude in ``unit``.
        unit: mm, N or MPa.
        digits: Significant digits.
    """
    prefixes = _PREFIXES[unit]
    rounded = float(f"{abs(value):.{digits}g}")
    fitting = (one for one in prefixes if rounded >= one[1] * (1.0 - 1e-12))
    name, size = next(fitting, prefixes[-1]) if value else (unit, 1.0)
    shown = float(f"{value / size:.{digits}g}")
    return f"{shown:.{max(digits, 15)}g} {name}"
