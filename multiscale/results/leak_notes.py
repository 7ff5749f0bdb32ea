"""What reports say of the leak."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from multiscale.loading.leak import WAYS, Leak
from multiscale.loading.load_step import LoadStep
from multiscale.readable import Caution, measured, number, percent, quantity

_UNCERTAIN = 0.3
"""Error over the leak from which on a report warns."""

_REMEDIES = {
    "mesh": "it varies within facets of the contact face, and may differ by {} (finer mesh there)",
    "grid": "on half as many cells a side it differs by {}, as channels are few cells wide (finer "
    "surface.grid)",
    "rows": "between the rows of its table it may differ by {}",
    "samples": "between samples it differs by {} (more law.seeds, or larger samples)",
}
"""What is said of a leak that is not certain, by the cause of most of its error."""


def leak_text(leak: Leak) -> str:
    """Return a leak with its error, or that the gap is closed.

    Args:
        leak: The leak.
    """
    if not leak.rate:
        closed = "closed, nothing leaks"
        return f"{closed} (or {quantity(leak.error, 'mm³/s', 2)})" if leak.error else closed
    return measured(leak.rate, leak.error, "mm³/s")


def leak_notes(steps: Sequence[LoadStep]) -> Iterator[str]:
    """Yield what a report says of the leak.

    Args:
        steps: The load steps.
    """
    for way, name in WAYS.items():
        known = [(step.step, leak) for step in steps if (leak := step.leak(way)) is not None]
        if not known:
            continue
        number_of_last, last = known[-1]
        yield f"leak {name} at load step {number_of_last}: {_whole_text(last)}"
        closed = [step for step, leak in known if not leak.rate]
        if closed and len(closed) < len(known):
            yield (
                f"the gap is closed {name} at {len(closed)} of {len(known)} load steps, first at "
                f"load step {closed[0]}"
            )
        if last.causes and last.error is not None and last.error > _UNCERTAIN * abs(last.rate):
            cause, error = max(last.causes, key=lambda one: one[1])
            text = _REMEDIES[cause].format(quantity(error, "mm³/s", 2))
            yield Caution(f"the leak {name} is uncertain: {text}")


def _whole_text(leak: Leak) -> str:
    text = leak_text(leak)
    if not leak.rate:
        return f"{text}: the surfaces touch everywhere along a line across the flow"
    if len(leak.causes) > 1:
        causes = (f"{cause} {quantity(error, 'mm³/s', 2)}" for cause, error in leak.causes)
        text += f" ({', '.join(causes)})"
    if leak.hydraulic_gap is not None:
        text += f"; hydraulic gap {quantity(leak.hydraulic_gap, 'mm', 3)}"
    if leak.flow_factor is not None:
        text += f", flow factor {number(leak.flow_factor, 3)}"
    if leak.constriction is not None:
        text += f", {percent(leak.constriction)} of it through the channel of the narrowest "
        text += "constriction"
    return text
