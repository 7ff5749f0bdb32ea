"""Elements of high order along a line: integrals of their shapes over Legendre modes."""

import numpy as np

from patchlaw.geometry.face_frame import mode_values
from patchlaw.macro.compliance.elements import across

LENGTH = 1.2


def places(count):
    """Return the points of the line across the top that has so many."""
    return 0.5 * LENGTH * (1.0 + np.polynomial.legendre.leggauss(count)[0])


def test_mode_integrals_are_exact():
    line, finer = across(LENGTH, 9, 7), across(LENGTH, 40, 7)
    modes = mode_values(places(41), LENGTH, 7) * finer.weights
    # the functions of a degree are among those of a higher one
    for whole, part in (
        (line.modes, modes @ finer.values[:10].T),
        (line.mode_slopes, modes @ finer.slopes[:10].T),
    ):
        np.testing.assert_allclose(whole, part, atol=1e-13 * np.abs(part).max())
