"""What the free sides of a block add to the half-space near them.

Each side adds what it would add to a quarter-space (`micro.boundary_elements.free_sides`), cut
off at a decay length λ: waves along it longer than 2π λ count as waves of that length. What is left
out is smooth up to the very side. So is what the block does beyond its four quarter-spaces, except
in its corners. Both are left to the body's term (`micro.boundary_elements.body_modes`).

Theory: docs/theory.md, section 5.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from patchlaw.geometry import PatchGrid
from patchlaw.geometry.legendre_modes import gauss_rule
from patchlaw.micro.boundary_elements.free_sides import side_compliance, side_stresses
from patchlaw.support.arrays import Array, Indices
from patchlaw.support.errors import InputError

_STEP = 0.2
"""Distance of the nodes, in the logarithm of the distance from a side; cubics between them err by
6e-5 of 1/(x + x'). With 0.4 the displacement of a flat face in full contact erred by 1e-4, in ways
that no grid tells."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FreeSides:
    """Free sides of a rectangle on top of a block: all four of them, or some.

    Pressures continue periodically along a side, with twice its length as period. The decay length
    is less than that, so the continuation hardly matters.

    Args:
        lengths: Sides (Lx, Ly) of the rectangle [mm].
        poisson_ratio: ν.
        decay_length: λ [mm].
        share: E* of the contact over that of the block alone; less than 1 where a second body gives
            way too. Displacements are those for pressures over E* of the contact.
        present: Whether the low x, high x, low y and high y sides are there.

    Raises:
        InputError: When a length is not positive, or ν out of its range.
    """

    lengths: tuple[float, float]
    poisson_ratio: float
    decay_length: float
    share: float = 1.0
    present: tuple[bool, bool, bool, bool] = (True, True, True, True)

    def __post_init__(self) -> None:
        given = (*self.lengths, self.decay_length)
        if not (np.all(np.isfinite(given)) and min(given) > 0.0):
            problem = "lengths and decay length must be positive"
            raise InputError(problem, value=given, allowed="> 0 mm, finite")
        nu = self.poisson_ratio
        if not -1.0 < nu < 0.5:
            raise InputError("Poisson's ratio is out of range", value=nu, allowed="−1 < ν < ½")

    def compliance(self, axis: int, distances: Array, waves: Indices) -> Array:
        """Return what one side adds at distances by line loads at distances, for E* = 1.

        Args:
            axis: 0 for sides across x, 1 across y.
            distances: From the side, shape (n,) [mm].
            waves: Numbers of waves on twice the length of the side, shape (w,).

        Returns:
            Shape (w, n, n); symmetric.
        """
        nu, numbers = self.poisson_ratio, self._wave_numbers(axis, waves, self.decay_length)
        parts = np.stack([side_compliance(nu, distances, number) for number in numbers])
        return self.share * parts

    def stresses(self, axis: int, distances: Array, waves: Indices) -> Array:
        """Return the stresses that one side adds at distances by line loads at distances.

        They have twice the decay length of displacements. At the side they cancel the half-space's
        stresses, which have no cut-off. The first-order effect of slopes on a smooth load at or
        beside a side then differed by −0.7 to 2.3 % from that in meshed cubes and columns (ν 0 to
        0.45), and by −2 to −6 % in blocks half or a fifth as high as wide. In cubes, the decay
        length of displacements makes −10 to 1 %, no cut-off 5 to 15 %.

        Args:
            axis: 0 for sides across x, 1 across y.
            distances: From the side, shape (n,) [mm].
            waves: Numbers of waves on twice the length of the side, shape (w,).

        Returns:
            Normal to the side, along it, and in shear, shape (3, w, n, n), the loads last [1/mm].
        """
        nu = self.poisson_ratio
        numbers = self._wave_numbers(axis, waves, 2.0 * self.decay_length)
        parts = np.stack([side_stresses(nu, distances, number) for number in numbers], axis=1)
        apart = np.add.outer(distances, distances)
        cut_off, full = (
            number[:, None, None] * np.exp(-np.multiply.outer(number, apart))
            for number in (numbers, np.pi * waves / self.lengths[1 - axis])
        )
        rest = (0.5 - nu) * (cut_off - full)
        parts[0] += rest
        parts[2] -= rest
        return parts

    def patch_compliance(self, patches: PatchGrid) -> Array:
        """Return the mean displacement of patches by unit pressure on patches, for E* = 1.

        Args:
            patches: N patches that fill the rectangle between the sides.

        Returns:
            Patch i by patch j; symmetric for patches of equal area, shape (N, N) [mm].
        """
        x, y = patches.borders_x, patches.borders_y
        total = self._by_two(0, x, y).transpose(0, 2, 1, 3)
        total += self._by_two(1, y, x).transpose(2, 0, 3, 1)
        return np.asarray(total.reshape(patches.count, patches.count))

    def pair(self, axis: int) -> tuple[bool, bool]:
        """Return whether the low and the high side across an axis are there."""
        low, high = self.present[2 * axis : 2 * axis + 2]
        return low, high

    def _by_two(self, axis: int, across: Array, along: Array) -> Array:
        """Return what two opposite sides add, those that are there, by intervals."""
        length, period = self.lengths[axis], 2.0 * self.lengths[1 - axis]
        widths, middles = np.diff(along), 0.5 * (along[1:] + along[:-1])
        waves = np.arange(int(np.ceil(8.0 * period / widths.min())))  # 8 on the narrowest patch
        nodes = distance_nodes(float(np.diff(across).min()) / 256.0, length)
        compliance = self.compliance(axis, nodes, waves)
        near = means_over(nodes, across)
        far = means_over(nodes, length - across[::-1])[::-1]
        lines = sum(
            float(there) * (means @ compliance @ (means * np.diff(across)[:, None]).T)
            for means, there in zip((near, far), self.pair(axis), strict=True)
        )
        # cosine series of the period: means of waves over intervals
        mean = np.exp(2j * np.pi / period * np.multiply.outer(waves, middles))
        mean *= np.sinc(np.multiply.outer(waves / period, widths))
        mean *= np.sqrt(np.where(waves == 0, 1.0, 2.0) / period)[:, None]
        both = (mean[:, :, None] * mean[:, None, :].conj()).real * widths
        return np.tensordot(np.asarray(lines), both, axes=(0, 0))

    def _wave_numbers(self, axis: int, waves: Indices, decay_length: float) -> Array:
        """Return the wave numbers along a side, those of longer waves raised to 1/λ."""
        numbers, cut = np.pi * waves / self.lengths[1 - axis], 1.0 / decay_length
        larger, smaller = np.maximum(numbers, cut), np.minimum(numbers, cut)
        return np.asarray(larger * (1.0 + (smaller / larger) ** 4) ** 0.25)


def distance_nodes(nearest: float, farthest: float) -> Array:
    """Return nodes from one distance to another at least, ascending [mm].

    Args:
        nearest: First node [mm]; what is interpolated is taken for constant below it.
        farthest: A distance within the nodes [mm].
    """
    count = int(np.ceil(np.log(farthest / nearest) / _STEP)) + 1
    return np.asarray(nearest * np.exp(_STEP * np.arange(max(count, 4))))


def values_at(nodes: Array, distances: Array) -> scipy.sparse.csr_array:
    """Return the cubic interpolation from nodes to distances, shape (distances, nodes).

    Args:
        nodes: Of `distance_nodes`, shape (a,) [mm].
        distances: Shape (n,) [mm].
    """
    place = np.log(np.clip(distances, nodes[0], nodes[-1]) / nodes[0]) / _STEP
    first = np.clip(place.astype(np.intp) - 1, 0, len(nodes) - 4)
    t = place - first
    entries = np.stack(
        [
            -(t - 1.0) * (t - 2.0) * (t - 3.0) / 6.0,
            t * (t - 2.0) * (t - 3.0) / 2.0,
            -t * (t - 1.0) * (t - 3.0) / 2.0,
            t * (t - 1.0) * (t - 2.0) / 6.0,
        ],
        axis=1,
    )
    columns = first[:, None] + np.arange(4)
    rows = np.repeat(np.arange(len(distances)), 4)
    shape = len(distances), len(nodes)
    return scipy.sparse.csr_array((entries.ravel(), (rows, columns.ravel())), shape=shape)


def means_over(nodes: Array, borders: Array) -> Array:
    """Return the means of the interpolation over intervals, shape (intervals, nodes).

    Args:
        nodes: Of `distance_nodes`, shape (a,) [mm].
        borders: Of the intervals, ascending [mm].
    """
    inside = nodes[(nodes > borders[0]) & (nodes < borders[-1])]
    ends = np.union1d(borders, inside)  # the interpolation bends at the nodes
    points, weights = gauss_points(ends, 4)
    owner = np.searchsorted(borders, points) - 1
    sums = scipy.sparse.csr_array(
        (weights / np.diff(borders)[owner], (owner, np.arange(points.size)))
    )
    return np.asarray((sums @ values_at(nodes, points)).toarray())


def gauss_points(ticks: Array, count: int) -> tuple[Array, Array]:
    """Return points and weights of Gauss' rule on each interval between ticks.

    Args:
        ticks: Ends of the n intervals, ascending, shape (n + 1,).
        count: Points on an interval.

    Returns:
        Two arrays of shape (n count,).
    """
    points, weights = gauss_rule(count)
    half = 0.5 * np.diff(ticks)[:, None]
    middle = 0.5 * (ticks[1:] + ticks[:-1])[:, None]
    return (middle + half * points).ravel(), (half * weights).ravel()
