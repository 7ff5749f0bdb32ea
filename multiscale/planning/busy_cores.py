"""How much of the cores other programs leave, from clocks read around a short piece of work.

Programs that compete for cores share them evenly. With d others that would compute all the time, a
process of t threads on c cores has t/(t + d) of them, or a core for each thread where that is less.
What others used beside one busy thread of ours, over the share of a core that this thread had, is
their number d.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

_TICK = 0.01
"""Time of a tick in which Linux counts the use of cores [s]."""
_LEAST_SHARE = 0.02
"""Share of a core below which no thread falls."""
_QUIET = 0.15
"""Others below this count as none: every system does a little in the background."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Competition:
    """Other programs on the cores of this machine.

    Attributes:
        others: Cores that they would keep busy, had they all that they want.
        cores: Cores of the machine.
    """

    others: float = 0.0
    cores: int = 1

    @property
    def busy(self) -> bool:
        """Whether others compute."""
        return self.others > _QUIET

    def delay(self, threads: int) -> float:
        """Return how many times longer work in some threads takes than on cores that are idle.

        Args:
            threads: Threads of the work.
        """
        others = self.others if self.busy else 0.0
        return max(1.0, (threads + others) / max(self.cores, threads))

    @classmethod
    def of(cls, *, wall: float, own: float, all_used: float, cores: int) -> Competition:
        """Return the competition that clocks tell of.

        Args:
            wall: Wall time of a piece of work in one thread [s].
            own: Time of a core that this process had meanwhile [s].
            all_used: Time of all cores that all programs had meanwhile [s].
            cores: Cores of the machine.
        """
        if wall <= 0.0:
            return cls(cores=cores)
        share = min(max(own / wall, _LEAST_SHARE), 1.0)
        return cls(others=max(all_used - own, 0.0) / wall / share, cores=cores)


@dataclass(frozen=True, slots=True, kw_only=True)
class Clocks:
    """The clocks of a machine; tests have others.

    Attributes:
        wall: Wall time [s].
        own: Time of cores that this process has had [s].
        all_used: Time of all cores that all programs have had [s].
        cores: Cores of the machine.
    """

    wall: Callable[[], float] = time.perf_counter
    own: Callable[[], float] = time.process_time
    all_used: Callable[[], float] = lambda: time_used()
    cores: int = os.cpu_count() or 1

    @contextmanager
    def around(self, found: list[Competition]) -> Iterator[None]:
        """Append the competition during a piece of work in one thread.

        Args:
            found: Where it is appended.
        """
        clocks = self.wall, self.own, self.all_used
        began = [clock() for clock in clocks]
        yield
        wall, own, used = (clock() - start for clock, start in zip(clocks, began, strict=True))
        found.append(Competition.of(wall=wall, own=own, all_used=used, cores=self.cores))


def time_used(file: Path = Path("/proc/stat")) -> float:
    """Return the time of all cores that all programs have had since the machine started [s].

    Args:
        file: Counts of the operating system, as Linux gives them. Elsewhere this process stands
            for all, and none other is seen.
    """
    try:
        counts = [int(word) for word in file.read_text("utf-8").splitlines()[0].split()[1:9]]
    except (OSError, IndexError, ValueError):
        return time.process_time()
    user, nice, system, _, _, interrupts, soft, stolen = counts
    return _TICK * (user + nice + system + interrupts + soft + stolen)
