"""Says where a run went beyond the range of validity of its micro model."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from multiscale.laws.law_table import LawTable
from multiscale.loading.load_step import LoadStep


def range_notes(steps: Sequence[LoadStep], table: LawTable | None) -> Iterator[str]:
    """Yield a sentence when load steps lie outside the range of the micro model.

    Args:
        steps: The load steps.
        table: The laws, where the steps stand on laws.
    """
    told = {step.step: step.warnings[0] for step in steps if step.warnings}
    if table is not None:
        told |= _beyond(steps, table)
    if told:
        first = min(told)
        yield (
            f"load steps outside the micro model's range of validity: {len(told)} of "
            f"{len(steps)}; first step {first}: {told[first]}; micro.model = 'half-space' has no "
            "such range"
        )


def _beyond(steps: Sequence[LoadStep], table: LawTable) -> dict[int, str]:
    """Return what to say of the steps with patches loaded beyond the range of their laws."""
    limit = np.array([law.warning_pressure for law in table.laws])
    told = {}
    for step in steps:
        pressure = step.patches.pressure_MPa
        count = int(np.sum((pressure > 0.0) & (pressure >= limit)))
        if count:
            told[step.step] = (
                f"{count} of {limit.size} patches are loaded beyond what the model "
                f"{table.made_by['model']} stands for"
            )
    return told
