"""Maps with masks, units, odd types and texts of any style, written, damaged and read back."""

import io
import re

import numpy as np

from patchlaw import InputError
from patchlaw.geometry import read_surface
from patchlaw.geometry.files.content import LENGTH_UNITS
from patchlaw.geometry.files.reading import surface_of

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


def came_back(folder, seed):
    """Write a random map in a random way and read it back; it must be the same to the last bit."""
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
        (folder / name).write_bytes(made.get(name[2:], lambda: text_of(values, rng))())
        lengths = None if name == "a.xyz" else sides
        surface = read_surface(folder / name, lengths=lengths, **steps)
        sides = sides[::-1] if swap and name == "a.xyz" else sides
    expected = values * LENGTH_UNITS[unit] if unit != "mm" else values
    expected = expected.T if swap else expected
    known = ~np.isnan(expected)
    np.testing.assert_array_equal(surface.heights[known], expected[known])
    assert np.isfinite(surface.heights).all() and surface.grid == expected.shape
    np.testing.assert_allclose(surface.lengths, sides, rtol=1e-12)  # steps of points are rounded
    assert surface.periodic is False
    return f"{name.partition('.')[2] or name} read"


DAMAGES = ("B4D", "-", "1.2.3", "1,5,2", "−1.5", "12O", "0x1f", "1e", "###")


def damage_was_told(folder, seed):
    """Write a text of which one cell is no number, or left out; its place must be told."""
    rng = np.random.default_rng(seed)
    shape = (int(rng.integers(4, 9)), int(rng.integers(4, 9)))
    rows = [[f"{one:.6g}" for one in row] for row in rng.normal(size=shape)]
    separator = str(rng.choice((";", "; ", ",", " ", "\t")))
    i, j = (int(rng.integers(count)) for count in shape)
    damage = str(rng.choice(DAMAGES))
    if damage == "###":
        del rows[i][j]
    else:
        rows[i][j] = damage
    heading = str(rng.choice(HEADINGS))
    lines = heading.split("\n")[:-1] + [separator.join(row) for row in rows]
    path = folder / "damaged.txt"
    path.write_text("\n".join(lines), encoding="utf-8")
    line = len(lines) - shape[0] + i + 1
    told = rf"line {line}[ ,]" if i or damage != "###" else "line "
    try:
        surface = read_surface(path, lengths=(1e3, 1e3))
    except InputError as error:
        assert re.search(told, str(error)), (told, str(error), lines)
        return "told"
    raise AssertionError(("read", surface.heights, lines))
