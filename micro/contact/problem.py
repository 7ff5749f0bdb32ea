"""The contact problem of a rigid body on an elastic one, as a record.

Unknown are the pressures p on the cells of a grid and those rigid motions q of the body that are
free. With the compliance C, the interference d (the overlap of the undeformed bodies where all free
motions are zero) and ℓ_i, how much nearer motion i brings the body, the gap is

    g = C p − d − Σ_i q_i ℓ_i,

and the pressures, bounded by the hardness H where one is given, satisfy

    p = 0 where g > 0,    g = 0 where 0 < p < H,    p = H where g < 0,    Σ p ℓ_i = f_i.

These are the conditions of the minimum of the convex energy ½ p·C p − p·d over all pressures
between 0 and H that meet the loads f_i. Pressures and H are over E*, so that C is a length.

Source: Almqvist, Sahlin, Larsson & Glavatskih 2007, Tribol. Int. 40, 574-579, for the bound H.

Theory: demos/theory.md, section 3.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry.errors import NotConverged
from micro.compliance.grid_compliance import GridCompliance
from micro.contact.clear_plane import clearance
from micro.contact.rigid_motions import Motions

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

_LEAST_EVEN, _MOST_EVEN = 1e-3, 1e6
"""Shares of uniform pressure that are added to a start which cannot meet the loads."""


class ContactPressures(NamedTuple):
    """A solution of the contact problem, or pressures to start one from.

    Attributes:
        pressure: Pressures / E*, shape (nx, ny).
        motion: Free motions of the body, counted from where the interference was, (k,) [mm].
        residual: Largest violation of the contact conditions over the largest interference.
        iterations: Products of the compliance with pressures.
    """

    pressure: Array
    motion: Array = np.zeros(0)
    residual: float = 0.0
    iterations: int = 0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ContactProblem:
    """Contact on the cells of one grid.

    Args:
        compliance: The elastic body.
        interference: Overlap d of the undeformed bodies at zero free motions, negative where they
            are apart, shape (nx, ny) [mm].
        motions: Free rigid motions of the body with their loads; none when not given.
        upper: Upper bound H of the pressures / E*.
    """

    compliance: GridCompliance
    interference: Array
    motions: Motions | None = None
    upper: float = np.inf

    @property
    def turns(self) -> bool:
        """Whether slopes of the body are free."""
        return self.motions is not None and self.motions.turns

    @property
    def unloaded(self) -> bool:
        """Whether no free motion has a load: the approach is prescribed and the tilt is free."""
        return self.motions is not None and not self.motions.loads.any()

    def admissible(self, pressure: Array, fixed: Flags | None = None) -> Array | None:
        """Return pressures near given ones that lie within the bounds and meet the loads.

        Args:
            pressure: Pressures / E* ≥ 0 that may do neither, shape (nx, ny).
            fixed: Cells whose pressures stay as they are where that is possible, shape (nx, ny).

        Returns:
            The pressures, zero where they were; None where no such pressures meet the loads.
        """
        if self.motions is None:
            return pressure if self.upper == np.inf else np.minimum(pressure, self.upper)
        found = None
        if fixed is not None:
            found = self.motions.scaled_to_loads(pressure, self.upper, fixed)
        return self.motions.scaled_to_loads(pressure, self.upper) if found is None else found

    def started(self, pressure: Array) -> tuple[Array, Array]:
        """Return admissible pressures near given ones, and the free motions if nothing touches.

        Args:
            pressure: Pressures / E* ≥ 0, shape (nx, ny).

        Raises:
            NotConverged: When no pressures within the bounds meet the loads.
        """
        if self.unloaded:
            return self._started_unloaded(pressure)
        share = 0.0
        while share <= _MOST_EVEN:
            even = share * (float(pressure.max()) or 1.0)
            found = self.admissible(pressure + even if share else pressure)
            if found is not None:
                return found, np.zeros(0 if self.motions is None else len(self.motions.loads))
            share = 10.0 * share or _LEAST_EVEN
        raise NotConverged(
            "the pressures to start from",
            reason="no pressures within their bounds meet the loads on these cells",
            iterations=0,
            remedy="give a smaller force",
        )

    def _started_unloaded(self, pressure: Array) -> tuple[Array, Array]:
        """Start a body that turns without load from pressures of negative energy.

        The energy without pressure is zero. A body that cannot turn clear must not come to that
        point, for no single contact can carry it from there. Steps that lower the energy never do.
        """
        assert self.motions is not None
        still = np.zeros(len(self.motions.loads))
        found = self.admissible(pressure)
        if found is None or float(np.vdot(found, self.interference)) <= 0.0:
            clear = clearance(self.interference, self.motions)
            if clear.interference <= 0.0:
                return np.zeros(pressure.shape), clear.motion
            found = clear.support
        twice_elastic = float(np.vdot(found, self.compliance.displacement(found)))
        factor = float(np.vdot(found, self.interference)) / twice_elastic  # of the least energy
        found = found * min(factor, self.upper / float(found.max()))
        balanced = self.admissible(found)
        return found if balanced is None else balanced, still
