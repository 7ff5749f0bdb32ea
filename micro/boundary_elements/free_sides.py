"""What the free sides of a block add to the half-space near them.

Each side adds what it would add to a quarter-space, cut off at a decay length λ: waves along it
longer than 2π λ count as waves of that length. What is left out is smooth up to the very side. So
is what the block does beyond its four quarter-spaces, except in its corners. Both are left to the
body's term (`micro.boundary_elements.body_modes`).

The quarter-space. Pressures p on the top x > 0 of a quarter-space and their mirror images about its
side x = 0 leave no shear on the side, but a normal traction A p. Pressures q = −A p on the side,
and their images about the top, take it off. By symmetry they do not displace the top along its
normal, but load it by A q. The half-space and its image are therefore pressed by p̃ = p + A²p + A⁴p
+ … = (1 − A²)⁻¹ p, and the normal displacement of the top is

    u = (G + G') p̃,

with G the half-space's compliance and G' that of the images (Hetényi 1970; Keer, Lee & Mura 1983).
Waves along the edge do not mix. At wave number k, all lengths counted in 1/k and z into the depth,

    G = 2/(πE*) K₀(|x − x'|),
    A(z, x) = 2/π [z x² K₂(ρ)/ρ² − (1 − 2ν) ∫_z^∞ K₀(√(x² + s²)) ds],   ρ² = x² + z²,

the transforms of Boussinesq's solution (Johnson 1985, eq. 3.18 and 3.19) and of its image.

The stresses in the top are those of one half-space by p̃ and its image about the side, and those of
another one, whose surface is the side, by q = −A p̃ and its image about the top. In the surface of a
half-space, σ_ab = −2ν p δ_ab − (1 − 2ν) φ_,ab with Δφ = p in the plane. Loads ~ cos ky have
φ = −∫ exp(−k|x − x'|) p dx' / 2k, so that

    σ_xx = −p + (½ − ν) ∫ exp(−|x − x'|) p dx',   σ_yy = −2ν p − (½ − ν) ∫ exp(−|x − x'|) p dx',
    σ_xy = (½ − ν) ∫ sign(x − x') exp(−|x − x'|) p dx' (~ sin ky).

Pressure q on the side at depths z, and its image, makes at distance x from the side on the top

    σ_xx = −2/π x³ K₂(ρ)/ρ² q,   σ_xy = −2/π x² K₁(ρ)/ρ q,
    σ_yy = 2/π [x K₀(ρ) − 2ν x K₁(ρ)/ρ − (1 − 2ν) ∫_x^∞ K₀(√(s² + z²)) ds] q.

What is left after the half-space's own part is without singularity, and cancels its σ_xx and σ_xy
at the side.

Theory: docs/theory.md, section 5.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, lru_cache
from typing import Any, NamedTuple

import numpy as np
import scipy

from patchlaw.geometry import PatchGrid
from patchlaw.geometry.face_frame import gauss_rule
from patchlaw.support import Array, Indices, InputError

_LOG_STEP = 0.08
"""Step of the tables, in the logarithm of distances times wave number."""

Spline = tuple[Any, ...]
"""Knots, coefficients and degrees of a bicubic spline, as `scipy.interpolate.bisplev` takes them;
objects of splines check every call for longer than they evaluate some 30 × 30 places."""


def side_compliance(poisson_ratio: float, x: Array, wave_numbers: Array) -> Array:
    """Return normal displacements at distances x from the edge by line loads at distances x.

    Only what the side adds to the half-space is returned, for E* = 1.

    Args:
        poisson_ratio: ν.
        x: Distances, ascending, shape (n,) [mm].
        wave_numbers: k > 0 of loads ~ cos ky along the edge, shape (w,) [1/mm].

    Returns:
        Shape (w, n, n); symmetric.

    Source:
        Hetényi 1970, J. Appl. Mech. 37, 75-80; Keer, Lee & Mura 1983, Int. J. Solids Struct.
        19, 497-508.
    """
    return _values(_compliance_splines(poisson_ratio), x, wave_numbers)[0]


def side_stresses(poisson_ratio: float, x: Array, wave_numbers: Array) -> Array:
    """Return stresses at distances x from the edge by line loads at distances x.

    Only what the side adds to those of the half-space is returned.

    Args:
        poisson_ratio: ν.
        x: Distances, ascending, shape (n,) [mm].
        wave_numbers: k > 0 of loads ~ cos ky along the edge, shape (w,) [1/mm].

    Returns:
        σ_xx, σ_yy (~ cos ky) and σ_xy (~ sin ky) by loads of 1 N/mm, shape (3, w, n, n), the loads
        last [1/mm].
    """
    return _values(_stress_splines(poisson_ratio), x, wave_numbers) / np.add.outer(x, x)


@cache
def _compliance_splines(nu: float) -> list[Spline]:
    logs = _logs(1e-8)
    return [_spline(logs, _side_compliance(logs, nu))]


@cache
def _stress_splines(nu: float) -> list[Spline]:
    """Return splines of the stresses times x + x': so they vary little where both are short."""
    logs = _logs(1e-11)
    apart = np.add.outer(np.exp(logs), np.exp(logs))
    return [_spline(logs, part) for part in _side_stresses(logs, nu) * apart]


def _spline(logs: Array, values: Array) -> Spline:
    """Return the spline through the values of a table."""
    spline = scipy.interpolate.RectBivariateSpline(logs, logs, values)
    return (*spline.get_knots(), spline.get_coeffs(), 3, 3)


def _values(splines: list[Spline], x: Array, wave_numbers: Array) -> Array:
    """Return functions at pairs of x times w wave numbers, (functions, w, n, n); 0 beyond tables.

    The x ascend.
    """
    first, *_, last = splines[0][0]
    logs = np.add.outer(np.log(wave_numbers), np.log(x))
    values = np.zeros((len(splines), *logs.shape, len(x)))
    for wave, (places, within) in enumerate(zip(logs, (logs < last).sum(axis=1), strict=True)):
        places = np.maximum(places[:within], first)
        for value, spline in zip(values, splines, strict=True):
            if within:
                value[wave, :within, :within] = scipy.interpolate.bisplev(places, places, spline)
    return values


def _logs(smallest: float) -> Array:
    """Return places of a table: logarithms of distances times wave number from a smallest one."""
    return np.arange(np.log(smallest), np.log(40.0), _LOG_STEP)


def _reflections(logs: Array, nu: float) -> tuple[Array, Array]:
    """Return A and p̃ − p by p, as matrices between distances exp(logs), at k = 1.

    Functions of the logarithm of a distance are analytic and vanish at both ends, so that the
    trapezoidal rule is accurate.
    """
    weights = _LOG_STEP * np.exp(logs)
    side = side_traction(logs, nu)
    twice = (side * weights) @ side
    return side, np.linalg.solve(np.eye(len(logs)) - twice * weights, twice)


def _side_compliance(logs: Array, nu: float) -> Array:
    """Return (G + G')(1 − A²)⁻¹ − G at k = 1, at distances exp(logs), for E* = 1.

    The logarithmic singularity of G takes its own weight in the trapezoidal rule.
    """
    x = np.exp(logs)
    weights = _LOG_STEP * x
    _, more = _reflections(logs, nu)
    apart = np.abs(np.subtract.outer(x, x))
    np.fill_diagonal(apart, 1.0)
    near = scipy.special.k0(apart)
    np.fill_diagonal(near, -np.log(_LOG_STEP * x / (4.0 * np.pi)) - np.euler_gamma)
    image = scipy.special.k0(np.add.outer(x, x))
    total = 2.0 / np.pi * (image + ((near + image) * weights) @ more)
    return np.asarray(0.5 * (total + total.T))


def _side_stresses(logs: Array, nu: float) -> Array:
    """Return the stresses at k = 1, at distances exp(logs), shape (3, n, n)."""
    weights = _LOG_STEP * np.exp(logs)
    side, more = _reflections(logs, nu)
    pressed = side + (side * weights) @ more  # −q by p
    even, odd = ((0.5 - nu) * part for part in _decays(logs, more))
    own = np.stack([-more + even, -2.0 * nu * more - even, odd])
    return np.asarray(own - (side_pressure_stresses(logs, nu) * weights) @ pressed)


def _decays(logs: Array, more: Array) -> tuple[Array, Array]:
    """Integrate exp(−|x − x'|) over p̃ − p and the images of p̃, once times sign(x − x').

    The trapezoidal rule in log x accounts for the bend and for the jump at x' = x by the first term
    of the Euler-Maclaurin formula.
    """
    x = np.exp(logs)
    apart, weights = np.subtract.outer(x, x), _LOG_STEP * x
    near = np.exp(-np.abs(apart)) * weights
    image = np.exp(-np.add.outer(x, x))
    imaged = image + (image * weights) @ more
    bend = weights[:, None] ** 2 / 6.0 * more
    jump = _LOG_STEP / 6.0 * np.gradient(x[:, None] * more, axis=0)
    return imaged + near @ more - bend, imaged + (np.sign(apart) * near) @ more - jump


def side_traction(logs: Array, poisson_ratio: float) -> Array:
    """Return A(z, x) at k = 1, compression positive, shape (n, n).

    Args:
        logs: Logarithms of depths and distances, ascending, shape (n,).
        poisson_ratio: ν.
    """
    x, of = np.exp(logs), _radial_functions(logs.tobytes())
    direct = x[:, None] * x**2 * of.k2 / of.rho**2
    return np.asarray(2.0 / np.pi * (direct - (1.0 - 2.0 * poisson_ratio) * of.below))


def side_pressure_stresses(logs: Array, poisson_ratio: float) -> Array:
    """Return σ_xx, σ_yy and σ_xy in the top by pressures on the side, at k = 1, shape (3, n, n).

    Args:
        logs: Logarithms of distances on the top and of depths on the side, which come last, (n,).
        poisson_ratio: ν.
    """
    x, of = np.exp(logs)[:, None], _radial_functions(logs.tobytes())
    xx = -(x**3) * of.k2 / of.rho**2
    along = x * of.k0 - 2.0 * poisson_ratio * x * of.k1 / of.rho
    yy = along - (1.0 - 2.0 * poisson_ratio) * of.below
    return 2.0 / np.pi * np.stack([xx, yy, -(x**2) * of.k1 / of.rho])


class _RadialFunctions(NamedTuple):
    """Functions of ρ = √(x² + z²) at k = 1, at depths z and distances x of a table, (n, n) each.

    Attributes:
        rho: ρ.
        k0: K₀(ρ).
        k1: K₁(ρ).
        k2: K₂(ρ).
        below: ∫_z^∞ K₀(√(x² + s²)) ds.
    """

    rho: Array
    k0: Array
    k1: Array
    k2: Array
    below: Array


@lru_cache(maxsize=1)
def _radial_functions(logs: bytes) -> _RadialFunctions:
    """Return the functions at depths and distances exp(logs), of which the bytes are given."""
    places = np.frombuffer(logs)
    x = np.exp(places)
    rho = np.hypot.outer(x, x)
    k_0, k_1 = scipy.special.k0(rho), scipy.special.k1(rho)
    below = scipy.interpolate.make_interp_spline(places, k_0 * x[:, None]).antiderivative()
    integral = np.asarray(below(places[-1]) - below(places))
    return _RadialFunctions(rho, k_0, k_1, k_0 + 2.0 / rho * k_1, integral)


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
            way too. Displacements are those for pressures over E* of the contact; with this share
            over E*, those for the pressures [mm].
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
        return self.share * side_compliance(nu, distances, numbers)

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
        nu, numbers = self.poisson_ratio, self._wave_numbers(axis, waves, 2.0 * self.decay_length)
        parts = side_stresses(nu, distances, numbers)
        full = np.pi * waves / self.lengths[1 - axis]
        for share, number in ((0.5 - nu, numbers), (nu - 0.5, full)):
            falling = np.exp(-np.multiply.outer(number, distances))[:, :, None]
            rest = share * number[:, None, None] * falling * falling.transpose(0, 2, 1)
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
