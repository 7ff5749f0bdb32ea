"""Asperities, rough surfaces and a slow, independent oracle for the tests of interaction."""

from dataclasses import dataclass

import numpy as np
from scipy.integrate import quad
from scipy.optimize import brentq, root

from patchlaw.geometry import (
    Asperities,
    Material,
    PatchGrid,
    Spectrum,
    find_asperities,
    patch_means,
    synthesise,
)

E_STAR = Material(young_modulus=4000.0, poisson_ratio=0.15).contact_modulus
PATCHES = PatchGrid(grid=(4, 4), lengths=(1.0, 1.0))


def summits(x, y, *, z=0.0, major=0.1, minor=None, angle=0.0, highest=0.0):
    """Build asperities on a square of 1 mm from scalars or arrays; None: the top is the highest."""
    x = np.atleast_1d(np.asarray(x, float))

    def full(value):
        return np.broadcast_to(np.asarray(value, float), x.shape)

    heights = full(z)
    return Asperities(
        x=x,
        y=full(y),
        z=heights,
        radius_major=full(major),
        radius_minor=full(major if minor is None else minor),
        angle=full(angle),
        lengths=(1.0, 1.0),
        highest=float(heights.max(initial=-np.inf) if highest is None else highest),
        mean_height=-0.02,
    )


def set_1(seed, grid=128):
    """Return a surface of the paper's Set 1, its asperities and its patches' mean heights."""
    spectrum = Spectrum(hurst=0.95, waves=(2, 10), rms_slope=0.215, seed=seed)
    surface = synthesise(spectrum, grid=(grid, grid), lengths=(1.0, 1.0))
    return surface, find_asperities(surface), patch_means(surface, PATCHES)


@dataclass
class Paraboloid:
    """A pressed paraboloid by brute force: nothing of `micro` is used.

    The pressure p0 sqrt(1 − x²/a² − y²/b²) moves the inside by w − x²/2R' − y²/2R''; both
    curvatures follow from integrals over t that `quad` takes (Johnson 1985, eq. 3.41).
    """

    major: float
    minor: float

    def __post_init__(self):
        self.beta = brentq(self._mismatch, 1e-6, 1.0) if self.major > self.minor else 1.0

    def _integral(self, beta, kind):
        # ∫ dt / (((1 + t)(β + t) t)^½ · kind), t = (τ/(1 − τ))²
        def integrand(tau):
            t = (tau / (1 - tau)) ** 2
            return 2 / (1 - tau) ** 2 / np.sqrt((1 + t) * (beta + t)) / kind(t)

        return quad(integrand, 0, 1, epsabs=0, epsrel=1e-12)[0]

    def _mismatch(self, beta):
        along = self._integral(beta, lambda t: 1 + t)
        across = self._integral(beta, lambda t: beta + t)
        return across / along - self.major / self.minor

    def contact(self, a):
        """Return own displacement w, p0/E* and b for a major semi-axis."""
        b = a * np.sqrt(self.beta)
        peak = a**2 / (self.major * b * self._integral(self.beta, lambda t: 1 + t))
        return 0.5 * peak * b * self._integral(self.beta, lambda t: 1.0), peak, b

    def field(self, a, x, y):
        """Return the displacement at a point outside, by a product rule over the ellipse."""
        _, peak, b = self.contact(a)
        nodes, weights = np.polynomial.legendre.leggauss(60)
        psi, dpsi = np.pi / 4 * (nodes + 1), np.pi / 4 * weights
        angle = 2 * np.pi * np.arange(240) / 240
        distance = np.hypot(
            x - a * np.sin(psi)[:, None] * np.cos(angle),
            y - b * np.sin(psi)[:, None] * np.sin(angle),
        )
        ring = (1 / distance).mean(axis=1) * 2 * np.pi
        return peak * a * b * np.sum(ring * np.cos(psi) ** 2 * np.sin(psi) * dpsi) / np.pi

    def force(self, a):
        """Return the force over E*."""
        _, peak, b = self.contact(a)
        return 2 / 3 * np.pi * a * b * peak


def oracle(asperities, approach, contacting):
    """Solve for the semi-axes of the given contacts in the paper's own unknowns a_k.

    Returns:
        Forces over E* of all asperities and displacements of all summits.
    """
    bodies = [
        Paraboloid(major, minor)
        for major, minor in zip(asperities.radius_major, asperities.radius_minor, strict=True)
    ]
    required = approach + asperities.z

    def displacements(a):
        total = np.zeros(len(asperities))
        for i, size in zip(contacting, a, strict=True):
            for k in range(len(asperities)):
                apart = asperities.x[k] - asperities.x[i] + 1j * (asperities.y[k] - asperities.y[i])
                local = apart * np.exp(-1j * asperities.angle[i])
                total[k] += (
                    bodies[i].contact(size)[0]
                    if k == i
                    else bodies[i].field(size, local.real, local.imag)
                )
        return total

    start = [
        brentq(lambda a, i=i: bodies[i].contact(a)[0] - 0.7 * required[i], 1e-6, 1.0)
        for i in contacting
    ]
    found = root(lambda a: (displacements(a) - required)[contacting] / approach, start, tol=1e-12)
    assert found.success and np.all(found.x > 0)
    force = np.zeros(len(asperities))
    force[contacting] = [bodies[i].force(a) for i, a in zip(contacting, found.x, strict=True)]
    return force, displacements(found.x)
