"""A line search for convex functions that looks at slopes alone.

Near a minimum the values of a function differ by less than their rounding, and their slopes do
not.

Source:
    Nocedal & Wright 2006, ch. 3, doi 10.1007/978-0-387-40065-5.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

_DECREASE = 0.9
"""Share of the slope that may remain after a step."""
_MOST_TRIALS = 100


def slope_search(slope_after: Callable[[float], float], slope: float, share: float) -> float | None:
    """Shorten or lengthen a step until the slope of a convex function along it has fallen.

    Args:
        slope_after: Returns the slope along the step after a share of it; infinite where the
            share is to be shortened anyway. The share that is returned was evaluated last.
        slope: Slope before the step, negative.
        share: Share of the step to try first.

    Returns:
        A share after which the size of the slope is at most 0.9 times that before; None when
        there is none to rounding.
    """
    low, high = 0.0, np.inf
    for _ in range(_MOST_TRIALS):
        left = slope_after(share)
        if abs(left) <= _DECREASE * abs(slope):
            return share
        low, high = (share, high) if left < 0.0 else (low, share)
        share = 3.0 * share if high == np.inf else 0.5 * (low + high)
    return None
