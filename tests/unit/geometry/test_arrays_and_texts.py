"""Maps with masks, units, odd types and texts of any style are read to the last bit, or refused."""

import io
import re

import numpy as np
import pytest

from geometry import InputError, Spectrum, Surface, read_surface, synthesise
from geometry.checks import real_array
from geometry.files.content import LENGTH_UNITS
from geometry.files.reading import surface_of
from geometry.filters import spikes

DTYPES = "f8 f4 f2 >f8 <f4 i2 >i4 u1 i8 g".split()
SEPARATORS = (" ", "\t", "   ", ";", "; ", ",", ", ")
ENDS = ("\n", "\r\n", "\r")
CODES = ("utf-8", "utf-8-sig", "latin-1", "utf-16")
HEADINGS = (
    "", "# Höhe, in µm\n", "Sample A, polished\n", "Sonde\nréglée à neuf\n", "Nano scan\n",
    "# 3 by 5\n\n",
)  # fmt: skip


def drawn(rng):
    """Return heights with a mask, as a few thousandths of a mm, in a type of any kind."""
    shape = (int(rng.integers(4, 12)), int(rng.integers(4, 12)))
    kind = np.dtype(str(rng.choice(DTYPES)))
    numbers = rng.normal(size=shape) if kind.kind == "f" else rng.integers(1, 99, shape)
    mask = rng.random(shape) < rng.choice([0.0, 0.1])
    return np.ma.array(numbers.astype(kind), mask=mask)


def arranged(array, rng):
    """Return the same array in another memory order, as a view of a larger one, or read-only."""
    kind = rng.integers(4)
    if kind == 0:
        return np.ma.array(np.asfortranarray(array.data), mask=array.mask)
    if kind == 1:
        larger = np.ma.zeros((2 * array.shape[0], array.shape[1]), dtype=array.dtype)
        larger[::2] = array
        return larger[::2]
    if kind == 2:
        array.data.setflags(write=False)
    return array


def text_of(values, rng):
    """Return the bytes of a text of the numbers in a style of its own; missing ones are nan."""
    separator = str(rng.choice(SEPARATORS))
    cells = [[repr(float(one)) for one in row] for row in values]
    if separator.strip() != "," and not rng.integers(4):
        cells = [[one.replace(".", ",") for one in row] for row in cells]
    ending = separator.strip() if rng.integers(2) else ""
    heading, end = str(rng.choice(HEADINGS)), str(rng.choice(ENDS))
    lines = heading.split("\n")[:-1] + [separator.join(row) + ending for row in cells]
    return (end.join(lines) + end * int(rng.integers(3))).encode(str(rng.choice(CODES)))


def points_of(values, sides, rng):
    """Return the text of a point list in any order, without the points that are missing."""
    nx, ny = values.shape
    x, y = (np.arange(n) * (side / n) for n, side in zip((nx, ny), sides, strict=True))
    rows = [(x[i], y[j], values[i, j]) for i in range(nx) for j in range(ny)]
    if rng.integers(2):
        rows = [row for row in rows if not np.isnan(row[2])]
    order = rng.permutation(len(rows))
    return "\n".join(" ".join(repr(float(one)) for one in rows[k]) for k in order).encode()


@pytest.mark.parametrize("seed", range(120))
def test_maps_come_back_to_the_last_bit(tmp_path, seed):
    rng = np.random.default_rng(seed)
    array, sides = drawn(rng), tuple(rng.uniform(1e3, 2e3, 2))  # mm: no map is too steep
    plain = np.array(array.tolist(None), dtype=object)
    values = np.array([[np.nan if one is None else float(one) for one in row] for row in plain])
    unit, swap = str(rng.choice(["mm", "um", "nm", "Å"])), bool(rng.integers(2))
    name = str(rng.choice(["memory", "a.npy", "a.txt", "a.csv", "a.asc", "a.xyz"]))
    mask = np.isnan(values)
    steps = {"height_unit": unit, "swap_xy": swap, "missing": "fill" if mask.any() else "refuse"}
    if name == "memory":
        surface = surface_of(arranged(array, rng), lengths=sides, **steps)
    else:
        content = io.BytesIO()
        filled = arranged(np.ma.array(values if mask.any() else array.data), rng).data
        np.save(content, filled)
        made = {"npy": content.getvalue, "xyz": lambda: points_of(values, sides, rng)}
        (tmp_path / name).write_bytes(made.get(name[2:], lambda: text_of(values, rng))())
        lengths = None if name == "a.xyz" else sides
        surface = read_surface(tmp_path / name, lengths=lengths, **steps)
        sides = sides[::-1] if swap and name == "a.xyz" else sides
    expected = values * LENGTH_UNITS[unit] if unit != "mm" else values
    expected = expected.T if swap else expected
    known = ~np.isnan(expected)
    np.testing.assert_array_equal(surface.heights[known], expected[known])
    assert np.isfinite(surface.heights).all() and surface.grid == expected.shape
    assert surface.lengths == pytest.approx(sides, rel=1e-12)  # steps of points are rounded
    assert surface.periodic is False


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
    (note,) = read_surface(tmp_path / "a.txt", lengths=(0.4, 0.6)).notes
    assert "30 × 20 heights make cells of 13.3 × 30 µm" in note and "swap_xy = true" in note
    assert "20 × 30 heights make square ones of 20 × 20 µm" in note
    surface = read_surface(tmp_path / "a.txt", lengths=(0.4, 0.6), swap_xy=True)
    assert surface.notes == () and surface.source.split(", ")[1] == "x and y swapped"
    np.testing.assert_array_equal(surface.heights, HEIGHTS.T)
    assert read_surface(tmp_path / "a.txt", lengths=(0.6, 0.4)).notes == ()
    with pytest.raises(InputError, match=r"differs from the grid .*; swap_xy = true exchanges"):
        read_surface(tmp_path / "a.txt", lengths=(0.4, 0.6), grid=(20, 30))


ROUGH = synthesise(
    Spectrum(hurst=0.8, waves=(2, 16), rms_slope=0.1, seed=4), grid=(96, 80), lengths=(1.2, 1.0)
)


def broken(kind, rng):
    """Return the rough map as an instrument without luck has it, and where it is right."""
    heights = ROUGH.heights + 0.079
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
