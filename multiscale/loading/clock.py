"""Wall times of the phases of a run."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from multiscale.readable import Observer


class Clock:
    """Measures the wall time of phases, each without that of phases within it.

    Args:
        seconds: Wall time of phases so far [s].

    Attributes:
        seconds: Wall time of each phase that ended [s].
        observe: Told what the run is at; None without anybody to tell.
    """

    def __init__(self, seconds: Mapping[str, float] | None = None) -> None:
        self.seconds = dict(seconds or {})
        self.observe: Observer | None = None
        self._until = time.perf_counter()
        self._began = self._until - sum(self.seconds.values())

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
