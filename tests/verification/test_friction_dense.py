"""`Interface` with friction against dense matrices that share nothing with it."""

import numpy as np
import pytest
from helpers import dense_friction
from scipy.interpolate import RegularGridInterpolator
from test_calculix_friction import (
    LOAD,
    MU,
    NU,
    RATIO,
    STIFFNESS,
    on_nodes,
    path,
    sheared_by_interface,
    sphere,
)

N, PARTS, POINTS = 6, 8, 8


@pytest.mark.slow
def test_interface_sticks_slips_and_turns_as_dense_matrices():
    """A cap of facets on a block, 8 × 8 points on every facet."""
    cells, ticks = (N, N, N // 2), np.linspace(0.0, 1.0, N + 1)
    depth = RegularGridInterpolator((ticks, ticks), sphere(ticks[:, None], ticks))
    points, weight, rule = dense_friction.midpoints(cells[:2], (1.0, 1.0), 2 * (POINTS * N,))
    stiffness, relative = dense_friction.under_plane(cells, (1.0, 1.0, 1.0), LOAD, NU, rule)
    oracle = dense_friction.Sliders(
        stiffness, relative, weight, depth(points), STIFFNESS, STIFFNESS / RATIO, MU
    )
    ends = [oracle.step(one.approach, one.shear.shift) for one in path(PARTS)]
    expected = np.array(ends[PARTS - 1 :: PARTS][1:])

    def facets(x, y):
        return depth(np.clip(np.column_stack([x, y]), 0.0, 1.0))

    found, last = sheared_by_interface(on_nodes(cells), PARTS, facets)
    off = np.hypot(*(found - expected[:, :2]).T) / np.hypot(*expected[:, :2].T)
    # 0.85, 0.51, 0.44, 0.20 %, force 0.23 %: the quadrature of the facets at the rim of a contact
    # three facets wide, over which the slope of sticking ends at once
    assert off.max() < 0.012
    assert off[3] < 3e-3
    assert last.force == pytest.approx(expected[-1, 2], rel=4e-3)
