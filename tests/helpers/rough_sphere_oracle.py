"""A rough sphere on a flat, after Greenwood & Tripp 1967: their equations, solved on rings.

Lengths along the face are in units of sqrt(2 R σ), heights in σ, pressures in E* sqrt(σ/8R), with
the radius R of the sphere and the standard deviation σ of the heights of summits. Then

    p(ρ) = μ F(u(ρ)),   u(ρ) = d + ρ² + w(ρ),   T = 2π ∫ ρ p dρ = 8/(3 √2) α^(−3/2),

with F(u) = ∫ (s − u)^(3/2) φ(s) ds of heights s, μ = (8/3) η σ sqrt(2 R β) of η summits of radius β
per area, w the displacement of the half-space, and α = σ R/a² with Hertz' radius a of the smooth
sphere. It is independent of finite elements: the displacement by a ring of uniform pressure is
closed (Johnson 1985, eq. 3.29), and the equations are solved as a whole by Newton's method.

Source: Greenwood & Tripp 1967, J. Appl. Mech. 34, 153; Johnson 1985, section 13.5.
"""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.special import ellipe, ellipk, gamma, pbdv

_FIRST, _LAST = -10.0, 25.0  # separations between which parabolic cylinder functions are taken


def moment(power, u):
    """Return ∫ (s − u)^power φ(s) ds over s > u of Gaussian heights of unit deviation."""
    u = np.asarray(u, float)
    v = np.clip(u, _FIRST, _LAST)
    # Gradshteyn & Ryzhik 3.462.1
    near = gamma(power + 1) / np.sqrt(2 * np.pi) * np.exp(-v * v / 4) * pbdv(-power - 1, v)[0]
    a, n = np.maximum(-u, -_FIRST), power
    far = n * (n - 1) / 2 / a**2 + n * (n - 1) * (n - 2) * (n - 3) / 8 / a**4
    return np.where(u < _FIRST, a**n * (1.0 + far), np.where(u > _LAST, 0.0, near))


@dataclass(frozen=True)
class Heights:
    """Heights of summits: F(u) and its derivative."""

    force: object
    slope: object


def gaussian():
    """Return Gaussian heights, from a fine spline of F^(2/3)."""
    u = np.linspace(-60.0, _LAST, 4001)
    power = CubicSpline(u, moment(1.5, u) ** (2 / 3))
    slope = power.derivative()

    def force(at):
        return np.maximum(power(np.clip(at, u[0], u[-1])), 0.0) ** 1.5

    def rate(at):
        within = np.clip(at, u[0], u[-1])
        return 1.5 * np.sqrt(np.maximum(power(within), 0.0)) * slope(within)

    return Heights(force, rate)


EXPONENTIAL = Heights(
    lambda u: gamma(2.5) * np.exp(-np.asarray(u)), lambda u: -gamma(2.5) * np.exp(-np.asarray(u))
)


@dataclass(frozen=True)
class RoughSphere:
    """The solution on rings.

    Attributes:
        rho: Middle radii of the rings.
        pressure: Pressures on them.
        width: Widths of the rings.
        hertz: Hertz' radius of the smooth sphere under the same load.
        load: T.
        separation: d.
    """

    rho: np.ndarray
    pressure: np.ndarray
    width: np.ndarray
    hertz: float
    load: float
    separation: float

    @property
    def radius(self):
        """Effective radius over Hertz', (3π/4) ∫ ρ p dρ / ∫ p dρ: one where p is Hertz'."""
        force = np.sum(self.rho * self.pressure * self.width)
        return 0.75 * np.pi * force / np.sum(self.pressure * self.width) / self.hertz

    @property
    def peak(self):
        """Pressure in the middle over Hertz'."""
        return self.pressure[0] / (1.5 * self.load / (np.pi * self.hertz**2))

    def strips(self, borders, half):
        """Return forces on strips of a square of sides ±half: between borders along x."""
        x = 0.5 * (borders[1:] + borders[:-1])
        points, weights = np.polynomial.legendre.leggauss(3)
        y = (np.arange(400) + 0.5) / 400 * half
        sides = 0.5 * np.diff(borders)
        forces = np.zeros(len(x))
        for point, weight in zip(points, weights, strict=True):
            r = np.hypot((x + sides * point)[:, None], y)
            line = 2.0 * half * np.interp(r, self.rho, self.pressure).mean(axis=1)
            forces += weight * sides * line
        return forces


def rough_sphere(mu, alpha, heights, rings=400, beyond=4.0):
    """Solve the equations for μ and α on rings that reach beyond Hertz' radius."""
    load = 8.0 / (3.0 * np.sqrt(2.0)) * alpha**-1.5
    hertz = np.sqrt(0.5 / alpha)
    edges = np.linspace(0.0, hertz + beyond, rings + 1)
    rho, width = 0.5 * (edges[1:] + edges[:-1]), np.diff(edges)
    area = np.pi * np.diff(edges**2)
    compliance = _disc(edges[1:], rho[:, None]) - _disc(edges[:-1], rho[:, None])
    u, d = 1.0 + np.maximum(rho**2 - hertz**2, 0.0), 2.0
    for _ in range(100):
        pressure, slope = mu * heights.force(u), mu * heights.slope(u)
        wrong = np.append(u - d - rho**2 - compliance @ pressure, area @ pressure - load)
        tangent = np.zeros((rings + 1, rings + 1))
        tangent[:-1, :-1] = np.eye(rings) - compliance * slope
        tangent[:-1, -1] = -1.0
        tangent[-1, :-1] = area * slope
        step = np.linalg.solve(tangent, -wrong)
        step *= min(1.0, 1.0 / np.abs(step[:-1]).max())
        u, d = u + step[:-1], d + step[-1]
        if np.abs(step).max() < 1e-11:
            return RoughSphere(rho, mu * heights.force(u), width, hertz, load, d)
    raise RuntimeError("the oracle does not converge")


def _disc(radius, rho):
    """Return the displacement at ρ by unit pressure on a disc (Johnson 1985, eq. 3.29)."""
    larger, smaller = np.maximum(radius, rho), np.minimum(radius, rho)
    m = (smaller / larger) ** 2
    outside = ellipe(m) - (1.0 - m) * ellipk(np.minimum(m, 1.0 - 1e-16))
    return 2.0 / np.pi * larger * np.where(rho <= radius, ellipe(m), outside)
