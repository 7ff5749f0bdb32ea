"""Finds the plane whose force is the one given, or whose moment is zero, from its loads alone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from geometry.control import Control
from geometry.errors import NotConverged
from multiscale.loading import described

Array = NDArray[np.float64]
T = TypeVar("T")
Evaluate = Callable[[Array], tuple[Array, T]]

TOLERANCE = 1e-8
"""What force and moment may miss, relative to the force and to that times half the diagonal of the
interface; no finer than the loads are told."""

_MOST_EVALUATIONS = 200
_MOST_DOUBLINGS = 60
_ENOUGH = 0.9  # share of a slope that a step may leave, or it is lengthened or shortened


@dataclass(slots=True, kw_only=True)
class Balance:
    """Balances a rigid plane on something elastic that only tells its loads.

    Force and moments are the gradient of a convex energy over the plane's approach and slopes.
    With slopes prescribed the force is met by safeguarded secant steps in F^(2/3), which is nearly
    straight over the approach (Hertz); a plane that may turn is balanced by the BFGS method with a
    line search on slopes (Nocedal & Wright 2006, ch. 6, doi 10.1007/978-0-387-40065-5). The latest
    plane is the next start.

    Attributes:
        half: Half the diagonal of the interface [mm].
        first_touch: Approach of a level plane at first touch [mm].
        plane: The latest plane: approach at the middle [mm], slopes along x and y; shape (3,).
        force: The latest force [N].
    """

    half: float
    first_touch: float
    plane: Array = field(default_factory=lambda: np.zeros(3))
    force: float = 0.0

    def solve(self, evaluate: Evaluate[T], control: Control) -> tuple[Array, T]:
        """Balance the plane.

        Args:
            evaluate: Returns force and first moments (3,) [N, N mm] of a plane (3,), and whatever
                else is known of that solution.
            control: What is prescribed.

        Returns:
            The plane, and what `evaluate` told about it.

        Raises:
            NotConverged: When no plane balances, or `evaluate` fails.
        """
        plane = self.plane.copy()
        if control.tilt is not None:
            plane[1:] = control.tilt
        if control.approach is not None:
            plane[0] = control.approach
        if control.tilt is not None or control.force == 0.0:
            if control.force is not None:
                plane[0] = self._approach(evaluate, control, plane)
            load, known = evaluate(plane)
        else:
            if self.force == 0.0 and control.force is not None:
                plane[0] = self._approach(evaluate, control, plane)
            plane, load, known = self._turned(evaluate, control, plane)
        self.plane, self.force = plane, float(load[0])
        return plane, known

    def _approach(self, evaluate: Evaluate[T], control: Control, plane: Array) -> float:
        """Find the approach that gives a force, the slopes being what they are."""
        wanted = control.force or 0.0

        def root(approach: float) -> float:
            force = float(evaluate(np.array([approach, *plane[1:]]))[0][0])
            if wanted > 0.0 and abs(force - wanted) <= TOLERANCE * wanted:
                return 0.0
            return force ** (2 / 3) - wanted ** (2 / 3) if wanted else float(force > 0.0) - 0.5

        lean = float(np.abs(plane[1:]).sum()) * self.half
        low, high = self._bracket(root, control, lean)
        return _zero(root, low, high, control)

    def _bracket(
        self, root: Callable[[float], float], control: Control, lean: float
    ) -> tuple[tuple[float, float], tuple[float, float]]:
        """Return an approach without enough force, and one with enough, each with its root."""
        wanted = control.force or 0.0
        start = self.first_touch - lean - 1e-9 * self.half
        low = start, (-(wanted ** (2 / 3)) or -0.5)
        reach = 1e-3 * self.half
        if self.force > 0.0 and wanted > 0.0:  # as if F^(2/3) went straight from first touch
            reach = (self.plane[0] - start) * (wanted / self.force) ** (2 / 3)
        for _ in range(_MOST_DOUBLINGS):
            value = root(start + reach)
            if value >= 0.0:
                return low, (start + reach, value)
            low, reach = (start + reach, value), 1.5 * reach
        raise _failure(control, "NO_CONTACT", _MOST_DOUBLINGS)

    def _turned(
        self, evaluate: Evaluate[T], control: Control, plane: Array
    ) -> tuple[Array, Array, T]:
        """Turn the plane, and move it where the force is given, until the loads balance."""
        free = np.array([control.force is not None, True, True])
        unit = np.array([1.0, 1.0 / self.half, 1.0 / self.half])[free]
        wanted = np.array([control.force or 0.0, 0.0, 0.0])[free]
        load, known = evaluate(plane)
        excess = (load[free] - wanted) * unit
        # a force that grows as F ~ δ^(3/2), spread evenly over the interface
        largest = max(float(load[0]), control.force or 0.0)
        depth = max(self._depth(plane, load), 1e-6 * self.half)
        stiffness = np.diag(np.array([1.0, 1 / 6, 1 / 6])[free]) * 1.5 * (largest or 1.0) / depth
        for count in range(_MOST_EVALUATIONS):
            largest = max(float(load[0]), control.force or 0.0)
            if np.abs(excess).max() <= TOLERANCE * largest:
                return plane, load, known
            try:
                step = -np.linalg.solve(stiffness, excess)
            except np.linalg.LinAlgError:  # nothing holds a plane that has turned without bound
                raise _failure(control, "NO_BALANCE", count) from None
            step *= min(1.0, 0.5 * depth / np.abs(step).max()) if self.force == 0.0 else 1.0
            share, found = self._searched(evaluate, plane, excess, free, unit, wanted, step)
            if found is None:
                raise _failure(control, "NO_BALANCE", count)
            load, known, after = found
            change = share * step
            plane = plane.copy()
            plane[free] += unit * change
            stiffness = _updated(stiffness, change, after - excess)
            excess = after
        raise _failure(control, "NO_BALANCE", _MOST_EVALUATIONS)

    def _depth(self, plane: Array, load: Array) -> float:
        """Return how far a plane has come since first touch where its forces have their centre."""
        return float(plane @ load) / load[0] - self.first_touch if load[0] > 0.0 else 0.0

    def _searched(
        self,
        evaluate: Evaluate[T],
        plane: Array,
        excess: Array,
        free: Array,
        unit: Array,
        wanted: Array,
        step: Array,
    ) -> tuple[float, tuple[Array, T, Array] | None]:
        """Shorten or lengthen a step until the slope of the energy along it has fallen."""
        slope, share, low, high = float(excess @ step), 1.0, 0.0, np.inf
        for _ in range(_MOST_DOUBLINGS):
            trial = plane.copy()
            trial[free] += unit * share * step
            load, known = evaluate(trial)
            after = (load[free] - wanted) * unit
            left = float(after @ step)
            if abs(left) <= _ENOUGH * abs(slope):
                return share, (load, known, after)
            low, high = (share, high) if left < 0.0 else (low, share)
            share = 3.0 * share if high == np.inf else 0.5 * (low + high)
        return share, None


def _updated(stiffness: Array, step: Array, change: Array) -> Array:
    """Return the BFGS update, left out where the energy is not seen to curve."""
    curve = float(step @ change)
    pushed = stiffness @ step
    if curve <= 1e-8 * float(step @ pushed):
        return stiffness
    return (
        stiffness
        - np.outer(pushed, pushed) / float(step @ pushed)
        + np.outer(change, change) / curve
    )


def _zero(
    root: Callable[[float], float],
    low: tuple[float, float],
    high: tuple[float, float],
    control: Control,
) -> float:
    """Close a bracket by secant steps that stay well inside it (Illinois method)."""
    side = 0
    for _ in range(_MOST_EVALUATIONS):
        if high[1] == 0.0:
            return high[0]
        if abs(high[0] - low[0]) <= 1e-15 * abs(high[0]):
            return high[0] if control.force else low[0]  # no force at all: not touched
        middle = (low[0] * high[1] - high[0] * low[1]) / (high[1] - low[1])
        value = root(middle)
        if value == 0.0:
            return middle
        if value < 0.0:
            low = middle, value
            high = (high[0], 0.5 * high[1]) if side < 0 else high
            side = -1
        else:
            high = middle, value
            low = (low[0], 0.5 * low[1]) if side > 0 else low
            side = 1
    raise _failure(control, "NO_BALANCE", _MOST_EVALUATIONS)


def _failure(control: Control, reason: str, iterations: int) -> NotConverged:
    return NotConverged(
        f"the balance of the plane at {described(control)}",
        reason=reason,
        iterations=iterations,
        remedy="take more load steps (load.steps) or prescribe the tilt (load.tilt)",
    )
