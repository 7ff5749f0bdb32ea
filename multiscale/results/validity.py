"""Notes on load steps outside the range of validity of the micro model."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from multiscale.laws.law_table import LawTable
from multiscale.loading.load_step import LoadStep


def range_notes(steps: Sequence[LoadStep], table: LawTable | None) -> Iterator[str]:
    """Yield a sentence when load steps lie outside the range of validity of the micro model.

    Args:
        steps: The load steps.
        table: The patch laws; None where the micro model is solved itself.
    """
    outside = {step.step: step.warnings[0] for step in steps if step.warnings}
    if table is not None:
        limit = np.array([law.warning_pressure for law in table.laws])
        for step in steps:
            pressure = step.patches.pressure_MPa
            if count := int(np.sum((pressure > 0.0) & (pressure >= limit))):
                outside[step.step] = (
                    f"{count} of {limit.size} patches are loaded beyond the range of the model "
                    f"{table.made_by['model']}"
                )
    if outside:
        first = min(outside)
        yield (
            f"load steps outside the micro model's range of validity: {len(outside)} of "
            f"{len(steps)}; first step {first}: {outside[first]}; micro.model = 'half-space' has "
            "no such range"
        )
