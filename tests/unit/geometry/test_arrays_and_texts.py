"""Maps with masks, units, odd types and texts of any style are read to the last bit, or refused."""

import re

import numpy as np
import pytest

from benchmarks.map_round_trips import came_back, damage_was_told
from patchlaw import InputError
from patchlaw.geometry import Spectrum, Surface, read_surface, synthesise
from patchlaw.geometry.files.reading import surface_of
from patchlaw.geometry.filters import spikes
from patchlaw.support import real_array


@pytest.mark.long
def test_maps_come_back_to_the_last_bit(tmp_path):
    for seed in range(40):
        came_back(tmp_path, seed)


def test_damaged_cells_are_told_by_their_place(tmp_path):
    for seed in range(20):
        assert damage_was_told(tmp_path, seed) == "told", seed


JUNK = np.ma.array(np.full((6, 5), 1e3), mask=np.zeros((6, 5), dtype=bool))
JUNK.data[:] = 1e-3 * np.random.default_rng(1).normal(size=(6, 5))
JUNK[2, 3] = np.ma.masked
JUNK.data[2, 3] = 0.9


def test_what_a_mask_hides_is_no_height():
    with pytest.raises(InputError, match=r"1 of 30 heights are masked, .* index \(2, 3\)"):
        Surface(heights=JUNK, lengths=(1.0, 1.0))
    with pytest.raises(InputError, match=r"1 of 30 heights are missing, .* index \(2, 3\)"):
        surface_of(JUNK, lengths=(1.0, 1.0))
    for heights in (JUNK, list(JUNK)):  # numpy would take rows of a list without their masks
        whole = surface_of(heights, lengths=(1.0, 1.0), missing="fill").heights
        around = JUNK.data[[1, 3, 2, 2], [3, 3, 2, 4]]
        # square cells would make it their mean; these are 1/6 by 1/5
        assert around.min() < whole[2, 3] < around.max()


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (np.ones((4, 4)) > 0, "'bool': not an array of real numbers"),
        (np.ones((4, 4)) * 1j, "'complex128': not an array of real"),
        ([[1.0, None]], "'object': not an array of real"),
        ([[1.0], [1.0, 2.0]], "its rows differ"),
        (np.zeros((2, 2), "M8[s]"), r"'datetime64\[s\]': not"),
    ],
)
def test_what_is_no_array_of_numbers(value, message):
    with pytest.raises(InputError, match=message):
        real_array(value)


def test_units_of_others_are_not_dropped():
    pint = pytest.importorskip("pint")
    heights = pint.UnitRegistry().Quantity(np.ones((4, 4)), "um")
    with pytest.raises(InputError, match="an array with the unit 'micrometer'"):
        Surface(heights=heights, lengths=(1.0, 1.0))


HEIGHTS = 1e-3 * np.random.default_rng(5).normal(size=(30, 20))
ROWS = "\n".join(" ".join(repr(float(one)) for one in row) for row in HEIGHTS)


@pytest.mark.long
@pytest.mark.parametrize(
    "heading", ["", "# Sample A, polished", "Sample A, polished", "Sample 5, polished 2024-05-01"]
)
@pytest.mark.parametrize("name", ["a.txt", "a.csv", "a.asc", "a"])
def test_words_above_a_map_do_not_turn_it(tmp_path, heading, name):
    if any(sign.isdigit() for sign in heading):
        pytest.importorskip("SurfaceTopography")  # which may find sides in it
    (tmp_path / name).write_text(f"{heading}\n{ROWS}\n")
    surface = read_surface(tmp_path / name, lengths=(0.3, 0.2))
    np.testing.assert_array_equal(surface.heights, HEIGHTS)
    assert (heading[:1] == "S") == (f"its heading '{heading}' left out" in surface.source)


def test_comments_that_state_other_lengths_are_no_sides(tmp_path):
    (tmp_path / "a.txt").write_text(f"# Sample: 3 mm\n# polished\n# Depth: 5 um\n{ROWS}\n")
    assert read_surface(tmp_path / "a.txt", lengths=(0.3, 0.2)).grid == (30, 20)


def test_sides_that_fit_the_other_way_are_noted(tmp_path):
    np.savetxt(tmp_path / "a.txt", HEIGHTS)
    note, _ = read_surface(tmp_path / "a.txt", lengths=(0.4, 0.6)).notes  # and on noise
    assert "30 × 20 heights make cells of 13.3 × 30 µm" in note and "swap_xy = true" in note
    assert "20 × 30 heights make square ones of 20 × 20 µm" in note
    surface = read_surface(tmp_path / "a.txt", lengths=(0.4, 0.6), swap_xy=True)
    assert len(surface.notes) == 1 and surface.source.split(", ")[1] == "x and y swapped"
    np.testing.assert_array_equal(surface.heights, HEIGHTS.T)
    (noise,) = read_surface(tmp_path / "a.txt", lengths=(0.6, 0.4)).notes
    assert "waves at the grid are not resolved" in noise
    with pytest.raises(InputError, match=r"differs from the grid .*; swap_xy = true exchanges"):
        read_surface(tmp_path / "a.txt", lengths=(0.4, 0.6), grid=(20, 30))


ROUGH = synthesise(
    Spectrum(hurst=0.8, waves=(2, 16), rms_slope=0.1, seed=4), grid=(96, 80), lengths=(1.2, 1.0)
)


def broken(kind, rng):
    """Return the rough map as an instrument without luck has it, and where it is right."""
    heights = 0.5 * ROUGH.heights + 0.0395
    spoilt = np.zeros(heights.shape, dtype=bool)
    if kind == "block":
        spoilt[30:50, 20:45] = True
    elif kind == "border":
        spoilt[:, 0] = True
    else:
        spoilt = rng.random(heights.shape) < 500 / heights.size
    heights[spoilt] = 0.0
    gaps = np.zeros_like(spoilt)
    if kind == "lonely":  # islands of 0 in a wide gap, as in maps of chromatic sensors
        gaps[20:60, 15:60] = True
        gaps &= ~spoilt
    gaps |= rng.random(heights.shape) < 0.02
    gaps &= ~spoilt
    heights[gaps] = np.nan
    return heights, spoilt, gaps


@pytest.mark.parametrize("kind", ["block", "border", "scattered", "lonely"])
def test_zeros_that_mean_no_data_do_not_reach_into_gaps(kind):
    heights, spoilt, gaps = broken(kind, np.random.default_rng(3))
    both = {"missing": "fill", "outliers": "remove"}
    surface = surface_of(heights, lengths=(1.2, 1.0), **both)
    right = ~(spoilt | gaps)
    np.testing.assert_array_equal(surface.heights[right], heights[right])
    # a membrane stays within the range of the heights that it hangs between
    assert np.ptp(surface.heights) == np.ptp(heights[right])
    assert f"{spoilt.sum()} spikes removed and filled" in surface.source
    kept = surface_of(heights, lengths=(1.2, 1.0), missing="fill")
    assert np.all(kept.heights[spoilt] == 0.0)
    np.testing.assert_array_equal(kept.heights[~spoilt], surface.heights[~spoilt])
    assert any("the lowest lies" in note and "remove" in note for note in kept.notes)


def test_what_fills_gaps_between_errors_is_noted():
    heights = ROUGH.on_grid((384, 320)).heights.copy()
    x, y = np.indices(heights.shape)
    heights += 0.05 * np.exp(-((x - 100) ** 2 + (y - 90) ** 2) / 32)  # dust, without its middle
    heights[99:102, 89:92] = np.nan
    notes = surface_of(heights, lengths=(1.2, 1.0), missing="fill").notes
    size = re.search(r"what fills gaps reaches (\S+) µm beyond 99.8 % of the heights", notes[1])
    rim = heights[98:103, 88:93] - np.nanquantile(heights, 0.999)  # the membrane hangs from it
    assert 1e3 * np.nanmin(rim) < float(size[1]) < 1e3 * np.nanmax(rim)


@pytest.mark.parametrize("share", [0.0, 0.1, 0.4])
@pytest.mark.parametrize("seed", range(4))
def test_gaps_and_borders_make_no_spikes(share, seed):
    rng = np.random.default_rng(seed)
    spectrum = Spectrum(hurst=rng.uniform(0.3, 1.0), waves=(2, 5 + 9 * seed), rms_slope=0.2)
    heights = synthesise(spectrum, grid=(128, 96), lengths=(1.0, 1.0)).heights.copy()
    heights += rng.uniform(-0.5, 0.5) * np.arange(128)[:, None] / 128
    heights[rng.random(heights.shape) < share] = np.nan
    assert not spikes(heights, (1 / 128, 1 / 96)).any()


@pytest.mark.parametrize(
    "word", ["1.#QNAN", "-1.#IND", "1.#INF", "-1.#IND00", "1.#QNAN0", "1.#J", "-nan(ind)", "-inf"]
)
@pytest.mark.parametrize("place", [0, 29])
def test_what_libraries_of_c_write_for_no_number_is_missing(tmp_path, word, place):
    """In a last column ``1.#QNAN`` was 1 and a comment."""
    heights = 1e-3 * HEIGHTS
    rows = [[repr(float(one)) for one in row] for row in heights.T]
    rows[7][place % len(rows[7])] = word
    text = "\n".join([" ".join(rows[0]) + " # of the first row", *map(" ".join, rows[1:])])
    (tmp_path / "a.txt").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=rf"1 of 600 heights are missing, .*\(7, {place % 30}\)"):
        read_surface(tmp_path / "a.txt", lengths=(1.0, 1.5))
    surface = read_surface(tmp_path / "a.txt", lengths=(1.0, 1.5), missing="fill")
    known = np.arange(600).reshape(20, 30) != 7 * 30 + place % 30
    np.testing.assert_array_equal(surface.heights[known], heights.T[known])
    commas = text.replace(".", ",")  # as such a library writes them where commas are decimal
    (tmp_path / "a.txt").write_text(commas, encoding="utf-8")
    with pytest.raises(InputError, match="1 of 600 heights are missing"):
        read_surface(tmp_path / "a.txt", lengths=(1.0, 1.5))


def test_coordinates_in_the_first_row_and_column_are_no_heights(tmp_path):
    x, y = 1e-2 * np.arange(20), 1e-2 * np.arange(30)
    whole = np.block([[np.zeros((1, 1)), y[None]], [x[:, None], 1e-3 * HEIGHTS.T]])
    np.savetxt(tmp_path / "a.txt", whole, fmt="%.9g")
    found = read_surface(tmp_path / "a.txt", lengths=(1.0, 1.5))
    np.testing.assert_allclose(found.heights, 1e-3 * HEIGHTS.T, atol=1e-9)
    assert any("first row and column are coordinates" in note for note in found.notes)
    for matrix, lines in ((whole[:, 1:], "row"), (whole[1:], "column"), (whole[:0:-1], "column")):
        np.savetxt(tmp_path / "a.txt", matrix, fmt="%.6g")
        message = rf"the first {lines} of the matrix rises in even steps, as coordinates do"
        with pytest.raises(InputError, match=message):
            read_surface(tmp_path / "a.txt", lengths=(1.0, 1.5))
    for heights in (1e-3 * HEIGHTS.T, np.add.outer(x, y), np.outer(x, HEIGHTS[:, 3])):
        np.savetxt(tmp_path / "a.txt", heights)
        assert read_surface(tmp_path / "a.txt", lengths=(1.0, 1.5)).grid == (20, 30)


@pytest.mark.parametrize(
    ("width", "height", "sides"),
    [
        ("1,234.5", "1.5", (1.2345, 0.0015)),
        ("1.234,5", "1,5", (1.2345, 0.0015)),
        ("1,234", "0,987", (0.001234, 0.000987)),
        ("1,234,567", "1,000,000", (1234.567, 1000.0)),
        ("1,234", "2,000", None),
        ("1.2.3", "1", None),
    ],
)
def test_commas_in_sizes(tmp_path, width, height, sides):
    head = f"# Channel: Topography\n# Width: {width} um\n# Height: {height} um\n# Value units: um\n"
    rows = "\n".join(" ".join(f"{1e-9 * one:.9f}" for one in row) for row in HEIGHTS)
    (tmp_path / "a.txt").write_text(head + rows, encoding="utf-8")
    if sides is None:
        with pytest.raises(InputError, match=r"comma in '1,234' means|no number: '1.2.3'"):
            read_surface(tmp_path / "a.txt")
    else:
        assert read_surface(tmp_path / "a.txt").lengths == pytest.approx(sides, rel=1e-15)
