"""Summits of a surface: maxima of cells and interpolant, and what becomes an asperity."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from patchlaw import InputError
from patchlaw.geometry import Asperities, Spectrum, Surface, find_asperities, synthesise
from patchlaw.geometry.asperities import (
    coincident,
    constrained_summits,
    grid_maxima,
    slopes_and_curvatures,
)


def sampled(function, grid=(24, 30), lengths=(1.2, 1.5), periodic=False):
    blank = Surface(heights=np.zeros(grid), lengths=lengths)
    x, y = np.meshgrid(blank.x, blank.y, indexing="ij")
    return Surface(heights=function(x, y), lengths=lengths, periodic=periodic)


def paraboloid(x, y, *, place=(0.537, 0.811), radii=(0.8, 0.3), angle=0.7, top=2.0):
    u = np.cos(angle) * (x - place[0]) + np.sin(angle) * (y - place[1])
    v = -np.sin(angle) * (x - place[0]) + np.cos(angle) * (y - place[1])
    return top - u**2 / (2.0 * radii[0]) - v**2 / (2.0 * radii[1])


@pytest.mark.parametrize("angle", [0.0, 0.7, np.pi / 2, 2.0, 3.1])
@pytest.mark.parametrize("slope", [(0.0, 0.0), (0.11, -0.07)])
def test_tilted_elliptic_paraboloid(angle, slope):
    surface = sampled(lambda x, y: paraboloid(x, y, angle=angle) + slope[0] * x + slope[1] * y)
    asperities = find_asperities(surface)
    # a plane moves the summit by R·slope along the principal directions and keeps the radii;
    # the spline and the differences are exact for quadratics, so all is exact to rounding,
    # which the Hessian amplifies by 1/dx² = 400
    slope = np.array(slope)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    shift = turn @ (np.array([0.8, 0.3]) * (turn.T @ slope))
    place = np.array([0.537, 0.811]) + shift
    top = 2.0 + slope @ place - 0.5 * slope @ shift
    assert len(asperities) == asperities.count == 1 and asperities.rejected == 0
    assert [asperities.x[0], asperities.y[0]] == pytest.approx(place, abs=1e-11)
    assert asperities.z[0] == pytest.approx(top, abs=1e-12)
    assert asperities.radius_major[0] == pytest.approx(0.8, rel=1e-9)
    assert asperities.radius_minor[0] == pytest.approx(0.3, rel=1e-9)
    assert asperities.radius[0] == pytest.approx(np.sqrt(0.24), rel=1e-9)
    turned = asperities.angle[0] - angle
    assert np.sin(turned) == pytest.approx(0.0, abs=1e-9)  # a direction, modulo π
    assert 0.0 <= asperities.angle[0] < np.pi
    assert asperities.highest == pytest.approx(top, abs=1e-12)
    assert asperities.mean_height == surface.mean_height


def test_border_maxima_are_reported_and_not_used():
    surface = sampled(lambda x, y: paraboloid(x, y, place=(-0.1, 0.8)))
    asperities = find_asperities(surface)
    assert len(asperities) == 0 and len(asperities.border_x) == 1
    assert asperities.border_x[0] == surface.x[0]
    column = surface.heights[0]
    assert asperities.border_y[0] == surface.y[np.argmax(column)]
    assert asperities.border_z[0] == column.max()


def test_a_summit_in_the_first_inner_cell_keeps_its_differences_inside():
    # the summit lies 1.2 cells from the border, the stencil needs one more cell on each side
    place = (0.06, 0.8)
    asperities = find_asperities(sampled(lambda x, y: paraboloid(x, y, place=place)))
    assert [asperities.x[0], asperities.y[0]] == pytest.approx(place, abs=1e-11)
    assert asperities.radius_minor[0] == pytest.approx(0.3, rel=1e-9)  # constant curvature


def test_differences_stay_inside_where_a_ridge_ends_at_the_border():
    # the highest sample of a narrow oblique ridge is an inner one, the summit 0.8 cells from
    # the border: the stencil moves inwards, which a constant curvature does not feel
    place = (0.0393549, 0.7619685)
    ridge = sampled(
        lambda x, y: paraboloid(x, y, place=place, radii=(0.8, 0.0314726), angle=0.2639)
    )
    asperities = find_asperities(ridge)
    assert [asperities.x[0], asperities.y[0]] == pytest.approx(place, abs=1e-10)
    assert asperities.radius_major[0] == pytest.approx(0.8, rel=1e-8)
    assert asperities.radius_minor[0] == pytest.approx(0.0314726, rel=1e-8)


def egg_box(x, y, shift=(0.0, 0.0)):
    return np.cos(2 * np.pi * 2 * (x - shift[0])) * np.cos(2 * np.pi * 3 * (y - shift[1]))


def test_the_border_ends_the_search_also_of_a_periodic_surface():
    surface = sampled(egg_box, grid=(64, 64), lengths=(1.0, 1.0), periodic=True)
    asperities = find_asperities(surface)
    # of 12 summits a period those at x = 0 or y = 0 are cut
    i, j = np.divmod(np.arange(24), 6)
    inside = ((i + j) % 2 == 0) & (i > 0) & (j > 0)
    expected = np.stack([i[inside] / 4, j[inside] / 6], axis=1)
    found = np.stack([asperities.x, asperities.y], axis=1)
    assert len(found) == len(expected) == 8 and len(asperities.border_x) > 0
    # 21 samples per wave: a thousandth of a cell, which falls with the third power of its size
    apart = np.abs(found[:, None] - expected[None]).max(axis=2)
    assert np.all(apart.min(axis=0) < 1e-3 / 64)
    # central differences over one cell flatten a cosine by (Q dx)²/12 = 0.7 % at 21 samples
    np.testing.assert_allclose(asperities.radius_minor, 1 / (6 * np.pi) ** 2, rtol=0.008)
    np.testing.assert_allclose(asperities.radius_major, 1 / (4 * np.pi) ** 2, rtol=0.004)
    np.testing.assert_allclose(np.abs(np.cos(asperities.angle)), 1.0, atol=1e-9)


def test_maxima_without_two_positive_radii_are_counted():
    # a ridge has a plateau of equal cells along it and no curvature there; it ends 30 cells from
    # its middle, where nothing is left of what its ends do to the spline
    ridge = sampled(
        lambda x, y: -((x - 0.525) ** 2) - np.maximum(np.abs(y - 2.0) - 1.5, 0.0),
        grid=(24, 80),
        lengths=(1.2, 4.0),
    )
    asperities = find_asperities(ridge)
    assert len(asperities) == 0 and asperities.rejected == 1


@pytest.mark.parametrize("periodic", [True, False])
def test_flat_surfaces_have_no_asperities(periodic):
    flat = sampled(lambda x, y: 0.0 * x, periodic=periodic)
    assert len(find_asperities(flat)) == 0


def test_refinement_ends_on_summits_each_its_own():
    # on white noise, Newton's worst case, 7 % of the iterations leave the concave neighbourhood
    # and a few go further than a cell
    heights = np.random.default_rng(2).normal(size=(150, 150))
    surface = Surface(heights=heights, lengths=(150.0, 150.0))
    maxima, asperities = grid_maxima(heights), find_asperities(surface)
    inside = maxima.position[~maxima.on_border]
    assert len(asperities) + asperities.rejected == len(inside)
    slopes, _ = slopes_and_curvatures(surface, np.stack([asperities.x, asperities.y], axis=1))
    assert np.abs(slopes).max() < 1e-8  # heights and cells are of order 1
    tree = cKDTree(inside + 0.5)
    found = np.stack([asperities.x, asperities.y], axis=1)
    distance, own = tree.query(found, p=np.inf)
    assert np.all(distance <= 1.5) and len(np.unique(own)) == len(own)
    assert np.all(
        asperities.z >= maxima.height[~maxima.on_border][own] - 1e-12
    )  # rounding of the spline


def test_cells_of_one_to_ten_make_no_summits_of_ridges():
    """Samples on ridges oblique to such cells are higher than their 8 neighbours."""
    spectrum = Spectrum(hurst=0.95, waves=(2, 10), rms_slope=0.2, seed=1)
    flat, square = (
        synthesise(spectrum, grid=grid, lengths=(1.0, 1.0)) for grid in ((48, 480), (256, 256))
    )
    asperities, others = find_asperities(flat), find_asperities(square)
    # as smooth as a wave of 4.8 cells lets a spline be: slopes of 0.2
    slopes, _ = slopes_and_curvatures(flat, np.stack([asperities.x, asperities.y], axis=1))
    assert np.abs(slopes).max() < 1e-9
    assert abs(len(asperities) - len(others)) <= 2  # shallow ones; ridges made 8 more
    assert asperities.rejected > others.rejected


def test_a_ridge_to_the_border_is_no_summit_inside():
    ridge = sampled(lambda x, y: 0.01 * x - 20.0 * (y - 0.4 - 0.37 * x) ** 2)
    inside = ~grid_maxima(ridge.heights).on_border
    asperities = find_asperities(ridge)
    assert len(asperities) == 0 and asperities.rejected == np.count_nonzero(inside) > 3


def summits(**change):
    fields = {
        "x": [0.1, 0.2],
        "y": [0.3, 0.4],
        "z": [1.0, 2.0],
        "radius_major": [2.0, 3.0],
        "radius_minor": [1.0, 3.0],
        "angle": [0.0, 1.0],
    }
    return Asperities(**{**fields, "lengths": (1, 1), "highest": 2.0, "mean_height": 0.0, **change})


def test_subsets_keep_what_belongs_to_the_surface():
    whole = summits(border_x=[0.0], border_y=[0.5], border_z=[0.7], rejected=3)
    for mask in ([False, True], np.array([1])):
        part = whole.subset(mask)
        assert len(part) == 1 and part.z.tolist() == [2.0] and part.radius.tolist() == [3.0]
        assert part.border_z.tolist() == [0.7] and part.rejected == 3 and part.highest == 2.0
    assert len(whole.subset([False, False])) == 0
    assert not whole.x.flags.writeable


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"x": [0.1]}, "the asperities' arrays differ in shape"),
        ({"border_x": [0.1]}, "the asperities' arrays differ in shape"),
        ({"angle": [[0.0], [1.0]]}, "the asperities' arrays differ in shape"),
        ({"radius_minor": [1.0, 4.0]}, "principal radii are not R' ≥ R'' > 0"),
        ({"radius_minor": [0.0, 1.0]}, "principal radii are not R' ≥ R'' > 0"),
        ({"radius_major": [np.nan, 4.0]}, "nan: radius_major of 1 asperities is not finite, the"),
        ({"lengths": (0.0, 1.0)}, "lengths = .*; 0.0 must be greater"),
    ],
)
def test_asperities_that_make_no_sense_are_refused(change, message):
    with pytest.raises(InputError, match=message):
        summits(**change)


N = 20


def dome(cx, cy):
    x = (np.arange(N) + 0.5) / N
    return Surface(heights=-((x[:, None] - cx) ** 2) - 2 * (x - cy) ** 2, lengths=(1.0, 1.0))


@pytest.mark.parametrize(
    ("centre", "expected"),
    [
        ((0.52, 0.48), (0.52, 0.48)),  # inside
        ((-0.3, 0.48), (0.0, 0.48)),  # falls from the edge inward: maximum along the edge
        ((0.52, 1.4), (0.52, 1.0)),
        ((-0.3, 1.4), (0.0, 1.0)),  # corner
    ],
)
def test_quadratic_is_climbed_exactly(centre, expected):
    start = np.clip(np.floor(np.array(expected) * N), 0, N - 1)
    found = constrained_summits(dome(*centre), (start[None] + 0.5) / N)
    assert found[0] == pytest.approx(expected, abs=1e-12)  # the spline is the quadratic


def test_convex_flank_ends_on_the_edge():
    x = (np.arange(N) + 0.5) / N
    ridge = Surface(heights=(x[:, None] - 0.9) ** 2 - (x - 0.5) ** 2, lengths=(1.0, 1.0))
    assert constrained_summits(ridge, np.array([[0.025, 0.525]]))[0] == pytest.approx(
        (0.0, 0.5), abs=1e-12
    )


def test_stays_where_nothing_is_gained():
    x = (np.arange(N) + 0.5) / N
    saddle = Surface(heights=(x[:, None] - 0.5) ** 2 - (x - 0.5) ** 2, lengths=(1.0, 1.0))
    start = np.array([[0.5, 0.5]])
    assert constrained_summits(saddle, start) == pytest.approx(start)
    flat = Surface(heights=np.full((N, N), 3.0), lengths=(1.0, 1.0))
    assert constrained_summits(flat, start) == pytest.approx(start)
    assert constrained_summits(flat, np.empty((0, 2))).shape == (0, 2)


def test_climbs_slopes_and_oblique_ridges_to_their_end():
    """Samples on such a ridge are higher than their neighbours, many cells from the summit."""
    x = (np.arange(N) + 0.5) / N
    slope = Surface(heights=np.add.outer(x, x), lengths=(1.0, 1.0))
    assert constrained_summits(slope, np.array([[0.5, 0.5]]))[0] == pytest.approx((1.0, 1.0))
    u, v = np.add.outer(x, -x), np.add.outer(x, x) - 1.04
    ridge = Surface(heights=-10.0 * (u - 0.1) ** 2 - 0.01 * v**2, lengths=(1.0, 1.0))
    starts = np.array([[0.225, 0.125], [0.875, 0.775]])
    found = constrained_summits(ridge, starts)
    np.testing.assert_allclose(found, 2 * [[0.57, 0.47]], atol=1e-10)
    assert len(np.unique(coincident(ridge, found))) == 1
    assert len(np.unique(coincident(ridge, starts))) == 2


def flooded(heights):
    """Flood every plateau and look at all its neighbours: slow and obviously right."""
    nx, ny = heights.shape
    seen, found = set(), []

    def around(cell):
        for di in (-1, 0, 1):
            for dj in (-1, 0, 1):
                i, j = cell[0] + di, cell[1] + dj
                if 0 <= i < nx and 0 <= j < ny:
                    yield i, j

    for start in np.ndindex(nx, ny):
        if start in seen:
            continue
        plateau, todo, highest = {start}, [start], True
        while todo:
            for other in around(todo.pop()):
                if heights[other] > heights[start]:
                    highest = False
                if heights[other] == heights[start] and other not in plateau:
                    plateau.add(other)
                    todo.append(other)
        seen |= plateau
        edge = any(i in (0, nx - 1) or j in (0, ny - 1) for i, j in plateau)
        if highest:
            found.append((start, len(plateau), edge))
    return found


@pytest.mark.parametrize("levels", [2, 3, 6, 1000])
@pytest.mark.parametrize("seed", range(3))
def test_maxima_and_plateaus_against_flooding(levels, seed):
    heights = np.random.default_rng(seed).integers(0, levels, (11, 8)).astype(float)
    expected = flooded(heights)
    maxima = grid_maxima(heights)
    assert len(maxima.height) == len(expected) > 0
    np.testing.assert_array_equal(maxima.height, [heights[start] for start, _, _ in expected])
    np.testing.assert_array_equal(maxima.on_border, [edge for _, _, edge in expected])
    alone = np.array([size == 1 for _, size, _ in expected])
    cells = np.array([start for start, _, _ in expected])
    np.testing.assert_array_equal(maxima.position[alone], cells[alone])


def test_a_plateau_counts_once_in_its_middle():
    heights = np.zeros((8, 9))
    heights[2:4, 3:6] = 1.0
    maxima = grid_maxima(heights)
    np.testing.assert_allclose(maxima.position, [[2.5, 4.0]])


def test_a_shoulder_is_no_maximum():
    heights = np.zeros((7, 7))
    heights[2:5, 2:5] = 1.0
    heights[4, 5] = 2.0  # touches the plateau's corner only
    assert grid_maxima(heights).height.tolist() == [2.0]


def test_a_flat_map_is_one_plateau():
    maxima = grid_maxima(np.zeros((6, 5)))
    assert maxima.height.tolist() == [0.0] and maxima.on_border.tolist() == [True]
