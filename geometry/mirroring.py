"""Heights that do not continue periodically, made periodic by mirroring."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from geometry.surface import Surface


def mirrored(surface: Surface) -> Surface:
    """Return a surface with its mirror images beside it, twice as long and wide, periodic.

    A map that is continued as it is has a step all around it, whose ridge carries load. Mirrored
    heights continue without a step; all they have is a crease where the map slopes at its border.

    Args:
        surface: The surface.
    """
    lx, ly = surface.lengths
    row = np.concatenate((surface.heights, surface.heights[::-1]))
    heights = np.concatenate((row, row[:, ::-1]), axis=1)
    source = f"{surface.source}, mirrored" if surface.source else "mirrored"
    return replace(surface, heights=heights, lengths=(2 * lx, 2 * ly), periodic=True, source=source)
