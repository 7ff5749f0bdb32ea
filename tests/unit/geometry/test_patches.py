import numpy as np
import pytest

from patchlaw import InputError
from patchlaw.geometry import PatchGrid, Surface, patch_means

GRIDS = [
    PatchGrid(grid=(4, 4), lengths=(1.0, 1.0)),
    PatchGrid(grid=(3, 7), lengths=(1.0, 2.0), origin=(0.3, -5.0)),
    PatchGrid(grid=(1, 1), lengths=(0.1, 3.0)),
    PatchGrid(grid=(1, 9), lengths=(0.7, 0.7)),
]


def test_sizes_and_places():
    patches = PatchGrid(grid=(2, 4), lengths=(1.0, 1.0), origin=(1.0, 0.0))
    assert (
        patches.count == 8 and patches.size == (0.5, 0.25) and patches.half_sizes == (0.25, 0.125)
    )
    assert patches.area == 0.125
    np.testing.assert_allclose(patches.borders_x, [1.0, 1.5, 2.0])
    np.testing.assert_allclose(patches.borders_y, [0.0, 0.25, 0.5, 0.75, 1.0])
    np.testing.assert_allclose(patches.centres[:3], [[1.25, 0.125], [1.25, 0.375], [1.25, 0.625]])
    assert patches.unravel(5) == (1, 1)
    assert patches.bounds(5) == ((1.5, 2.0), (0.25, 0.5))


@pytest.mark.parametrize("patches", GRIDS)
def test_every_point_is_in_exactly_one_patch(patches):
    rng = np.random.default_rng(0)
    (x0, y0), (lx, ly) = patches.origin, patches.lengths
    x = np.concatenate([x0 + lx * rng.random(200), patches.borders_x, np.full(5, x0 + 0.4 * lx)])
    y = np.resize(np.concatenate([patches.borders_y, y0 + ly * rng.random(150)]), x.shape)
    y = np.clip(y, patches.borders_y[0], patches.borders_y[-1])
    x = np.clip(x, patches.borders_x[0], patches.borders_x[-1])
    index = patches.index_of(x, y)
    holders = np.zeros((len(x), patches.count), dtype=bool)
    for i in range(patches.count):  # one by one: half-open, closed at the far border
        (left, right), (low, high) = patches.bounds(i)
        ix, iy = patches.unravel(i)
        in_x = (x >= left) & ((x < right) | (ix == patches.grid[0] - 1))
        in_y = (y >= low) & ((y < high) | (iy == patches.grid[1] - 1))
        holders[:, i] = in_x & in_y
    assert np.all(holders.sum(axis=1) == 1)
    np.testing.assert_array_equal(index, np.argmax(holders, axis=1))


def test_a_single_patch_keeps_its_place():
    single = GRIDS[1].single(8)
    assert single.grid == (1, 1) and single.count == 1
    assert single.bounds(0) == GRIDS[1].bounds(8)
    assert single.index_of(*GRIDS[1].centres[8]) == 0


def test_points_outside_are_refused():
    with pytest.raises(InputError, match=r"1\.5: 2 points lie outside the patches.*≤ x ≤ 1\.0"):
        GRIDS[0].index_of([0.5, 1.5, 2.0], 0.5)
    with pytest.raises(InputError, match="≤ y ≤"):
        GRIDS[0].index_of(0.5, np.nan)


@pytest.mark.parametrize("i", [-1, 16])
def test_patches_that_do_not_exist_are_refused(i):
    for question in (GRIDS[0].bounds, GRIDS[0].unravel, GRIDS[0].single):
        with pytest.raises(InputError, match=rf"{i}: there is no such patch.*0 … 15"):
            question(i)


@pytest.mark.parametrize("grid", [(1, 1), (2, 5), (3, 4), (7, 11), (30, 1)])
def test_patch_means_share_straddling_cells_by_area(grid):
    heights = np.random.default_rng(1).normal(size=(10, 12))
    surface = Surface(heights=heights, lengths=(1.0, 3.0))
    means = patch_means(surface, PatchGrid(grid=grid, lengths=(1.0, 3.0)))
    # cells cut so finely that every patch holds whole pieces
    pieces = np.kron(heights, np.ones(grid))
    blocks = pieces.reshape(grid[0], heights.shape[0], grid[1], heights.shape[1])
    np.testing.assert_allclose(means, blocks.mean(axis=(1, 3)).ravel(), atol=1e-14)  # rounding
    assert means.mean() == pytest.approx(surface.mean_height, abs=1e-14)


def test_patch_means_of_a_part():
    heights = np.arange(16.0).reshape(4, 4)
    surface = Surface(heights=heights, lengths=(4.0, 4.0))
    part = PatchGrid(grid=(1, 1), lengths=(1.5, 1.0), origin=(2.5, 1.0))
    # half of cell (2, 1) and all of cell (3, 1)
    assert patch_means(surface, part) == pytest.approx([(0.5 * 9 + 13) / 1.5], rel=1e-14)
    with pytest.raises(InputError, match="patches reach beyond the surface along y"):
        patch_means(surface, PatchGrid(grid=(1, 1), lengths=(1.0, 1.0), origin=(0.0, 3.5)))
