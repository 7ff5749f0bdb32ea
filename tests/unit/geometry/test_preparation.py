import numpy as np
import pytest

from geometry import InputError, Spectrum, Surface, read_surface, synthesise
from geometry.filters import spikes
from geometry.preparation import Crop, Filter, Preparation, prepared

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
        "0.0488 % of the heights missing and filled by a membrane",
        "its plane removed",
        "waves below 100 µm removed (Gaussian)",
        "waves beyond 400 µm removed (Gaussian)",
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
    assert "3 spikes removed and filled" in surface.source and surface.notes == ()
    assert np.count_nonzero(surface.heights != heights) == 3
    # the membrane misses the rough surface by a part of its step from cell to cell
    np.testing.assert_allclose(surface.heights, clean, atol=1e-3)


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
        InputError, match=r"gradient of the heights is 9\d.*in µm\? .*height_unit = 'u"
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
        ({"resample": (3, 8)}, r"the new grid of the surface does not fit"),
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
