"""What a cause of error may take of an accuracy, and by how much it is refined for that."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass

from multiscale.auto.keys import MOST_HEIGHTS
from multiscale.couplings.cost import Work

Errors = Mapping[str, float]
"""Errors of the force by cause, relative to it."""
Grid = tuple[int, int]

TRIALS = 6
"""Most trials of a grid, of a mesh, or of the size of meshes."""


@dataclass(frozen=True)
class Share:
    """What some causes of error have of an accuracy.

    Args:
        errors: Errors of all causes.
        causes: Those that are refined together.
        accuracy: Relative error of the force that may be left.
    """

    errors: Errors
    causes: Collection[str]
    accuracy: float

    @property
    def error(self) -> float:
        """Their error."""
        return sum(self.errors.get(cause, 0.0) for cause in self.causes)

    @property
    def allowed(self) -> float:
        """What they may leave: what the others do, or half of the others where that is more."""
        others = sum(error for cause, error in self.errors.items() if cause not in self.causes)
        # at other loads errors differ: this one may take 0.8 of the accuracy
        return max(0.8 * self.accuracy - others, 0.5 * others)

    @property
    def excess(self) -> float:
        """Error over allowed error; above 1 where they are to be refined."""
        return 0.0 if not self.error else self.error / self.allowed


def refinement(excess: float, order: float) -> float:
    """Return the refinement for the next trial.

    Args:
        excess: Error over allowed error.
        order: Known order of the error in the size.
    """
    return min(max(excess ** (1.0 / order), 1.3), 2.0)


def scaled(cells: Grid, factor: float) -> Grid:
    """Return cells along the sides times a factor, as multiples of 8 within the limits.

    Args:
        cells: Cells along x and y.
        factor: The factor.
    """
    x, y = (min(max(8 * math.ceil(factor * count / 8 - 1e-9), 48), MOST_HEIGHTS) for count in cells)
    return x, y


class Tally:
    """Counts what a choice takes."""

    def __init__(self) -> None:
        self._trials, self._work = 0, list[Work]()

    def add(self, *, trials: int = 1, **counted: float) -> None:
        """Count trials.

        Args:
            trials: How many.
            counted: Their work, attributes of `Work`.
        """
        self._trials += trials
        self._work.append(Work(**counted))  # type: ignore[arg-type]

    @property
    def sentence(self) -> str:
        """The trials and what they took; empty without any."""
        if not self._trials:
            return ""
        problems = sum(one.solutions for one in self._work if one.size)
        found = [f"{self._trials} trial{'s' * (self._trials > 1)}"]
        if problems:
            products = 1e-6 * sum(one.products for one in self._work)
            found.append(
                f"about {problems:.0f} contact problems with {products:.2g} million cells × "
                "products"
            )
        if cycles := 1e-6 * sum(one.cycles for one in self._work):
            found.append(f"{cycles:.2g} million unknowns × multigrid cycles")
        return ", ".join(found)
