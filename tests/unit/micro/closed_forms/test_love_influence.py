"""Mean influence of rectangles against high precision, cell sums and each other."""

import mpmath
import numpy as np
import pytest

from patchlaw.geometry import PatchGrid
from patchlaw.micro import influence_matrix
from patchlaw.micro.closed_forms import love_mean, mutual_influence


def _exact(dx, dy, a, b):
    """The closed form with 50 digits, from which nothing cancels."""
    with mpmath.workdps(50):
        dx, dy, a, b = map(mpmath.mpf, (dx, dy, a, b))

        def fourfold(u, v):
            rho = mpmath.sqrt(u * u + v * v)
            logs = u * mpmath.asinh(v / abs(u)) + v * mpmath.asinh(u / abs(v)) if u and v else 0
            return u * v * logs / 2 - rho**3 / 6

        total = sum(
            p * q * fourfold(dx + 2 * i * a, dy + 2 * j * b)
            for i, p in ((-1, 1), (0, -2), (1, 1))
            for j, q in ((-1, 1), (0, -2), (1, 1))
        )
        return float(total / (4 * a * b))


@pytest.mark.parametrize(
    ("a", "b", "error"), [(0.5, 0.5, 1e-12), (0.1, 0.5, 1e-11), (0.5, 0.05, 1e-10)]
)
def test_mutual_influence_at_any_distance(a, b, error):
    for k in (0, 1, 3, 4, 5, 6, 7, 8, 15, 40, 200, 5000):
        for m in (0, 1, 4, 16, 45, 70):
            dx, dy = 2 * a * k, 2 * b * m
            assert mutual_influence(dx, dy, a, b) == pytest.approx(_exact(dx, dy, a, b), rel=error)


def test_matrix_is_symmetric_with_loves_mean_on_the_diagonal():
    patches = PatchGrid(grid=(3, 5), lengths=(1.0, 1.3), origin=(0.2, -0.1))
    influence = influence_matrix(patches)
    assert np.array_equal(influence, influence.T)
    assert np.diag(influence) == pytest.approx(float(love_mean(*patches.half_sizes)), rel=1e-14)
    i, j = 3, 11
    apart = patches.centres[i] - patches.centres[j]
    direct = mutual_influence(*apart, *patches.half_sizes)
    assert influence[i, j] == pytest.approx(direct, rel=1e-12)


def test_finer_patches_sum_up_to_coarser_ones():
    coarse, fine = (PatchGrid(grid=grid, lengths=(1.0, 2.0)) for grid in ((2, 3), (8, 9)))
    owner = coarse.index_of(*fine.centres.T)
    gather = np.equal.outer(np.arange(coarse.count), owner)
    means = gather / gather.sum(axis=1, keepdims=True)
    # the same pressure on all parts; means of the parts' means
    assert means @ influence_matrix(fine) @ gather.T == pytest.approx(
        influence_matrix(coarse), rel=1e-12
    )
