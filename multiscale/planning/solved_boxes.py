"""The boxes of cells that contact problems of a scene are solved on, before they are solved."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from micro.contact.solver import box_around
from multiscale.measured_errors import MOST_CHECKED_CELLS
from multiscale.setup.problem import ProblemSetup

_MOST_LOADS = 4
"""Load steps at most whose boxes are looked at."""


class Box(NamedTuple):
    """The box that holds all cells which can touch at one load.

    Attributes:
        part: Part of the surface in it.
        rows: Part of its rows that hold a cell which can touch.
    """

    part: float = 1.0
    rows: float = 1.0


def solved_boxes(setup: ProblemSetup) -> Sequence[Box]:
    """Return the boxes that are solved at rising loads, that at the largest load last.

    Args:
        setup: The problem.
    """
    loads = setup.load_history
    if setup.samples:
        return (Box(),)
    inside = setup.cell_interference
    largest = float(inside.max())
    if largest <= 0.0:
        return (Box(),)
    steps = _MOST_LOADS if setup.uses_laws else min(loads.count, _MOST_LOADS)
    whole = setup.scene.surface.periodic or loads.tilt is None
    found = []
    for step in range(1, steps + 1):
        touched = inside > (1.0 - step / steps) * largest
        box = (slice(0, len(inside)), slice(None)) if whole else box_around(touched)
        part = math.prod(touched[box].shape) / inside.size
        found.append(Box(part, float(np.mean(touched[box].any(axis=1)))))
    return found


def checks_finer(setup: ProblemSetup, cells: int) -> bool:
    """Tell whether an error check is expected to solve a grid twice as fine.

    Where finite slopes are left out their error outweighs that of the grid.

    Args:
        setup: The problem.
        cells: Cells of the half-space.
    """
    return setup.finite_slopes and 4 * cells <= MOST_CHECKED_CELLS
