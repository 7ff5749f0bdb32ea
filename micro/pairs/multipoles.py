"""The field of an elliptic Hertz contact far from it, as moments of force times powers of 1/r.

A semi-ellipsoidal pressure with force P and semi-axes a, b is (in the sense of its Fourier
transform, 3 (sin κ − κ cos κ)/κ³ with κ² = a² kx² + b² ky²) a series of derivatives of a point
force, so that its displacement is

    U = P/(π E*) Σ_j c_j D^j (1/r),   D = a² ∂²/∂X² + b² ∂²/∂Y²,   c_j = 3 (2j + 2)/(2j + 3)!

D^j (1/r) = a^(2j) r^(−1−2j) T_j with T_j a polynomial of degree j in cos 2φ, φ from the major
axis. Term j is at most 3 (2j + 2)/((2j + 1)(2j + 2)(2j + 3)) (a/r)^(2j) of the first. What depends
on the places alone is thus separated from what changes with the load.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import factorial

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def series_coefficients(terms: int) -> Array:
    """Return c_0 … of the series; 1, 1/10, 1/280, and so on.

    Args:
        terms: How many.
    """
    return np.array([3.0 * (2 * j + 2) / factorial(2 * j + 3) for j in range(terms)])


def angular_polynomials(beta: Array, terms: int) -> list[Array]:
    """Return the coefficients of T_j in cos 2lφ, l = 0 … j, for j = 0 …, each (j + 1, n).

    D/a² is (1 + β)/2 ∇² + (1 − β)/2 (∂²/∂X² − ∂²/∂Y²). On r^(−n) cos mφ the first gives
    (n² − m²) r^(−n−2) cos mφ, the second half of (n − m)(n − m + 2) cos (m − 2)φ and of
    (n + m)(n + m + 2) cos (m + 2)φ.

    Args:
        beta: b²/a² of the contacts, shape (n,).
        terms: How many polynomials.
    """
    mean, half = 0.5 * (1.0 + beta), 0.25 * (1.0 - beta)
    found = [np.ones((1, *beta.shape))]
    for j in range(terms - 1):
        n, old = 1 + 2 * j, found[-1]
        new = np.zeros((j + 2, *beta.shape))
        for order, coefficient in enumerate(old):
            m = 2 * order
            new[order] += mean * (n * n - m * m) * coefficient
            new[abs(order - 1)] += half * (n - m) * (n - m + 2) * coefficient
            new[order + 1] += half * (n + m) * (n + m + 2) * coefficient
        found.append(new)
    return found


def moments(indentation: Array, size: Array, integral: Array, terms: int) -> Array:
    """Return c_j P a^(2j)/(π E*) of every contact, shape (terms, n) [mm^(2 + 2j)].

    P/(π E*) = 2/3 s^(3/2)/(s/t · K).

    Args:
        indentation: Own indentations t ≥ 0, shape (n,) [mm].
        size: s/t, shape (n,) [mm].
        integral: K(e), shape (n,).
        terms: How many.
    """
    s = size * indentation
    leading = 2.0 / 3.0 * s**1.5 / (size * integral)
    return series_coefficients(terms)[:, None] * leading * s ** np.arange(terms)[:, None]


def pair_terms(distance: Array, cosine: Array, polynomials: list[Array]) -> Iterator[Array]:
    """Yield T_j r^(−1−2j) of pairs for j = 0 … [mm^(−1−2j)].

    Args:
        distance: Distances r, shape (m,) or broadcast with the coefficients [mm].
        cosine: cos 2φ of the pairs.
        polynomials: Coefficients in cos 2lφ that broadcast against both.
    """
    inverse, squared = 1.0 / distance, distance**-2.0
    chebyshev = [np.ones_like(cosine), cosine]
    for j, coefficients in enumerate(polynomials):
        while len(chebyshev) <= j:
            chebyshev.append(2.0 * cosine * chebyshev[-1] - chebyshev[-2])
        angular = sum(c * wave for c, wave in zip(coefficients, chebyshev[: j + 1], strict=True))
        yield angular * inverse
        inverse = inverse * squared
