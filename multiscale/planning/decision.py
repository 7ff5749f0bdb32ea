"""The decision between alternatives: the least cost that promises, or the least expected error."""

from __future__ import annotations

from dataclasses import dataclass

_TOLD = 3  # alternatives that the sentence names

ALL = 0.995
"""Relative error of the force from which on a bound says nothing."""


def bound_text(error: float) -> str:
    """Return the bound of a relative error in words.

    Args:
        error: The bound.
    """
    return "an unknown error" if error >= ALL else f"{100 * error:.2g} %"


@dataclass(frozen=True, kw_only=True)
class Alternative:
    """A combination that could be taken.

    Attributes:
        kind: The coupling.
        patches: Patches along x and y.
        cells: Cells of the block; None without one.
        error: Bound of the relative error of the force.
        seconds: Predicted time of the run [s].
    """

    kind: str
    patches: tuple[int, int]
    cells: tuple[int, int, int] | None
    error: float
    seconds: float

    @property
    def label(self) -> str:
        """The combination in words."""
        text = f"{self.kind}, {self.patches[0]} × {self.patches[1]} patches"
        return text + (f", block of {' × '.join(map(str, self.cells))} cells" if self.cells else "")

    @property
    def price(self) -> str:
        """Expected error and predicted time in words."""
        return f"{bound_text(self.error)} in {self.seconds:.2g} s"


@dataclass(frozen=True, kw_only=True)
class Decision:
    """What was taken for the keys that a scene leaves open, and why.

    Attributes:
        accuracy: Relative error of the force that was asked for.
        taken: The combination taken.
        alternatives: All combinations, the cheapest first.
    """

    accuracy: float
    taken: Alternative
    alternatives: tuple[Alternative, ...]

    @property
    def promised(self) -> bool:
        """Whether the expected error is within the accuracy."""
        return self.taken.error <= self.accuracy

    @property
    def sentence(self) -> str:
        """What was taken, why, and what others would have cost."""
        taken, others = self.taken, [a for a in self.alternatives if a is not self.taken]
        asked = f"an accuracy of {100 * self.accuracy:.3g} %"
        why = f"the cheapest that promises {asked}"
        if not self.promised:
            why = f"the least expected error, for none promises {asked}"
        told = "; ".join(f"{each.label}: {each.price}" for each in _telling(taken, others))
        return f"{taken.label}: {why}, {taken.price}" + (f"; instead, {told}" if told else "")


def decided(found: list[Alternative], accuracy: float) -> Decision:
    """Take the cheapest alternative that promises an accuracy, or that with the least error.

    Args:
        found: The alternatives, one at least.
        accuracy: Relative error of the force.
    """
    ordered = sorted(found, key=lambda a: a.seconds)
    good = [a for a in ordered if a.error <= accuracy]
    taken = good[0] if good else min(ordered, key=lambda a: a.error)
    return Decision(accuracy=accuracy, taken=taken, alternatives=tuple(ordered))


def _telling(taken: Alternative, others: list[Alternative]) -> list[Alternative]:
    """Return the cheapest of every other coupling, then the cheapest others."""
    rivals = {a.kind: a for a in reversed(others) if a.kind != taken.kind}
    rest = [a for a in others if a not in rivals.values()]
    return [*rivals.values(), *rest][:_TOLD]
