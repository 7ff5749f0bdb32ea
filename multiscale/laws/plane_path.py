"""The planes that pressed the rows of laws, where the plane was free to turn."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator
from scipy.optimize import brentq

from geometry.errors import InputError

Array = NDArray[np.float64]

_TOLERANCE = 1e-15  # of an approach under a force, of the way of the whole path


@dataclass(frozen=True, kw_only=True, eq=False)
class PlanePath:
    """How a plane without moment turns while it comes nearer.

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

    def approach_under(self, force: float, force_at: Callable[[float], float]) -> tuple[float, int]:
        """Return the approach under a force [mm], and how often the force was asked for.

        Args:
            force: The force; none is that of first touch [N].
            force_at: Returns the force at an approach, in which it rises [N].
        """
        first, last = float(self.approach[0]), float(self.approach[-1])
        if force == 0.0:
            return first, 0
        asked = [force_at(last)]
        if asked[0] < force:  # beyond the path, as if its last secant went on
            rise = (asked[0] - force_at(0.5 * (first + last))) / (0.5 * (last - first) or 1.0)
            return last + (force - asked[0]) / (rise or 1.0), 2

        def excess(approach: float) -> float:
            asked.append(force_at(approach))
            return asked[-1] ** (2 / 3) - force ** (2 / 3)  # nearly straight (Hertz)

        return float(brentq(excess, first, last, xtol=_TOLERANCE * (last - first))), len(asked)

    def _over_approach(self, values: Array, approach: float) -> Array:
        if len(self.approach) == 1:
            return values[0]
        at = np.clip(approach, self.approach[0], self.approach[-1])
        return np.asarray(PchipInterpolator(self.approach, values)(at))
