"""Derivatives of the Legendre modes."""

import numpy as np
from numpy.polynomial import Legendre

from patchlaw.geometry.face_frame import mode_slopes


def test_slopes_are_the_derivatives_of_legendre_polynomials():
    length, x = 2.5, np.linspace(0.0, 2.5, 7)
    found = mode_slopes(x, length, 6)
    for k in range(6):
        mode = Legendre.basis(k, domain=[0.0, length]) * np.sqrt(2.0 * k + 1.0)
        np.testing.assert_allclose(found[k], mode.deriv()(x), rtol=1e-12, atol=1e-12)
