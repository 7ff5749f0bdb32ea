"""The planes that pressed the rows of laws, where the plane was free to turn."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import cached_property
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from geometry.control import Control
from geometry.errors import InputError, NotConverged

Array = NDArray[np.float64]
State = TypeVar("State")

_TOLERANCE = 1e-10
"""Change of the approach that no longer counts, relative to the way of the whole path."""
_MOST_PASSES = 40


@dataclass(frozen=True, kw_only=True, eq=False)
class PlanePath:
    """How a plane without moment turns while it comes nearer.

    The contacts balance such a plane, not the mean pressures of patches at their centres: laws of
    few large patches would not tell how it turns, and a single one not at all. It turns as it did
    where the contacts were solved for.

    Attributes:
        approach: Approaches at the middle, increasing, shape (m,) [mm].
        tilt: Slopes along x and y there, shape (m, 2).
        force: Forces, increasing from none at first touch, shape (m,) [N].
        moment: First moments of the contacts' forces, which the micro model's tolerance leaves of
            zero, shape (m, 2) [N mm].
    """

    approach: Array
    tilt: Array
    force: Array
    moment: Array

    def __post_init__(self) -> None:
        count = len(self.approach)
        shapes = {"approach": (count,), "tilt": (count, 2), "force": (count,), "moment": (count, 2)}
        for name in (one.name for one in fields(self)):
            values = getattr(self, name)
            if not count or values.shape != shapes[name] or not np.all(np.isfinite(values)):
                raise InputError(
                    f"a path needs a finite {name}", value=values.shape, allowed=f"{shapes[name]}"
                )
        if np.any(np.diff(self.approach) <= 0.0):
            raise InputError("a path needs a strictly increasing approach")

    def tilt_at(self, approach: float) -> tuple[float, float]:
        """Return the slopes at an approach at the middle; beyond both ends as there."""
        tx, ty = self._over_approach(self.tilt, approach)
        return float(tx), float(ty)

    def moment_at(self, approach: float) -> tuple[float, float]:
        """Return the moments that are left at an approach [N mm]."""
        mx, my = self._over_approach(self.moment, approach)
        return float(mx), float(my)

    def press(
        self,
        control: Control,
        press: Callable[[Control], State],
        approach_of: Callable[[State], float],
    ) -> State:
        """Press laws by a plane that turns as the path tells.

        Args:
            control: What is prescribed; the tilt is not.
            press: Finds the equilibrium under a plane of given tilt.
            approach_of: Returns the approach of an equilibrium [mm].

        Raises:
            NotConverged: When no plane of the path bears the force.
        """
        if control.approach is not None:
            at = control.approach
            return press(Control(approach=at, tilt=self.tilt_at(at)))
        approach, before = self._approach_under(control.force or 0.0), None
        for _ in range(_MOST_PASSES):
            state = press(Control(force=control.force, tilt=self.tilt_at(approach)))
            missed = approach_of(state) - approach
            if abs(missed) <= _TOLERANCE * self._way:
                return state
            step = missed
            if before is not None and (missed - before[1]) * (approach - before[0]) < 0.0:
                step = -missed * (approach - before[0]) / (missed - before[1])
            before = approach, missed
            approach += step
        raise NotConverged(
            f"the plane that turns under a force of {control.force:g} N",
            reason="MAX_ITERATIONS",
            iterations=_MOST_PASSES,
            remedy="take more load steps (load.steps) or prescribe the tilt (load.tilt)",
        )

    @property
    def _way(self) -> float:
        return float(np.abs(self.approach).max())

    def _over_approach(self, values: Array, approach: float) -> Array:
        if len(self.approach) == 1:
            return values[0]
        at = np.clip(approach, self.approach[0], self.approach[-1])
        return np.asarray(PchipInterpolator(self.approach, values)(at))

    def _approach_under(self, force: float) -> float:
        roots, approach = self._bearing
        return float(np.interp(force ** (2 / 3), roots, approach))

    @cached_property
    def _bearing(self) -> tuple[Array, Array]:
        """Increasing F^(2/3), nearly straight over the approach (Hertz), and the approaches."""
        roots = np.maximum.accumulate(self.force) ** (2 / 3)
        return roots, self.approach
