"""The base of what sees the load steps of a run."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from multiscale.loading.load_step import LoadStep


class StepObserver:
    """Sees every load step as it is accepted, and may add to it; this one adds nothing."""

    def observe(self, step: LoadStep, before: LoadStep | None, *, last: bool) -> LoadStep:
        """Return the load step with what the observer adds.

        Args:
            step: The load step just accepted, counted from first touch.
            before: The one before it; None for the first.
            last: Whether no other follows.

        Note:
            Collective.
        """
        return step

    def finish(self, step: LoadStep) -> LoadStep:
        """Return the last load step of a run that ended early, with what the observer adds.

        Args:
            step: The load step that turned out to be the last.

        Note:
            Collective.
        """
        return step

    def notes(self, steps: Sequence[LoadStep]) -> Iterator[str]:
        """Yield what a report says of what the observer saw.

        Args:
            steps: All load steps.
        """
        return iter(())

    def release(self) -> None:
        """Let go of what holds bodies in memory."""
