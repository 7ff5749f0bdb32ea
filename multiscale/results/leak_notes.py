"""What reports say of the leak."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from multiscale.loading.load_step import LoadStep
from multiscale.readable import Caution, measured, number, percent, quantity

_UNCERTAIN = 0.3
"""Error over the leak from which on a report warns."""

WAYS = {"x_": "along x", "y_": "along y", "": "over the contact face"}
"""Where a fluid may flow, by what stands for it in names of columns."""


def known_leaks(steps: Sequence[LoadStep], way: str) -> list[LoadStep]:
    """Return the load steps whose leak is known.

    Args:
        steps: The load steps.
        way: A key of `WAYS`.
    """
    return [step for step in steps if _leak(step, way) is not None]


def leak_text(step: LoadStep, way: str) -> str:
    """Return the leak at a load step with its error, or that the gap is closed.

    Args:
        step: The load step.
        way: A key of `WAYS`.
    """
    rate, error = _leak(step, way), _error(step, way)
    if not rate:
        return "closed, nothing leaks" + (f" (or {quantity(error, 'mm³/s', 2)})" if error else "")
    return measured(rate, error, "mm³/s")


def leak_notes(steps: Sequence[LoadStep]) -> Iterator[str]:
    """Yield what a report says of the leak.

    Args:
        steps: The load steps.
    """
    for way, name in WAYS.items():
        known = known_leaks(steps, way)
        if not known:
            continue
        step = known[-1]
        yield f"leak {name} at load step {step.step}: {_whole_text(step, way)}"
        closed = [one.step for one in known if not _leak(one, way)]
        if closed and len(closed) < len(known):
            yield (
                f"the gap is closed {name} at {len(closed)} of {len(known)} load steps, first at "
                f"load step {closed[0]}"
            )
        rate, error = _leak(step, way) or 0.0, _error(step, way)
        if error is not None and error > _UNCERTAIN * abs(rate):
            yield Caution(
                f"the leak {name} depends on the grid: on half as many cells a side it differs by "
                f"{quantity(error, 'mm³/s', 2)}, as channels are few cells wide (finer "
                "surface.grid)"
            )


def _whole_text(step: LoadStep, way: str) -> str:
    text = leak_text(step, way)
    if not _leak(step, way):
        return f"{text}: the surfaces touch everywhere along a line across the flow"
    if not way:
        return text
    gap = quantity(getattr(step, f"hydraulic_gap_{way}mm"), "mm", 3)
    factor = number(getattr(step, f"flow_factor_{way[0]}"), 3)
    text += f"; hydraulic gap {gap}, flow factor {factor}"
    share = getattr(step, f"constriction_{way}fraction")
    if share is not None:
        text += f", {percent(share)} of it through the channel of the narrowest constriction"
    return text


def _leak(step: LoadStep, way: str) -> float | None:
    return getattr(step, f"leak_{way}mm3_per_s")


def _error(step: LoadStep, way: str) -> float | None:
    return getattr(step, f"leak_error_{way}mm3_per_s")
