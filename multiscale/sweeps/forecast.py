"""What a sweep will take: a model of its time, memory and files.

With N cases of S load steps on P ranks, a case of c seconds and a set-up of s seconds on each rank:

    time = s + c (N / P + ½) + d S / P + w N S,

where half a case is what ranks wait for the last one, d the time of the statistics of all columns
at a load step, and w what rank 0 takes to write a load step into ``history.csv``. Every rank holds
the load steps of its N / P cases and, while statistics are made, copies of as many numbers.

Measured figures: demos/hpc/scaling.md, section on sweeps.
"""

from __future__ import annotations

from dataclasses import dataclass

from multiscale.sweeps.statistics import NUMBERS

_ROW, _TABLE = 940.0, 630.0
"""Memory of a load step as it is held, and more of it while statistics are made [B]."""
_COLUMN, _COLUMN_CASE = 0.1e-3, 25e-9
"""Time of the statistics of a column at one load step, and of it for each case [s]."""
_WRITTEN = 19e-6
"""Time of a load step in the table of all [s]."""
_CASE = 190.0
"""Memory of the number of a case, which every rank knows [B]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SweepForecast:
    """What a sweep is predicted to take.

    Args:
        cases: Cases that are still to be run, N.
        ranks: Ranks P that share them.
        steps: Load steps S of a case.
        case_seconds: Time of a case on one core, c [s].
        set_up_seconds: Time that each rank takes once, s [s].
        run_bytes: Memory of a process that runs one case [B].
    """

    cases: int
    ranks: int
    steps: int
    case_seconds: float
    set_up_seconds: float = 0.0
    run_bytes: float = 0.0

    @property
    def seconds(self) -> float:
        """Wall time where every rank has a core [s]."""
        each = self.cases / self.ranks
        waiting = 0.5 if self.ranks > 1 and each > 1.0 else 0.0
        alone = self.case_seconds * max(each + waiting, 1.0)
        column = _COLUMN + _COLUMN_CASE * self.cases
        described = column * self.steps * len(NUMBERS) / self.ranks
        return self.set_up_seconds + alone + described + _WRITTEN * self.cases * self.steps

    @property
    def rank_bytes(self) -> float:
        """Memory of a rank [B]."""
        own = self.cases / self.ranks * self.steps * (_ROW + _TABLE)
        return self.run_bytes + own + _CASE * self.cases

    @property
    def files(self) -> int:
        """Files that grow while the sweep runs: one for each rank."""
        return self.ranks
