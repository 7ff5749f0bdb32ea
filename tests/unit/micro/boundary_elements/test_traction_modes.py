"""Half-spaces under modes of traction: against sums over cells, and what the record refuses."""

import numpy as np
import pytest

from patchlaw.geometry import Material, MaterialPair
from patchlaw.geometry.face_frame import mode_means
from patchlaw.micro import TractionModes, half_space_traction_modes
from patchlaw.micro.friction.tangential_grid import CrossCompliance, TangentialGrid
from patchlaw.support import InputError

LENGTHS, GRID, COUNT = (1.0, 0.7), (96, 64), 3
SPACING = LENGTHS[0] / GRID[0], LENGTHS[1] / GRID[1]


@pytest.fixture(scope="module", params=[0.0, 0.31, 0.49])
def summed(request):
    """Poisson's ratio, and moments of displacements of cells by modes of traction."""
    nu = request.param
    material = Material(young_modulus=1.0 - nu**2, poisson_ratio=nu)  # E* = 1
    grid = TangentialGrid(GRID, SPACING, poisson_ratio=nu, periodic=False)
    cross = CrossCompliance(GRID, SPACING, MaterialPair(first=material), periodic=False)
    along_x, along_y = (
        mode_means(np.linspace(0.0, length, n + 1), length, COUNT)
        for length, n in zip(LENGTHS, GRID, strict=True)
    )
    total = np.zeros((3, 3, COUNT**2, COUNT**2))
    for mode in range(COUNT**2):
        field = np.outer(along_x[mode // COUNT], along_y[mode % COUNT])
        moved = np.zeros((3, 3, *GRID))
        for axis in range(2):
            traction = np.zeros((2, *GRID))
            traction[axis] = field
            moved[:2, axis], moved[2, axis] = grid.displacement(traction), cross.across(traction)
        moved[:2, 2] = cross.sideways(field)
        total[:, :, :, mode] = (along_x @ moved @ along_y.T).reshape(3, 3, -1)
    return nu, total * np.prod(SPACING) / np.prod(LENGTHS) ** 2


def test_moments_are_those_of_cells(summed):
    nu, expected = summed
    found = half_space_traction_modes(LENGTHS, nu, COUNT)
    for axis in range(3):
        for other in range(3):
            if (axis, other) == (2, 2):
                continue
            size = np.abs(found[0, 0]).max()
            # cells see displacements at their centres: an error of first order in their size
            np.testing.assert_allclose(expected[axis, other], found[axis, other], atol=6e-4 * size)
    np.testing.assert_allclose(found, found.transpose(1, 0, 3, 2), atol=1e-13 * found.max())


def test_fewer_modes_are_those_of_fewer():
    many, few = (half_space_traction_modes(LENGTHS, 0.3, count) for count in (4, 2))
    np.testing.assert_allclose(TractionModes(LENGTHS, many).fewer(2).matrix, few, atol=1e-13)


@pytest.mark.parametrize(
    ("matrix", "problem"),
    [
        (np.ones((3, 3, 2, 2)), "not one of K × K modes"),
        (np.arange(81.0).reshape(3, 3, 3, 3)[:, :, :1, :1], "not finite and symmetric"),
        (np.full((3, 3, 1, 1), np.nan), "not finite and symmetric"),
    ],
)
def test_what_is_no_compliance_is_refused(matrix, problem):
    with pytest.raises(InputError, match=problem):
        TractionModes(LENGTHS, matrix)
