"""Makes the history of load steps, with notes on the approximations behind them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from multiscale.couplings.newton_choice import newton_choice
from multiscale.couplings.reference import ReferenceCoupling
from multiscale.laws.law_table import LawTable
from multiscale.loading.load_step import LoadStep
from multiscale.loading.stepper import Coupling
from multiscale.measured_errors import error_notes
from multiscale.results.history import History, range_notes
from multiscale.setup.problem import ProblemSetup


def noted_history(
    setup: ProblemSetup,
    steps: Sequence[LoadStep],
    *,
    coupling: Coupling | None,
    table: LawTable | None,
    accuracy: float | None,
    seconds: Mapping[str, float],
    notes: Sequence[str],
) -> History:
    """Return the history of load steps.

    Args:
        setup: The problem set up from a scene.
        steps: The load steps accepted so far.
        coupling: What found them; None before it is made.
        table: The laws, where the steps use laws.
        accuracy: Relative error of the force that was asked for; None when it was not.
        seconds: Wall time of each phase of the run [s].
        notes: Notes that were taken on the way.
    """
    said = [*_approximations(setup, table, steps), *notes, *error_notes(list(steps), accuracy)]
    record = None
    if isinstance(coupling, ReferenceCoupling):
        record = coupling.record(steps)
        said += coupling.notes(record, steps)
        steps = record.with_errors(steps)
    return History(
        steps=tuple(steps),
        patches=setup.patches,
        seconds=dict(seconds),
        notes=tuple(said),
        reference=record,
    )


def _approximations(
    setup: ProblemSetup, table: LawTable | None, steps: Sequence[LoadStep]
) -> Iterator[str]:
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
