"""Strategies for files of heights: arrays, matrices and point lists, right, odd and damaged."""

import io
import pickle

import numpy as np
from hypothesis import strategies as st

from patchlaw.geometry import read_surface
from patchlaw.support import InputError

DTYPES = "f8 f4 f2 >f8 <i4 >i2 u1 i8 u8 ? c16 c8 S3 U3 O M8[s] m8[s] V4 f8,i4 g".split()
SHAPES = [(), (0,), (16,), (4, 4), (5, 7), (4, 1), (1, 9), (3, 3), (0, 5), (4, 4, 4), (1, 4, 4)]
numbers = st.one_of(
    st.floats(),
    st.integers(-(10**6), 10**6),
    st.sampled_from([1e308, -1e308, 5e-324, 1e-300, 1e200, 0.0]),
)
plain = st.integers(-(10**4), 10**4).map(lambda value: value / 1e3)
kinds_of_numbers = st.sampled_from([plain, plain, numbers])


@st.composite
def arrays(draw):
    """Draw the bytes of a ``.npy`` file."""
    shape, kind = draw(st.sampled_from(SHAPES)), np.dtype(draw(st.sampled_from(DTYPES)))
    if draw(st.booleans()):
        shape, kind = (
            draw(st.sampled_from(SHAPES[3:5])),
            np.dtype(draw(st.sampled_from(DTYPES[:9]))),
        )
    values = draw(st.lists(draw(kinds_of_numbers), min_size=1, max_size=6))
    count = int(np.prod(shape))
    if kind.kind in "fiu?":
        with np.errstate(all="ignore"):
            flat = np.resize(np.array(values, float), count).astype(kind)
    else:
        flat = np.zeros(count, kind)
    array = flat.reshape(shape, order=draw(st.sampled_from("CF")))
    file = io.BytesIO()
    np.save(file, array, allow_pickle=True)
    return file.getvalue()


def header(shape, kind="<f8", order=False):
    """Return the header of a ``.npy`` file of any promised shape, without the numbers."""
    file = io.BytesIO()
    told = {"descr": kind, "fortran_order": order, "shape": shape}
    np.lib.format.write_array_header_1_0(file, told)
    return file.getvalue()


class Bomb:
    """Runs code when it is unpickled."""

    def __reduce__(self):
        return exec, ("raise SystemExit('code of a pickle was run')",)


promises = st.builds(
    header,
    st.lists(st.sampled_from([0, 4, 10**5, 10**9, 10**18, -1, 2**63]), max_size=3).map(tuple),
    st.sampled_from(["<f8", "|O", "<c16", "|V100000", [("a", "<f8")], "<U9", "|b1"]),
)
cells = st.one_of(
    numbers.map(str), st.sampled_from(["", "nan", "inf", "1,5", "x", "1e999", "0x1", "１", "1_0"])
)
separators = st.sampled_from([" ", ",", ";", "\t", ", ", "  "])


@st.composite
def matrices(draw):
    """Draw the bytes of a text of numbers in rows, some of them ragged."""
    sign, rows = draw(separators), draw(st.sampled_from([0, 1, 3, 4, 5, 6]))
    width = draw(st.sampled_from([1, 2, 3, 4, 5, 6]))
    entries = draw(st.sampled_from([cells, numbers.map(str), plain.map(str), plain.map(str)]))
    row = st.lists(entries, min_size=width, max_size=width)
    lines = [sign.join(draw(row)) for _ in range(rows)]
    if draw(st.integers(0, 4)) == 0:
        lines.insert(0, draw(st.sampled_from(["# x", "1 2 3 4 5 6 7 8", "\0", "höhe", "#" * 999])))
    text = draw(st.sampled_from(["\n", "\r\n", "\r", "\n\n"])).join(lines)
    code = draw(st.sampled_from(["utf-8", "utf-8-sig", "latin-1", "utf-16"]))
    return text.encode(code, "replace")


@st.composite
def points(draw):
    """Draw the bytes of a point list: of a regular grid, with points moved, missing or twice."""
    nx, ny = draw(st.sampled_from([(4, 4), (5, 4), (4, 6), (1, 4), (4, 1), (2, 3), (1, 1)]))
    step = draw(st.sampled_from([1.0, 1e-3, 0.3, 1e-14, 1e14, 1e-300, 1e300, 0.0]))
    height = draw(kinds_of_numbers)
    found = [[step * i, step * j, draw(height)] for i in range(nx) for j in range(ny)]
    for _ in range(draw(st.integers(0, 2))):
        k = draw(st.integers(0, len(found) - 1))
        change = draw(st.sampled_from(["drop", "twice", "move"]))
        if change == "move":
            found[k] = [draw(numbers), draw(numbers), draw(numbers)]
        elif change == "twice":
            found.append(found[k])
        elif len(found) > 1:
            del found[k]
    return "\n".join(" ".join(map(str, point)) for point in found).encode()


@st.composite
def damaged(draw, whole):
    """Draw bytes of which some are overwritten, cut or put in."""
    data = bytearray(draw(whole))
    for _ in range(draw(st.integers(1, 3))):
        at = draw(st.integers(0, len(data)))
        data[at : at + draw(st.sampled_from([0, 1, 8, 10**6]))] = draw(st.binary(max_size=8))
    return bytes(data)


anything = st.one_of(
    st.tuples(st.just(".npy"), st.one_of(arrays(), promises, damaged(arrays()))),
    st.tuples(
        st.just(".npy"), st.sampled_from([pickle.dumps(Bomb()), b"", b"PK\3\4", b"\x93NUMPY"])
    ),
    st.tuples(
        st.sampled_from([".txt", ".csv", ".dat"]), st.one_of(matrices(), damaged(matrices()))
    ),
    st.tuples(st.just(".xyz"), st.one_of(points(), damaged(points()), matrices())),
    st.tuples(st.sampled_from([".npy", ".txt", ".xyz", ".opd", ""]), st.binary(max_size=60)),
)
sides = st.sampled_from([None, (1.0, 1.0), (1.0, 1.0), (1e-9, 1e9), (1e-15, 1e15), (1e300, 1.0)])


def read(path, lengths):
    """Read heights; return how that ended. What is wrong must be told with the file's name."""
    try:
        surface = read_surface(path, lengths=lengths)
    except InputError as error:
        told = str(error)
        assert told.startswith((f"{path}: ", "lengths = (1e+300, 1.0): must be"))
        assert len(told) < 1000 and "\n" not in told
        return "refused"
    assert min(surface.grid) >= 4 and np.isfinite(surface.highest)
    return "read"
