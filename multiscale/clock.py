"""Wall times of the phases of a run."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from multiscale.readable import Observer


class Clock:
    """Measures the wall time of phases from now on, each without that of phases within it.

    Attributes:
        seconds: Wall time of each phase that ended [s].
        observe: Told what the run is at; None without anybody to tell.
    """

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self.observe: Observer | None = None
        self._began = self._until = time.perf_counter()

    def add(self, seconds: Mapping[str, float]) -> None:
        """Add phases that were measured elsewhere and end now.

        Args:
            seconds: Their wall times by name [s].
        """
        self.seconds |= seconds
        self._until = time.perf_counter()

    @contextmanager
    def phase(self, name: str) -> Iterator[None]:
        """Measure the wall time of a phase.

        Args:
            name: Its name in `seconds`.
        """
        if self.observe is not None:
            self.observe(name, 0, 0)
        start = time.perf_counter() - sum(self.seconds.values())
        try:
            yield
        finally:
            self._until = time.perf_counter()
            spent = self._until - sum(self.seconds.values()) - start
            self.seconds[name] = self.seconds.get(name, 0.0) + spent

    @property
    def times(self) -> dict[str, float]:
        """Wall time of each phase that ended, and of all else until then as ``other`` [s]."""
        rest = self._until - self._began - sum(self.seconds.values())
        return {**self.seconds, "other": max(rest, 0.0)}
