import re

import numpy as np
import pytest

from patchlaw import InputError
from patchlaw.geometry import Crop, Filter, Preparation, Spectrum, Surface, read_surface, synthesise
from patchlaw.geometry.files.reading import surface_of
from patchlaw.geometry.filters import smoothed, spikes
from patchlaw.geometry.preparation import prepared

X = (np.arange(64) + 0.5) / 64


def rough(seed=1, grid=(64, 64)):
    spectrum = Spectrum(hurst=0.8, waves=(2, 16), rms_slope=0.1, seed=seed)
    return synthesise(spectrum, grid=grid, lengths=(1.0, 1.0))


def saved(tmp_path, heights):
    np.save(tmp_path / "map.npy", heights)
    return tmp_path / "map.npy"


def read(tmp_path, heights, lengths=(1.0, 1.0), **steps):
    return read_surface(saved(tmp_path, heights), lengths=lengths, **steps)


def test_a_map_is_cropped_filled_levelled_filtered_and_resampled(tmp_path):
    heights = rough().heights + 0.3 * X[:, None]
    heights[40, 40] = np.nan
    heights[0, 0] = np.nan  # outside the crop
    surface = read(
        tmp_path,
        heights,
        crop=Crop(x=(0.5, 1.0)),
        missing="fill",
        detrend="plane",
        filter=Filter(short=0.1, long=0.4),
        resample=(16, 32),
    )
    assert surface.grid == (16, 32) and surface.lengths == (0.5, 1.0)
    assert surface.source.removeprefix(f"{tmp_path}/map.npy, ").split(", ") == [
        "heights taken in mm",
        "cropped to 500 × 1000 µm from x = 500 µm",
        "y = 0 µm",
        "its plane removed",
        "waves below 100 µm removed (Gaussian)",
        "waves beyond 400 µm removed (Gaussian)",
        "0.0488 % of the heights missing and filled by a membrane",
        "resampled from 32 × 64 heights",
    ]


def test_crops_are_whole_cells_of_the_map(tmp_path):
    heights = rough().heights
    surface = read(tmp_path, heights, crop=Crop(x=(0.25, 0.5), y=(0.0, 0.51)))
    np.testing.assert_array_equal(surface.heights, heights[16:32, :33])
    assert surface.lengths == pytest.approx((0.25, 33 / 64))
    with pytest.raises(InputError, match=r"surface.crop.x = \(0.5, 1.5\): the crop along x does"):
        read(tmp_path, heights, crop=Crop(x=(0.5, 1.5)))


def test_spikes_are_removed_and_steps_stay(tmp_path):
    clean = rough().heights + 0.02 * (np.abs(X[:, None] - 0.5) < 0.2)
    heights = clean.copy()
    places = ([5, 20, 41], [7, 50, 13])
    heights[places] += (0.03, -0.03, 0.05)
    noted = read(tmp_path, heights)
    assert "3 heights are spikes" in noted.notes[0] and "touches first" in noted.notes[0]
    surface = read(tmp_path, heights, outliers="remove")
    assert "3 spikes removed and filled" in surface.source
    assert len(surface.notes) == 1 and "not resolved" in surface.notes[0]  # the steps
    assert np.count_nonzero(surface.heights != heights) == 3
    # the membrane misses the rough surface by a part of its step from cell to cell
    np.testing.assert_allclose(surface.heights, clean, atol=1e-3)


def test_spikes_of_a_tilted_map_are_noted():
    """Once it is levelled they stand above all others, in the middle of a slope as well."""
    heights = rough().heights + X[:, None]
    heights[30, 20] += 0.1
    (note, *_) = surface_of(heights, lengths=(1.0, 1.0), detrend="plane").notes
    size = float(re.search(r"1 height is a spike.*stands (\S+) µm above all others", note)[1])
    # among a rough surface some 0.02 high
    assert 60.0 < size < 100.0
    assert not any("spikes" in one for one in surface_of(heights, lengths=(1.0, 1.0)).notes)


@pytest.mark.parametrize("hurst", [0.3, 0.8, 1.0])
def test_rough_surfaces_have_no_spikes(hurst):
    spectrum = Spectrum(hurst=hurst, waves=(2, 60), rms_slope=0.3, seed=3)
    surface = synthesise(spectrum, grid=(128, 128), lengths=(1.0, 1.0))
    assert not spikes(surface.heights, surface.spacing).any()


def test_maps_that_users_should_know_more_of(tmp_path):
    heights = rough().heights
    assert read(tmp_path, heights).notes == ()
    (tilted,) = read(tmp_path, heights + 0.1 * X).notes
    assert "the map is tilted" in tilted and "detrend = 'plane'" in tilted
    gaps = heights.copy()
    gaps[10:40, 10:60] = np.nan
    assert "37 % of the heights are missing" in read(tmp_path, gaps, missing="fill").notes[0]
    large, flat = read(tmp_path, heights, lengths=(1e3, 1e3)).notes
    assert "1000 × 1000 mm large" in large and "far less than of machined" in flat
    (smooth,) = read(tmp_path, 1e-6 * heights).notes
    assert "far less than of machined surfaces" in smooth


def test_coordinates_in_the_wrong_unit_are_noted(tmp_path):
    x, y = np.meshgrid(np.arange(64) + 0.5, np.arange(64) + 0.5, indexing="ij")  # µm
    points = np.column_stack((x.ravel(), y.ravel(), (64.0 * rough().heights).ravel()))
    np.savetxt(tmp_path / "scan.xyz", points)
    (flat,) = read_surface(tmp_path / "scan.xyz", height_unit="um").notes
    assert "x and y of an .xyz are taken in mm" in flat
    right = read_surface(tmp_path / "scan.xyz", height_unit="um", lengths=(0.064, 0.064))
    assert right.notes == ()


def test_heights_in_the_wrong_unit_are_asked_about(tmp_path):
    heights = 1e3 * rough().heights  # µm
    with pytest.raises(
        InputError, match=r"gradient of the heights is 100, .*in µm\? .*height_unit = 'u"
    ):
        read(tmp_path, heights)
    surface = read(tmp_path, heights, height_unit="µm")
    np.testing.assert_allclose(surface.heights, rough().heights, rtol=1e-15)
    with pytest.raises(InputError, match="is no unit of heights: 'furlong'"):
        read(tmp_path, heights, height_unit="furlong")


def test_a_prepared_surface_stays_periodic_but_for_its_form():
    surface = prepared(rough(), Preparation(filter=Filter(short=0.1), resample=(32, 32)))
    assert surface.periodic and surface.grid == (32, 32)
    assert not prepared(rough(), Preparation(detrend="plane")).periodic
    assert prepared(rough(), Preparation()).source == rough().source


@pytest.mark.parametrize(
    ("steps", "message"),
    [
        ({"filter": Filter(short=0.01)}, r"filter.short = 0.01: the short cut.*0.03125 to 1 mm"),
        ({"filter": Filter(long=2.0)}, r"filter.long = 2.0: the long cut-off .* does not fit"),
        ({"filter": Filter(short=0.5, long=0.4)}, r"leave no waves .allowed: less than .*, 0.4"),
        ({"resample": (3, 8)}, r"resample = .*; 3 must be greater than or equal to 4"),
    ],
)
def test_steps_that_do_not_fit_are_refused(steps, message):
    with pytest.raises(InputError, match=message):
        prepared(rough(), Preparation(**steps))


def test_surfaces_of_python_are_prepared_alike(tmp_path):
    surface = Surface(heights=rough().heights, lengths=(1.0, 1.0), source="mine")
    done = prepared(surface, Preparation(detrend="quadratic"))
    assert done.source == "mine, its quadratic removed"
    np.testing.assert_array_equal(done.heights, surface.detrended(2).heights)


def drawn_map(rng, kind):
    """Return a rough map and where it is missing: columns, a disc's outside, scattered, a strip."""
    nx, ny = rng.integers(40, 60, 2)
    noise = rng.standard_normal((nx, ny))
    heights = 1e-3 * (smoothed(noise, (1.0, 1.0), 6.0, periodic=True) + 0.02 * noise)
    x, y = np.meshgrid(np.linspace(-1, 1, nx), np.linspace(-1, 1, ny), indexing="ij")
    first, width = rng.integers(0, nx - 10), rng.integers(2, 9)
    missing = {
        "columns": lambda: (
            (np.arange(nx) >= first)[:, None] & (np.arange(nx) < first + width)[:, None] & (y < 2)
        ),
        "border": lambda: x < -1.0 + rng.uniform(0.1, 0.5),
        "outside": lambda: np.hypot(x, y) > 1.0,
        "disc": lambda: np.hypot(x - rng.uniform(-1, 1), y - rng.uniform(-1, 1)) < 0.5,
        "scattered": lambda: rng.random((nx, ny)) < 0.3,
    }[kind]()
    return heights, missing, (x, y)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["columns", "border", "outside", "disc", "scattered"])
@pytest.mark.parametrize("order", ["plane", "quadratic"])
@pytest.mark.parametrize(
    "more",
    [{}, {"outliers": "remove"}, {"filter": Filter(short=0.1)},
     {"outliers": "remove", "filter": Filter(short=0.1, long=0.5), "resample": (24, 31)}],
    ids=["level", "outliers", "short", "all"],
)  # fmt: skip
def test_the_form_of_a_raw_map_changes_no_levelled_result(kind, order, more):
    """Whatever is missing: the form is that of measured heights, before any is invented."""
    rng = np.random.default_rng([len(kind), len(order), len(str(more))])
    for _ in range(3):
        heights, missing, (x, y) = drawn_map(rng, kind)
        spiking = tuple(rng.integers(3, 37, (2, 4)))
        heights[spiking] += rng.choice([-0.02, 0.03], 4)
        form = rng.normal() * x + rng.normal() * y + rng.normal()
        if order == "quadratic":
            form += rng.normal() * x**2 + rng.normal() * x * y + rng.normal() * y**2
        steps = {"lengths": (1.0, 1.3), "missing": "fill", "detrend": order, **more}
        own, other = (
            surface_of(np.where(missing, np.nan, one), **steps)
            for one in (heights, heights + 0.1 * form)
        )
        # rounding of the form, up to 1 mm, some 1e-16 of it in a height and ten times as much
        # in what is solved for between heights
        np.testing.assert_allclose(other.heights, own.heights, rtol=0, atol=1e-14)
        assert other.source == own.source


@pytest.mark.parametrize("order", ["plane", "quadratic"])
def test_what_is_nothing_but_its_form_is_level(order):
    """Eight by eight heights of a plane, two columns missing, left 1.131 µm."""
    u = np.arange(8) - 3.5
    heights = 0.01 * np.add.outer(u, 0.3 * u)
    if order == "quadratic":
        heights += 0.003 * np.multiply.outer(u, u)
    for gaps in (np.s_[:2], np.s_[6:], np.s_[3:5]):
        gappy = heights.copy()
        gappy[gaps] = np.nan
        surface = surface_of(gappy, lengths=(8.0, 8.0), missing="fill", detrend=order)
        np.testing.assert_array_equal(surface.heights, 0.0)


def test_filters_weigh_what_was_measured():
    """Means with the weights of the heights that are known, summed one by one."""
    rng = np.random.default_rng(4)
    heights, spacing, cut_off = rng.standard_normal((17, 14)), (0.5, 0.4), 6.0
    heights[rng.random(heights.shape) < 0.4] = np.nan
    for periodic in (False, True):
        passed = smoothed(heights, spacing, cut_off, periodic=periodic)
        alpha, (i, j) = np.sqrt(np.log(2.0) / np.pi), np.nonzero(~np.isnan(heights))
        for p, q in np.ndindex(heights.shape):
            weight, full = np.zeros(len(i)), 0.0
            images = range(-3, 4) if periodic else (0,)
            for a in images:
                for b in images:
                    dx, dy = spacing[0] * (i - p + 17 * a), spacing[1] * (j - q + 14 * b)
                    weight += np.exp(-np.pi * (dx**2 + dy**2) / (alpha * cut_off) ** 2)
            full = (alpha * cut_off) ** 2 / (spacing[0] * spacing[1])  # all weights of a plane
            mean = weight @ heights[i, j] / weight.sum()
            if not np.isnan(heights[p, q]):
                assert passed[p, q] == pytest.approx(
                    mean, abs=3e-6
                )  # weight is cut where 6e-7 are left
            elif weight.sum() > 0.2501 * full:
                assert passed[p, q] == pytest.approx(mean, abs=3e-6)
            elif weight.sum() < 0.2499 * full:
                assert np.isnan(passed[p, q])


def test_whole_numbers_of_an_increment_are_no_spikes():
    """Levelling turns their steps into saw-teeth, smaller than the step of a single height."""
    rng = np.random.default_rng(2)
    counts = np.rint(np.add.outer(0.07 * np.arange(60.0), 0.03 * np.arange(50)))
    counts[tuple(rng.integers(2, 48, (2, 12)))] += 1.0
    assert not spikes(1e-6 * counts, (1.0, 1.0)).any()
    counts[17, 23] += 40.0
    assert np.argwhere(spikes(1e-6 * counts, (1.0, 1.0))).tolist() == [[17, 23]]


@pytest.mark.parametrize("form", ["plane", "quadratic"])
def test_maps_whose_borders_match_are_neither_tilted_nor_levelled(form):
    """The mean plane of whole waves is their phase; without it the map steps at its border."""
    wave = 0.01 * np.add.outer(np.sin(2 * np.pi * X), 0.5 * np.cos(2 * np.pi * X + 2.0))
    surface = surface_of(wave, lengths=(1.0, 1.0), periodic=True)
    assert surface.notes == () == surface_of(wave, lengths=(1.0, 1.0)).notes
    with pytest.raises(InputError, match=rf"surface.detrend = '{form}': .*along x, where its bord"):
        surface_of(wave, lengths=(1.0, 1.0), periodic=True, detrend=form)
    # of a part of a larger face, which does not match, the tilt is removed; a note tells the rest
    part = rough(5, (128, 64)).heights[:64] + 0.1 * X[:, None]
    cut = surface_of(part, lengths=(1.0, 1.0), periodic=True, detrend=form)
    assert cut.periodic and "opposite borders do not match" in cut.notes[0]
