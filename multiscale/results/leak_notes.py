"""What reports say of the leak."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from multiscale.loading.load_step import LoadStep
from multiscale.readable import Caution, measured, number, percent, quantity

_UNCERTAIN = 0.3
"""Error over the leak from which on a report warns."""

DIRECTIONS = ("x", "y")


def known_leaks(steps: Sequence[LoadStep], direction: str) -> list[LoadStep]:
    """Return the load steps whose leak along x or y is known.

    Args:
        steps: The load steps.
        direction: ``"x"`` or ``"y"``.
    """
    return [step for step in steps if getattr(step, f"leak_{direction}_mm3_per_s") is not None]


def leak_text(step: LoadStep, direction: str) -> str:
    """Return the leak at a load step with its error, or that the gap is closed.

    Args:
        step: The load step.
        direction: Axis along which the fluid flows.
    """
    rate, error = (_of(step, name, direction) for name in ("leak", "leak_error"))
    if not rate:
        return "closed, nothing leaks" + (f" (or {quantity(error, 'mm³/s', 2)})" if error else "")
    return measured(rate, error, "mm³/s")


def leak_notes(steps: Sequence[LoadStep]) -> Iterator[str]:
    """Yield what a report says of the leak.

    Args:
        steps: The load steps.
    """
    for direction in DIRECTIONS:
        known = known_leaks(steps, direction)
        if not known:
            continue
        step = known[-1]
        yield f"leak along {direction} at load step {step.step}: {_whole_text(step, direction)}"
        closed = [one.step for one in known if not getattr(one, f"percolates_{direction}")]
        if closed and len(closed) < len(known):
            yield (
                f"the gap is closed along {direction} at {len(closed)} of {len(known)} load steps, "
                f"first at load step {closed[0]}"
            )
        rate, error = (_of(step, name, direction) for name in ("leak", "leak_error"))
        if error is not None and error > _UNCERTAIN * abs(rate):
            yield Caution(
                f"the leak along {direction} depends on the grid: on half as many cells a side it "
                f"differs by {quantity(error, 'mm³/s', 2)}, as channels are few cells wide (finer "
                "surface.grid)"
            )


def _whole_text(step: LoadStep, direction: str) -> str:
    text = leak_text(step, direction)
    if not getattr(step, f"percolates_{direction}"):
        return f"{text}: the surfaces touch everywhere along a line across the flow"
    gap = quantity(getattr(step, f"hydraulic_gap_{direction}_mm"), "mm", 3)
    factor = number(getattr(step, f"flow_factor_{direction}"), 3)
    text += f"; hydraulic gap {gap}, flow factor {factor}"
    share = getattr(step, f"constriction_{direction}_fraction")
    if share is not None:
        text += f", {percent(share)} of it through the channel of the narrowest constriction"
    return text


def _of(step: LoadStep, name: str, direction: str) -> float:
    return getattr(step, f"{name}_{direction}_mm3_per_s")
