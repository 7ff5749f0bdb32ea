"""Damping of Newton steps: halve the step until the norm of the error falls."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from geometry.errors import NotConverged
from micro.complementarity.contact_problem import Lifts

Array = NDArray[np.float64]

_SHORTEST_STEP = 2.0**-10
_LEAST_DECREASE = 1e-4


def damped_step(
    evaluate: Callable[[Array], tuple[Lifts, Array]], point: Array, step: Array, norm: float
) -> tuple[Array, Lifts, Array]:
    """Return the first of point + step, point + step/2, … whose error is smaller, with it.

    Args:
        evaluate: Takes the indentations; returns the lift that they cause and the error to bring
            to 0.
        point: Where the step starts, shape (n,).
        step: The full Newton step, shape (n,).
        norm: Euclidean norm of the error at ``point``.

    Returns:
        The new point, its lift and its error.

    Raises:
        NotConverged: When no step down to 1/1024 lowers the norm.
    """
    length = 1.0
    while length >= _SHORTEST_STEP:
        trial = point + length * step
        lift, error = evaluate(trial)
        if np.linalg.norm(error) <= (1.0 - _LEAST_DECREASE * length) * norm:
            return trial, lift, error
        length *= 0.5
    raise NotConverged(
        "a damped Newton step", reason="LINE_SEARCH", iterations=1, remedy="lower load.approach"
    )
