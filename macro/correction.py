"""What a finite block adds to the half-space at its top: a smooth field, linear in the pressures.

Under pressures on its top the block's displacement is u = u_hs + u_c. The half-space's part u_hs
is known in closed form, with all that is singular below the loads. The rest u_c is smooth: one
solution for each rectangle of a grid of loads serves every load step.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import RectBivariateSpline, make_interp_spline

from geometry.partition import Partition

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Sag:
    """Downward displacement of the block's top by u_c, a smooth function of the place.

    Args:
        spline: Spline through the nodes.
    """

    spline: RectBivariateSpline

    def __call__(self, x: Array, y: Array) -> Array:
        """Return it at points; a column of abscissae and a row of ordinates span a grid [mm]."""
        x, y = np.asarray(x, float), np.asarray(y, float)
        if x.ndim == 2 and x.shape[1] == 1 and y.ndim == 1:
            return np.asarray(self.spline(x[:, 0], y))
        x, y = np.broadcast_arrays(x, y)
        return np.asarray(self.spline.ev(x, y))


@dataclass(frozen=True, eq=False)
class Correction:
    """The smooth field u_c at the top of a block, for pressures on a grid of rectangles.

    Args:
        loads: The M rectangles.
        x: Abscissae of the top's nodes, ascending, shape (nx,) [mm].
        y: Their ordinates, shape (ny,) [mm].
        values: Downward displacement of the nodes by unit pressure on each rectangle,
            shape (nx, ny, M) [mm/MPa].
    """

    loads: Partition
    x: Array
    y: Array
    values: Array

    def sag(self, forces: Array) -> Sag:
        """Return the downward displacement by forces on the rectangles, to be added to u_hs.

        Args:
            forces: Forces, uniform on each rectangle, shape (M,) [N].
        """
        nodal = self.values @ (np.asarray(forces, float) / self.loads.areas)
        return Sag(RectBivariateSpline(self.x, self.y, nodal))

    def less(self, known: Array) -> Correction:
        """Return what is left where a part of the displacements is known from elsewhere.

        Args:
            known: Downward displacement of the nodes by unit pressure on each rectangle, of the
                shape of ``values`` [mm/MPa].
        """
        return replace(self, values=self.values - known)

    def patch_compliance(self, patches: Partition) -> Array:
        """Return the mean of u_c over patch i by unit pressure on patch j, shape (N, N) [mm/MPa].

        Patches that the rectangles do not divide load them by the area they share. By reciprocity
        forces displace each other's patches alike; what the mesh leaves of a difference is averaged
        out (see `asymmetry`).

        Args:
            patches: N patches within the loads' rectangle.
        """
        by_force = self._means(patches) / patches.areas
        return np.asarray(0.5 * (by_force + by_force.T) * patches.areas)

    @cached_property
    def asymmetry(self) -> float:
        """Largest asymmetry of the compliance of the rectangles, relative to its largest entry."""
        found = self._means(self.loads) / self.loads.areas
        return float(np.abs(found - found.T).max() / np.abs(found).max())

    def _means(self, patches: Partition) -> Array:
        over_x = _interval_means(self.x, patches.borders_x)
        over_y = _interval_means(self.y, patches.borders_y)
        means = np.einsum("ia,jb,abm->ijm", over_x, over_y, self.values, optimize=True)
        share_x, share_y = (
            _overlaps(ours, theirs) / np.diff(ours)[:, None]
            for ours, theirs in (
                (self.loads.borders_x, patches.borders_x),
                (self.loads.borders_y, patches.borders_y),
            )
        )
        means = means.reshape(patches.count, *self.loads.shape)
        spread = np.einsum("pkl,ki,lj->pij", means, share_x, share_y, optimize=True)
        return np.asarray(spread.reshape(patches.count, patches.count))


def _interval_means(ticks: Array, borders: Array) -> Array:
    """Return the means of the interpolating spline over intervals, per value at the ticks."""
    spline = make_interp_spline(ticks, np.eye(len(ticks)))
    return np.asarray(np.diff(spline.antiderivative()(borders), axis=0) / np.diff(borders)[:, None])


def _overlaps(ours: Array, theirs: Array) -> Array:
    """Return the lengths that intervals share, shape (ours, theirs) [mm]."""
    upper = np.minimum.outer(ours[1:], theirs[1:])
    return np.maximum(upper - np.maximum.outer(ours[:-1], theirs[:-1]), 0.0)
