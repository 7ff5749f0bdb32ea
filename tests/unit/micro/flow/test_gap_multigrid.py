"""Multigrid of the cells of gaps, against a factorisation."""

import numpy as np
import pytest
from scipy import ndimage

from patchlaw.micro import gap_iteration, transport
from patchlaw.micro.transport import gap_flows


def channels(shape, seed, closed):
    """Return gaps whose g³ differ by 10¹⁵, with a part of the cells closed at random."""
    rng = np.random.default_rng(seed)
    x, y = (np.linspace(0.0, 6.0, count) for count in shape)
    bumps = np.sin(x[:, None] + rng.random()) * np.cos(1.7 * y + rng.random())
    return 10.0 ** (-2.5 + 2.5 * bumps) * (rng.random(shape) > closed)


def both(gap, monkeypatch, **options):
    """Return flows by multigrid and by a factorisation."""
    found = []
    for most in (0, gap.size):
        monkeypatch.setattr(transport, "_MOST_FACTORISED", most)
        found.append(gap_flows(gap, (1.0, 0.7), **options))
    return zip(*found, strict=True)


@pytest.mark.parametrize("periodic", [True, False])
@pytest.mark.parametrize(
    ("shape", "closed"), [((96, 96), 0.1), ((50, 37), 0.25), ((9, 70), 0.05), ((33, 64), 0.38)]
)
def test_flows_are_those_of_a_factorisation(shape, closed, periodic, monkeypatch):
    """Their errors are of second order in those of pressures, largest in pools off the way."""
    gap = channels(shape, sum(shape), closed)
    for one, other in both(gap, monkeypatch, periodic=periodic):
        assert one.transmissivity == pytest.approx(other.transmissivity, rel=1e-7, abs=0)
        assert one.percolates == other.percolates
        np.testing.assert_array_equal(np.isnan(one.pressure), np.isnan(other.pressure))
        np.testing.assert_allclose(one.pressure, other.pressure, atol=0.02)
        if one.percolates:
            assert one.constriction.place == other.constriction.place
            assert one.constriction.share == pytest.approx(other.constriction.share, rel=1e-3)


def test_a_wall_closes_one_direction_alone(monkeypatch):
    """The fluid stands at the pressure of the side that it comes from."""
    gap = channels((40, 48), 3, 0.0)
    gap[20] = 0.0
    along_x, along_y = both(gap, monkeypatch, periodic=False)
    assert along_x[0].transmissivity == 0.0 == along_x[1].transmissivity
    np.testing.assert_array_equal(along_x[0].pressure, along_x[1].pressure)
    assert along_y[1].transmissivity > 0.0
    assert along_y[0].transmissivity == pytest.approx(along_y[1].transmissivity, rel=1e-7, abs=0)


def test_parallel_plates_let_the_cube_of_their_gap_through(monkeypatch):
    monkeypatch.setattr(transport, "_MOST_FACTORISED", 0)
    for flow in gap_flows(np.full((48, 20), 3e-3), (2.0, 1.0), periodic=True):
        assert flow.hydraulic_gap == pytest.approx(3e-3, rel=1e-9)
        assert flow.flow_factor == pytest.approx(1.0, rel=1e-9)


def test_what_does_not_converge_is_factorised(monkeypatch):
    monkeypatch.setattr(gap_iteration, "_MOST_ITERATIONS", 3)
    for one, other in both(channels((40, 40), 5, 0.1), monkeypatch, periodic=True):
        assert one.transmissivity == other.transmissivity


def test_iterations_that_stand_still_are_no_solution():
    """By the changes of the flow alone they ended at 400,000 times the flow along y."""
    ridges = 10.0 ** np.random.default_rng(8).uniform(-6.0, 0.0, 96)
    along_x, along_y = gap_flows(np.tile(ridges, (128, 1)), (1.0, 1.0), periodic=True)
    assert along_x.transmissivity == pytest.approx((ridges**3).mean(), rel=1e-7, abs=0)
    assert along_y.transmissivity == pytest.approx(1.0 / (ridges**-3.0).mean(), rel=1e-7, abs=0)


def test_pools_at_a_wrong_pressure_are_no_solution(monkeypatch):
    """Iterations stood still so at 0.3 % too much, with an imbalance as large as the flow."""
    heights = ndimage.gaussian_filter(np.random.default_rng(40).normal(size=(48, 72)), 2.0)
    gap = np.maximum(heights / heights.std() + 0.1, 0.0)
    for one, other in both(gap, monkeypatch, tolerance=1e-4):
        assert one.transmissivity == pytest.approx(other.transmissivity, rel=1e-4, abs=0)


def test_what_drowns_in_rounding_is_no_solution(monkeypatch):
    """Iterations balanced by their own account, and stated 0.8 % too much."""
    random = np.random.default_rng(29)
    wide, fine = (
        ndimage.gaussian_filter(random.normal(size=(48, 48)), width, mode="wrap")
        for width in (2.0, 1.0)
    )
    gap = np.where(wide > 0.3 * wide.std(), 1.0, 1e-5) * 10.0 ** (0.5 * fine / fine.std())
    for one, other in both(gap, monkeypatch, periodic=True, tolerance=1e-4):
        assert one.transmissivity == pytest.approx(other.transmissivity, rel=1e-4, abs=0)


def test_slow_maps_end_no_earlier(monkeypatch):
    """When two iterations changed it by little, the flow along x erred by 5 · 10⁻⁷."""
    along_x, _ = both(channels((50, 50), 36, 0.34), monkeypatch, periodic=True)
    assert along_x[0].transmissivity == pytest.approx(along_x[1].transmissivity, rel=1e-8, abs=0)


def test_flows_stay_within_a_looser_tolerance(monkeypatch):
    """Their iterations end earlier then."""
    found = {}
    for allowed in (1e-4, 1e-7):
        found[allowed], exact = zip(
            *both(channels((50, 50), 36, 0.34), monkeypatch, periodic=True, tolerance=allowed),
            strict=True,
        )
        for one, other in zip(found[allowed], exact, strict=True):
            assert one.transmissivity == pytest.approx(other.transmissivity, rel=allowed, abs=0)
    assert found[1e-4][0].transmissivity != found[1e-7][0].transmissivity


def test_sides_that_cannot_be_halved_take_no_more_iterations(monkeypatch):
    """What was added to 97 cells took more than twice as many as chains of 15 cells."""
    monkeypatch.setattr(gap_iteration, "_MOST_ITERATIONS", 16)
    for count in (96, 97, 111):
        gap = channels((count, count), 1, 0.1)
        assert gap_iteration.cell_flows(gap, (1.0, 1.0), (0, 1), periodic=True) is not None


def test_pools_behind_narrow_links_take_no_more_iterations(monkeypatch):
    """Where coarser grids alone stood for pools, these took 53."""
    monkeypatch.setattr(gap_iteration, "_MOST_ITERATIONS", 40)
    random, pitch, count = np.random.default_rng(2), 13, 8
    gap, inside = np.zeros(2 * [pitch * count]), np.arange(pitch * count) % pitch < pitch - 1
    gap[np.ix_(inside, inside)] = random.uniform(0.5, 1.0, 2 * [inside.sum()])
    for i, j in np.ndindex(count, count):
        x, y, (place, other) = pitch * i, pitch * j, random.integers(0, pitch - 1, 2)
        narrow = 10.0 ** random.uniform(-2.0, -0.5, 2)
        gap[x + pitch - 1, y + place], gap[x + other, y + pitch - 1] = narrow
    ((_, found),) = gap_iteration.cell_flows(gap, (1.0, 1.0), (0,), periodic=True)
    monkeypatch.setattr(transport, "_MOST_FACTORISED", gap.size)
    exact = gap_flows(gap, (1.0, 1.0), axes=(0,), periodic=True)[0].total
    assert found == pytest.approx(exact, rel=1e-8, abs=0)


def test_thin_maps_are_factorised(monkeypatch):
    monkeypatch.delattr(gap_iteration, "cell_flows")
    for flow in gap_flows(np.full((3, 4000), 1e-3), (0.003, 4.0), periodic=True):
        assert flow.flow_factor == pytest.approx(1.0, rel=1e-7)
