"""Flow through maps of gaps: plates, grooves, symmetries, and multigrid against a factorisation."""

import numpy as np
import pytest
from scipy import ndimage

from patchlaw.micro import gap_iteration, transport
from patchlaw.micro.gap_cells import WidestPath, cell_network
from patchlaw.micro.transport import gap_flow, gap_flows, widened_gap
from patchlaw.support import InputError
from patchlaw.support.network import narrowest_link

LENGTHS = (1.3, 0.7)


def rough(seed=3, shape=(24, 18), closed=0.3):
    """Return gaps that differ by powers of ten from cell to cell, some of them closed."""
    rng = np.random.default_rng(seed)
    return 10.0 ** (-3.0 * rng.random(shape)) * (rng.random(shape) > closed)


@pytest.mark.parametrize("axis", [0, 1])
def test_parallel_plates(axis):
    """Q = W g³ ΔP/(12 η L)."""
    flow = gap_flow(np.full((5, 7), 2e-3), LENGTHS, axis=axis)
    along, across = LENGTHS[axis], LENGTHS[1 - axis]
    expected = across * 2e-3**3 * 0.1 / (12.0 * 1e-9 * along)
    assert flow.rate(0.1, 1e-9) == pytest.approx(expected, rel=1e-12)
    assert flow.rate(-0.1, 1e-9) == pytest.approx(-expected, rel=1e-12)
    assert flow.hydraulic_gap == pytest.approx(2e-3, rel=1e-12)
    assert flow.flow_factor == pytest.approx(1.0, rel=1e-12)
    assert flow.constriction.share == pytest.approx(1.0, rel=1e-12)
    pressure = flow.pressure if axis == 0 else flow.pressure.T
    x = (np.arange(len(pressure)) + 0.5) / len(pressure)
    np.testing.assert_allclose(pressure, np.broadcast_to(1.0 - x[:, None], pressure.shape))


@pytest.mark.parametrize("axis", [0, 1])
def test_grooves_along_and_across_are_exact(axis):
    """Side by side the mean of g³, one behind the other its harmonic mean."""
    groove = 1e-3 * (1.2 + np.sin(np.arange(16.0)))
    along = np.repeat(groove[None], 9, axis=0)  # grooves lie along x
    gap = along if axis == 0 else along.T
    assert gap_flow(gap, LENGTHS, axis=axis).transmissivity == pytest.approx(
        np.mean(groove**3), rel=1e-12
    )
    assert gap_flow(gap, LENGTHS, axis=1 - axis).transmissivity == pytest.approx(
        1.0 / np.mean(groove**-3.0), rel=1e-12
    )


@pytest.mark.parametrize("periodic", [False, True])
def test_both_directions_are_the_same_problem_turned(periodic):
    gap = rough()
    one = gap_flow(gap, LENGTHS, axis=1, periodic=periodic)
    other = gap_flow(gap.T, LENGTHS[::-1], axis=0, periodic=periodic)
    assert one.transmissivity == other.transmissivity > 0.0
    np.testing.assert_array_equal(one.pressure, other.pressure.T)
    for first, second in zip(one.flux, other.flux[::-1], strict=True):
        np.testing.assert_array_equal(first, second.T)
    assert one.constriction.place == other.constriction.place[::-1]
    assert one.constriction.share == other.constriction.share


def test_a_periodic_map_may_be_moved_across_the_flow():
    gap = rough()
    first, moved = (gap_flow(np.roll(gap, by, 1), LENGTHS, periodic=True) for by in (0, 5))
    assert moved.transmissivity == pytest.approx(first.transmissivity, rel=1e-12)
    walled = gap_flow(gap, LENGTHS, periodic=False)
    assert walled.transmissivity < first.transmissivity
    np.testing.assert_allclose(moved.constriction.place[0], first.constriction.place[0], rtol=1e-12)
    assert moved.constriction.share == pytest.approx(first.constriction.share, rel=1e-9)


@pytest.mark.parametrize("axis", [0, 1])
def test_mean_flux_is_the_flow(axis):
    """Whatever the paths, the mean flow per width along is Q/W, and none passes the walls."""
    flow = gap_flow(rough(), LENGTHS, axis=axis)
    assert np.mean(flow.flux[axis]) == pytest.approx(flow.flow_factor, rel=1e-10)
    assert flow.flow_factor == pytest.approx(flow.transmissivity / rough().mean() ** 3, rel=1e-12)


@pytest.mark.parametrize("periodic", [False, True])
@pytest.mark.parametrize("lengths", [(2.0, 1.5), (9.0, 0.5)])
def test_the_narrowest_place_is_that_of_the_network_of_all_cells(lengths, periodic):
    gap = rough(closed=0.2)
    flow = gap_flow(gap, lengths, periodic=periodic)
    net = cell_network(gap**3, lengths, periodic=periodic)
    link = narrowest_link(net.tail, net.head, net.conductance, (net.inlet, net.outlet))
    ends = [one for one in (net.tail[link], net.head[link]) if one < net.count]
    cell = min(ends, key=gap.item)
    place = np.add(np.unravel_index(cell, gap.shape), 0.5) * lengths / gap.shape
    np.testing.assert_allclose(flow.constriction.place, place, rtol=1e-12)
    assert flow.constriction.gap == gap.flat[cell]
    # less than the whole passes, and what the link itself lets through at least
    pressure = np.append(flow.pressure, (1.0, 0.0))
    least = abs(net.conductance[link] * (pressure[net.tail[link]] - pressure[net.head[link]]))
    assert least / flow.total <= flow.constriction.share * (1 + 1e-12) <= 1.0 + 1e-12


@pytest.mark.parametrize("case", ["cell by cell", "smooth", "alike", "between every second cell"])
@pytest.mark.parametrize("axis", [0, 1])
def test_the_narrowest_link_of_a_large_map_is_that_of_a_search_in_all_its_links(axis, case):
    """Whether that on every second cell is near it, far from it, or not there."""
    gap = rough(shape=(90, 110), closed=0.2)
    lengths = (1.0, 3.0) if case == "alike" else (0.9, 1.1)
    if case == "smooth":
        heights = ndimage.gaussian_filter(np.log(gap + 1e-3), 3.0, mode="wrap")
        gap = np.maximum(heights - np.quantile(heights, 0.3), 0.0)
    elif case == "alike":
        gap = np.where(gap > 0.0, 1e-3, 0.0)
    elif case == "between every second cell":
        gap[::2] = gap[:, ::2] = 0.0
        gap[31], gap[:, 47] = 1e-5 + 1e-6 * np.arange(110) ** 0.5, 2e-5
    net = cell_network(gap**3 if axis == 0 else gap.T**3, lengths[:: 1 - 2 * axis], periodic=True)
    link = narrowest_link(net.tail, net.head, net.conductance, (net.inlet, net.outlet))
    (tail, head), found = WidestPath(gap, lengths, axis, periodic=True).narrowest()
    assert found == pytest.approx(net.conductance[link], rel=1e-14)
    if case != "alike":
        inner = [one for one in (net.tail[link], net.head[link]) if one < net.count]
        cells = [one if axis == 0 else one % 90 * 110 + one // 90 for one in inner]
        assert sorted({tail, head} - {net.inlet, net.outlet}) == sorted(cells)
    gap[40], gap[:, 60] = 0.0, 0.0
    assert WidestPath(gap, lengths, axis, periodic=True).narrowest() is None
    assert WidestPath(0.0 * gap, lengths, axis, periodic=True).narrowest() is None


def test_a_closed_line_lets_nothing_through():
    gap = np.full((9, 6), 1e-3)
    gap[4] = 0.0
    flow = gap_flow(gap, LENGTHS)
    assert not flow.percolates
    assert (
        flow.transmissivity == flow.hydraulic_gap == flow.flow_factor == flow.rate(1.0, 1e-9) == 0
    )
    assert flow.constriction is None
    np.testing.assert_array_equal(flow.pressure[:4], 1.0)
    np.testing.assert_array_equal(flow.pressure[5:], 0.0)
    assert np.isnan(flow.pressure[4]).all()
    gap[4, 2] = 1e-8  # a millionth of the others, whose flow no solution of a contact tells
    gap[4, 3] = 1e-11
    assert gap_flow(gap, LENGTHS).percolates
    gap[4, 2] = 0.0
    assert not gap_flow(gap, LENGTHS).percolates
    assert not gap_flow(np.zeros((4, 4)), LENGTHS).percolates


def test_nothing_flows_in_a_pool_that_no_path_leads_to():
    gap = np.ones((12, 12))
    gap[3:9, 3:9] = 0.0
    gap[5:7, 5:7] = 1.0
    flow = gap_flow(gap, (1.0, 1.0))
    assert np.isnan(flow.pressure[5:7, 5:7]).all()
    for part in flow.flux:
        np.testing.assert_array_equal(part[3:9, 3:9], 0.0)
        assert np.isfinite(part).all()


def test_flow_through_two_channels_is_shared_as_their_widths_cubed():
    gap = np.zeros((20, 11))
    gap[:, 2], gap[:, 7] = 1e-3, 0.5e-3
    gap[12, 2] = 0.9e-3  # the narrowest place on the wider one
    flow = gap_flow(gap, (2.0, 1.1))
    found = flow.constriction
    resistance = (19.0 / 1.0 + 1.0 / 0.9**3, 20.0 / 0.5**3)
    assert found.share == pytest.approx(resistance[1] / sum(resistance), rel=1e-10)
    assert found.gap == 0.9e-3
    assert found.place == pytest.approx((1.25, 0.25), rel=1e-12)


def test_wider_gaps_bound_what_flows_between_a_wall_and_the_last_centres_of_cells():
    """Contact leaves 0.4 of a cell free beside the wall y = 0; the truth is on 16² as many."""

    def pinched(cells):
        x, y = ((np.arange(n) + 0.5) / n for n in (cells, cells // 2))
        border = 0.4 / 24 + 4.0 * (x - 0.5) ** 2  # of contact, which gaps leave as the power 3/2
        return 1e-3 * np.maximum(border[:, None] - 0.5 * y, 0.0) ** 1.5

    sides, gap = (1.0, 0.5), pinched(24)
    true = gap_flow(pinched(16 * 24), sides).transmissivity
    assert gap_flow(gap, sides).transmissivity == 0.0 < true
    wider = gap_flow(widened_gap(gap, periodic=False), sides).transmissivity
    assert true <= 1.5 * wider <= 5.0 * true


@pytest.mark.parametrize(
    ("gap", "text"),
    [
        (np.zeros(5), "is no map of gaps"),
        (np.zeros((1, 5)), "is no map of gaps"),
        (np.full((4, 4), np.nan), "finite numbers ≥ 0"),
        (np.full((4, 4), -1e-3), "finite numbers ≥ 0"),
    ],
)
def test_bad_maps(gap, text):
    with pytest.raises(InputError, match=text):
        gap_flow(gap, LENGTHS)


def channels(shape, seed, closed):
    """Return gaps whose g³ differ by 10¹⁵, with a part of the cells closed at random."""
    rng = np.random.default_rng(seed)
    x, y = (np.linspace(0.0, 6.0, count) for count in shape)
    bumps = np.sin(x[:, None] + rng.random()) * np.cos(1.7 * y + rng.random())
    return 10.0 ** (-2.5 + 2.5 * bumps) * (rng.random(shape) > closed)


def both(gap, monkeypatch, **options):
    """Return flows by multigrid, even where factors took less, and by a factorisation."""
    monkeypatch.setattr(gap_iteration, "_MOST_PER_CELL", 9.0)
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


def test_small_maps_take_few_iterations(monkeypatch):
    """Factors take less."""
    gap = channels((50, 50), 36, 0.34)
    assert gap_iteration.cell_flows(gap, (1.0, 1.0), (0,), periodic=True) is None
    monkeypatch.setattr(gap_iteration, "_MOST_PER_CELL", 9.0)
    assert gap_iteration.cell_flows(gap, (1.0, 1.0), (0,), periodic=True) is not None


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


def test_iterations_begin_with_lines_in_series(monkeypatch):
    """From zero, flows across and along ridges took 21 iterations."""
    monkeypatch.setattr(gap_iteration, "_MOST_ITERATIONS", 3)
    ridges = 10.0 ** np.random.default_rng(3).uniform(-1.0, 0.0, 80)
    gap = np.tile(ridges, (100, 1))
    for axis, turned in enumerate((gap.T, gap)):
        found = gap_iteration.cell_flows(turned, (1.0, 1.0), (0, 1), periodic=True)
        assert found[axis][1] == pytest.approx(1.0 / (ridges**-3.0).mean(), rel=1e-9, abs=0)


def test_links_near_zero_do_not_overflow(monkeypatch):
    """A cross of two channels left coarse cells with links of rounding alone."""
    monkeypatch.setattr(transport, "_MOST_FACTORISED", 0)
    gap = np.zeros((17, 16))
    gap[8], gap[:, 5] = 1.0, 0.5
    with np.errstate(over="raise"):
        along_x, along_y = gap_flows(gap, (1.0, 0.7))
    assert along_x.percolates and along_y.percolates


def test_sides_that_cannot_be_halved_take_no_more_iterations(monkeypatch):
    """What was added to 97 cells took more than twice as many as chains of 15 cells."""
    monkeypatch.setattr(gap_iteration, "_MOST_ITERATIONS", 16)
    for count in (96, 97, 111):
        gap = channels((count, count), 1, 0.1)
        assert gap_iteration.cell_flows(gap, (1.0, 1.0), (0, 1), periodic=True) is not None


def test_pools_behind_narrow_links_take_no_more_iterations(monkeypatch):
    """Where coarser grids alone stood for pools, these took 53."""
    monkeypatch.setattr(gap_iteration, "_MOST_ITERATIONS", 40)
    monkeypatch.setattr(gap_iteration, "_MOST_PER_CELL", 9.0)
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
