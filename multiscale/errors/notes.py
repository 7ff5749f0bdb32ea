"""What a run reports of its own approximations, besides the measured errors."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from multiscale.couplings.newton_choice import newton_choice
from multiscale.laws.law_table import LawTable
from multiscale.loading.load_step import LoadStep
from multiscale.results.validity import range_notes
from multiscale.setup.problem import ProblemSetup


def approximation_notes(
    setup: ProblemSetup, table: LawTable | None, steps: Sequence[LoadStep]
) -> Iterator[str]:
    """Yield what a report says of the micro model, the laws and the load steps.

    Args:
        setup: The problem set up from the scene.
        table: The laws, where the steps use laws.
        steps: The load steps accepted so far.
    """
    if setup.choice is not None:
        yield f"micro model chosen: {setup.choice.sentence}"
    if table is not None:
        yield from table.notes(setup.table_tolerance)
        planned, taken = newton_choice(setup), newton_choice(setup, table)
        if taken.condensed != planned.condensed:
            yield f"Newton condensed to the patches, not full: {taken.why}"
    imbalances = [abs(step.imbalance) for step in steps if step.imbalance is not None]
    if imbalances:
        yield f"force against the support's reaction: equal to {max(imbalances):.1e}"
    yield from range_notes(steps, table)
