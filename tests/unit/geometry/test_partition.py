import numpy as np
import pytest

from geometry import InputError, PatchGrid, Surface, UnevenPartition, patch_means

UNEVEN = UnevenPartition(ticks_x=(0.0, 0.1, 0.5, 1.0), ticks_y=(-1.0, 0.0, 0.25))


def test_sizes_and_places():
    assert UNEVEN.shape == (3, 2) and UNEVEN.count == 6 and UNEVEN.sides == (1.0, 1.25)
    np.testing.assert_allclose(UNEVEN.areas, [0.1, 0.025, 0.4, 0.1, 0.5, 0.125])
    np.testing.assert_allclose(UNEVEN.middle, [0.5, -0.375])
    np.testing.assert_allclose(UNEVEN.centres[3], [0.3, 0.125])
    np.testing.assert_allclose(UNEVEN.half_sides[3], [0.2, 0.125])
    assert UNEVEN.index_of([0.0, 0.1, 1.0], [-1.0, 0.0, 0.25]).tolist() == [0, 3, 5]


def test_even_grid_lines_are_patches():
    patches = PatchGrid(grid=(4, 3), lengths=(1.0, 2.0), origin=(0.5, 0.0))
    same = UnevenPartition(ticks_x=tuple(patches.borders_x), ticks_y=tuple(patches.borders_y))
    for name in ("areas", "middle", "half_sides", "centres"):
        np.testing.assert_allclose(getattr(same, name), getattr(patches, name), rtol=1e-15)
    assert (same.shape, same.sides) == (patches.shape, patches.sides)


def test_means_weighted_by_area_are_the_mean():
    surface = Surface(heights=np.random.default_rng(4).random((12, 9)), lengths=(1.0, 1.0))
    uneven = UnevenPartition(ticks_x=(0.0, 0.03, 0.4, 1.0), ticks_y=(0.0, 0.71, 1.0))
    means = patch_means(surface, uneven)
    assert means @ uneven.areas == pytest.approx(surface.heights.mean(), rel=1e-14)


@pytest.mark.parametrize("ticks", [(0.0,), (0.0, 0.0), (1.0, 0.5), (0.0, np.nan)])
def test_lines_that_do_not_ascend_are_refused(ticks):
    with pytest.raises(InputError, match=r"ticks_y .* the grid lines of a partition must ascend"):
        UnevenPartition(ticks_x=(0.0, 1.0), ticks_y=ticks)
