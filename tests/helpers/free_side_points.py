"""Displacement of points near free sides by rectangles of pressure, by Fourier series."""

import numpy as np

from patchlaw.micro.boundary_elements.free_sides import distance_nodes, means_over, values_at

SHORTEST = 24.0  # waves on the shortest rectangle along the side
NEAREST = 1.0 / 256.0  # of the narrowest rectangle across it: the first node


def side_displacements(sides, x, y, loads):
    """Return what sides add at points by unit pressure on M rectangles, (nx, ny, M), for E* = 1."""
    total = by_two(sides, 0, x, y, loads.borders_x, loads.borders_y)
    total += by_two(sides, 1, y, x, loads.borders_y, loads.borders_x).transpose(1, 0, 3, 2)
    return total.reshape(len(x), len(y), loads.count)


def by_two(sides, axis, across, along, rows, columns):
    """Return what two opposite sides add, shape (across, along, rows, columns)."""
    length, period = sides.lengths[axis], 2.0 * sides.lengths[1 - axis]
    widths, middles = np.diff(columns), 0.5 * (columns[1:] + columns[:-1])
    waves = np.arange(int(np.ceil(SHORTEST * period / widths.min())))
    nodes = distance_nodes(NEAREST * float(np.diff(rows).min()), length)
    compliance = sides.compliance(axis, nodes, waves)
    near = values_at(nodes, across), means_over(nodes, rows)
    far = values_at(nodes, length - across), means_over(nodes, length - rows[::-1])[::-1]
    lines = sum(
        seen.toarray() @ compliance @ (loaded * np.diff(rows)[:, None]).T
        for seen, loaded in (near, far)
    )
    phase = np.cos(
        2.0 * np.pi / period * np.multiply.outer(waves, np.subtract.outer(along, middles))
    )
    phase *= (np.sinc(np.multiply.outer(waves / period, widths)) * widths)[:, None]
    phase *= (np.where(waves == 0, 1.0, 2.0) / period)[:, None, None]
    return np.tensordot(lines, phase, axes=(0, 0)).transpose(0, 2, 1, 3)
