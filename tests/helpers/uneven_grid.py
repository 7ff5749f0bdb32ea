"""Patches between any grid lines, to check terms that the package takes for equal patches alone."""

from dataclasses import dataclass

import numpy as np

from patchlaw.geometry import PatchGrid


@dataclass(frozen=True, kw_only=True)
class UnevenGrid(PatchGrid):
    """Rectangles between stated grid lines, ascending."""

    ticks_x: tuple
    ticks_y: tuple

    borders_x = property(lambda self: np.array(self.ticks_x))
    borders_y = property(lambda self: np.array(self.ticks_y))


def uneven_grid(ticks_x, ticks_y):
    """Return the rectangles between grid lines across x and across y."""
    ticks = ticks_x, ticks_y
    return UnevenGrid(
        grid=tuple(len(one) - 1 for one in ticks),
        lengths=tuple(one[-1] - one[0] for one in ticks),
        origin=tuple(one[0] for one in ticks),
        ticks_x=ticks_x,
        ticks_y=ticks_y,
    )
