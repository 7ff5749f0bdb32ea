"""Pressures that a contact problem starts from: within their bounds, in balance with the loads."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from geometry.errors import NotConverged
from micro.compliance.elastic_grid import ElasticGrid
from micro.contact.clear_plane import clearance
from micro.contact.constraints import Limits

Array = NDArray[np.float64]

_LEAST_EVEN, _MOST_EVEN = 1e-3, 1e6
"""Shares of even pressure that are added to a start which cannot meet the loads."""


def first_pressure(
    grid: ElasticGrid, required: Array, start: Array, limits: Limits
) -> tuple[Array, Array]:
    """Return admissible pressures near given ones, and the free motions where nothing touches.

    Args:
        grid: The elastic body.
        required: Displacement that the body asks for, shape (nx, ny) [mm].
        start: Pressures / E* ≥ 0, shape (nx, ny).
        limits: Their bounds and loads.

    Raises:
        NotConverged: When no pressures within their bounds meet the loads.
    """
    still = np.zeros(0 if limits.motions is None else len(limits.motions.loads))
    if limits.unloaded:
        return _unloaded(grid, required, start, limits)
    share = 0.0
    while share <= _MOST_EVEN:
        even = share * (float(start.max()) or 1.0)
        pressure = limits.met(start + even if share else start)
        if pressure is not None:
            return pressure, still
        share = 10.0 * share or _LEAST_EVEN
    raise NotConverged(
        "the pressures to start from",
        reason="no pressures within their bounds meet the loads on these cells",
        iterations=0,
        remedy="give a smaller force",
    )


def _unloaded(
    grid: ElasticGrid, required: Array, start: Array, limits: Limits
) -> tuple[Array, Array]:
    """Start a body that turns without load where pressures already lower the energy.

    Without pressure the energy is 0, a point that a body which cannot turn clear must not come to:
    no single contact can carry it from there.
    """
    assert limits.motions is not None
    still = np.zeros(len(limits.motions.loads))
    pressure = limits.met(start)
    if pressure is None or float(np.vdot(pressure, required)) <= 0.0:
        found = clearance(required, limits.motions)
        if found.interference <= 0.0:
            return np.zeros(start.shape), found.motion
        pressure = found.support
    work = float(np.vdot(pressure, grid.displacement(pressure)))
    lowest = float(np.vdot(pressure, required)) / work  # factor on them of the least energy
    pressure = pressure * min(lowest, limits.upper / float(pressure.max()))
    balanced = limits.met(pressure)
    return pressure if balanced is None else balanced, still
