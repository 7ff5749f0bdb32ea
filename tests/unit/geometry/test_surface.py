import pickle
from dataclasses import replace

import numpy as np
import pytest

from patchlaw import InputError
from patchlaw.geometry import Surface


def plane(nx=8, ny=6, lengths=(2.0, 3.0), **options):
    surface = Surface(heights=np.zeros((nx, ny)), lengths=lengths)
    x, y = np.meshgrid(surface.x, surface.y, indexing="ij")
    return Surface(heights=1.0 + 2.0 * x - 3.0 * y, lengths=lengths, **options)


def test_samples_lie_at_cell_centres():
    surface = plane()
    assert surface.grid == (8, 6)
    assert surface.spacing == (0.25, 0.5)
    assert surface.area == 6.0
    assert surface.x[0] == 0.125 and surface.x[-1] == 1.875
    assert surface.y[0] == 0.25 and surface.y[-1] == 2.75
    # the mean of a plane is its value in the middle, to rounding
    assert surface.mean_height == pytest.approx(1.0 + 2.0 - 4.5, abs=1e-14)


def test_heights_are_a_read_only_copy():
    heights = np.zeros((4, 4))
    surface = Surface(heights=heights, lengths=(1, 1))
    heights[0, 0] = 1.0
    assert surface.heights[0, 0] == 0.0
    assert surface.lengths == (1.0, 1.0) and isinstance(surface.lengths[0], float)
    with pytest.raises(ValueError, match="read-only"):
        surface.heights[0, 0] = 2.0


def test_whole_numbers_are_accepted_as_heights():
    surface = Surface(heights=np.eye(4, dtype=np.int16), lengths=(1.0, 1.0))
    assert surface.heights.dtype == np.float64


@pytest.mark.parametrize(
    ("heights", "message"),
    [
        (np.zeros((1, 9)), r"\(1, 9\): a surface needs at least 4 × 4 heights"),
        (np.zeros(16), r"\(16,\): a surface needs at least 4 × 4 heights"),
        (np.zeros((4, 4, 1)), "a surface needs at least 4 × 4 heights"),
        (np.zeros((4, 4), dtype=complex), "not an array of real numbers"),
        ([[1.0, 2.0], [3.0]], "not an array of numbers: its rows differ"),
        ([["a"] * 4] * 4, "not an array of real numbers"),
    ],
)
def test_heights_that_are_no_surface_are_refused(heights, message):
    with pytest.raises(InputError, match=message):
        Surface(heights=heights, lengths=(1.0, 1.0))


def test_heights_that_are_not_finite_are_counted_and_located():
    heights = np.zeros((5, 4))
    heights[2, 3], heights[4, 0] = np.nan, np.inf
    with pytest.raises(InputError, match=r"2 of 20 heights are masked, not finite.*index \(2, 3\)"):
        Surface(heights=heights, lengths=(1.0, 1.0))


def test_points_outside_are_refused_with_their_number():
    with pytest.raises(InputError, match=r"2\.5: 1 points lie outside the surface.*≤ x ≤ 2\.0"):
        plane().height_at([0.0, 2.5], 1.0)
    with pytest.raises(InputError, match="≤ y ≤"):
        plane().interpolant(1.0, -1e-9, dx=1)
    with pytest.raises(InputError, match="outside"):
        plane().height_at(np.nan, 1.0)


def test_evaluation_broadcasts():
    surface = plane()
    assert surface.height_at(np.zeros((3, 1)), np.zeros(4)).shape == (3, 4)
    assert surface.interpolant(np.zeros((3, 1)), np.zeros(4), dx=1).shape == (3, 4)
    assert surface.height_at(1.0, 1.0).shape == ()
    assert surface.height_at([], []).shape == (0,)


@pytest.mark.parametrize("order", [0, 1, 2])
def test_detrending_removes_exactly_its_polynomials(order):
    rng = np.random.default_rng(1)
    surface = Surface(heights=rng.normal(size=(9, 12)), lengths=(2.0, 3.0))
    x, y = np.meshgrid(surface.x, surface.y, indexing="ij")
    terms = [x**i * y**j for i in range(order + 1) for j in range(order + 1 - i)]
    trend = sum((k + 1.0) * term for k, term in enumerate(terms))
    tilted = Surface(heights=surface.heights + trend, lengths=surface.lengths)
    flat = tilted.detrended(order)
    # a least-squares residual does not see the trend and is orthogonal to it, to rounding
    np.testing.assert_allclose(flat.heights, surface.detrended(order).heights, atol=1e-12)
    for term in terms:  # heights of 1e2 times terms of up to 9, rounded to 2e-16
        assert np.mean(flat.heights * term) == pytest.approx(0.0, abs=1e-12)


def test_detrending_beyond_the_mean_ends_periodicity():
    surface = plane(periodic=True)
    assert surface.detrended(0).periodic
    assert not surface.detrended(1).periodic
    with pytest.raises(InputError, match=r"3: this order of detrending.*0, 1, 2"):
        surface.detrended(3)


@pytest.mark.parametrize("periodic", [False, True])
def test_a_piece_takes_the_interpolant_of_the_whole(periodic):
    heights = np.random.default_rng(3).normal(size=(9, 12))
    surface = Surface(heights=heights, lengths=(2.0, 3.0), periodic=periodic)
    part = surface.piece((0.5, 1.7), (1.0, 3.0))
    assert part.lengths == (pytest.approx(1.2), 2.0) and not part.periodic
    assert part.grid == (6, 8)  # 5.4 cells of 0.222 mm make 6 smaller ones
    x, y = np.linspace(0.0, part.lengths[0], 41)[:, None], np.linspace(0.0, 2.0, 41)
    np.testing.assert_allclose(  # the same spline at places that differ by rounding
        part.height_at(x, y), surface.height_at(x + 0.5, y + 1.0), atol=1e-12
    )
    np.testing.assert_allclose(part.heights, part.height_at(part.x[:, None], part.y), atol=1e-12)
    dense = part.height_at(x, y)
    assert dense.max() <= part.highest < dense.max() + 0.05 * np.ptp(heights)
    assert part.height_at(*part.highest_point) == pytest.approx(part.highest, abs=1e-12)
    inner = part.piece((0.2, 0.7), (0.5, 1.0))
    assert inner.height_at(0.1, 0.3) == pytest.approx(surface.height_at(0.8, 1.8), abs=1e-12)


def test_pieces_hold_the_highest_point_and_none_above_it():
    for seed in range(20):
        heights = np.random.default_rng(seed).normal(size=(8, 8))
        surface = Surface(heights=heights, lengths=(1.0, 1.0))
        edges = np.linspace(0.0, 1.0, 4)
        tops = [
            surface.piece(edges[i : i + 2], edges[j : j + 2]).highest
            for i in range(3)
            for j in range(3)
        ]
        assert max(tops) == pytest.approx(surface.highest, abs=1e-12)  # of the climb


def test_whole_cells_of_a_piece_keep_their_heights():
    heights = np.random.default_rng(3).normal(size=(10, 12))
    surface = Surface(heights=heights, lengths=(1.0, 1.2))
    part = surface.piece((0.3, 0.7), (0.6, 1.2))
    assert part.grid == (4, 6)
    np.testing.assert_allclose(part.heights, heights[3:7, 6:], atol=1e-12)
    assert surface.piece((0.3, 0.4), (0.6, 1.2)).grid == (4, 6)  # one cell becomes four
    raised = replace(part, heights=part.heights + 1.0)
    assert raised.highest > part.highest + 0.5  # an interpolant of its own


@pytest.mark.parametrize("interval", [(1.0, 1.0), (1.5, 1.0), (-1e-3, 1.0), (0.0, 2.001)])
def test_a_piece_must_lie_within(interval):
    with pytest.raises(
        InputError,
        match=r"piece along x does not lie within the surface or is empty.*0 ≤ lo < hi ≤ 2\.0 mm",
    ):
        plane().piece(interval, (0.0, 3.0))
    assert plane().piece((-1e-12, 1.0), (0.0, 3.0)).lengths == (1.0, 3.0)


def test_shift_moves_the_interpolant_of_a_periodic_surface():
    rng = np.random.default_rng(2)
    surface = Surface(heights=rng.normal(size=(8, 6)), lengths=(2.0, 3.0), periodic=True)
    moved = surface.shifted(3, -1)
    assert moved.heights[3, 5] == surface.heights[0, 0]
    x, y = rng.uniform(0.0, 2.0, 20), rng.uniform(0.0, 3.0, 20)
    # the same spline, shifted by whole cells; wrapped padding is exact to 1e-16 per cell of it
    np.testing.assert_allclose(
        moved.height_at(x + 0.75, y - 0.5), surface.height_at(x, y), atol=1e-12
    )
    assert moved.highest == pytest.approx(surface.highest, abs=1e-12)
    with pytest.raises(InputError, match="only a periodic surface can be shifted"):
        plane().shifted(1, 0)


def test_scaling_scales_the_highest_point():
    surface = plane()
    assert surface.scaled(0.5).highest == pytest.approx(0.5 * surface.highest, rel=1e-14)
    assert surface.scaled(0.5).source == surface.source


def test_a_surface_survives_pickling():
    surface = plane()
    highest = surface.highest
    copy = pickle.loads(pickle.dumps(surface))
    np.testing.assert_array_equal(copy.heights, surface.heights)
    assert copy.highest == highest and copy.lengths == surface.lengths


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("size", [1e-6, 1.0, 1e9])
def test_rounding_is_no_roughness(order, size):
    x, y = np.meshgrid(np.linspace(0.0, 1.0, 9), np.linspace(0.0, 1.0, 7), indexing="ij")
    plane = Surface(heights=size * (1.0 + 0.3 * x - 0.7 * y), lengths=(1.0, 1.0))
    assert not plane.detrended(order).heights.any()
    rough = Surface(heights=plane.heights + 1e-9 * size * np.cos(9 * x), lengths=(1.0, 1.0))
    assert rough.detrended(order).heights.any()


def test_rounding_makes_no_summits():
    noise = 1.0 + 1e-16 * np.random.default_rng(0).normal(size=(20, 12))
    assert np.ptp(noise) > 0.0
    level = Surface(heights=noise, lengths=(2.0, 0.3))
    assert np.ptp(level.heights) == 0.0
    rough = noise.copy()
    rough[3, 4] += 1e-9
    assert np.ptp(Surface(heights=rough, lengths=(2.0, 0.3)).heights) > 5e-10
