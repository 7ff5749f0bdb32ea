"""Files of heights: what they hold comes back, and any other content is refused in one line."""

import os
import pickle
import warnings

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings

from benchmarks.height_files import Bomb, anything, header, read, sides
from patchlaw import InputError
from patchlaw.geometry import read_surface

HEIGHTS = 0.1 * np.random.default_rng(0).normal(size=(5, 4))
SIDES = (2.5, 2.0)


def points(order=None, decimals=9):
    """Return the columns x, y, z of HEIGHTS on cells of 0.5 mm."""
    x, y = np.meshgrid(3.0 + 0.5 * np.arange(5), -1.0 + 0.5 * np.arange(4), indexing="ij")
    rows = np.round(np.stack([x.ravel(), y.ravel(), HEIGHTS.ravel()], axis=1), decimals)
    return rows if order is None else rows[order]


@pytest.mark.parametrize("suffix", [".txt", ".dat", ".csv", ".TXT"])
@pytest.mark.parametrize("separator", [" ", "\t", ",", ";", ", "])
def test_text_matrices_have_rows_along_x(tmp_path, suffix, separator):
    file = tmp_path / f"scan{suffix}"
    rows = [separator.join(repr(float(value)) for value in row) for row in HEIGHTS]
    file.write_text("# heights, in mm; [ix, iy]\n\n" + "\n".join(rows) + "\n")
    surface = read_surface(file, lengths=SIDES, grid=(5, 4), periodic=True)
    np.testing.assert_array_equal(surface.heights, HEIGHTS)
    assert (
        surface.lengths == SIDES
        and surface.periodic
        and surface.source == f"{file}, heights taken in mm"
    )


@pytest.mark.parametrize("seed", [None, 0, 1])
def test_point_lists_come_in_any_order(tmp_path, seed):
    order = None if seed is None else np.random.default_rng(seed).permutation(20)
    file = tmp_path / "scan.xyz"
    np.savetxt(file, points(order))
    surface = read_surface(file)
    np.testing.assert_allclose(surface.heights, HEIGHTS, atol=1e-9)  # nine decimals were written
    # lengths are cells times spacing: samples lie at cell centres
    assert surface.lengths == pytest.approx(SIDES, rel=1e-12)
    assert read_surface(file, lengths=(1.0, 1.0)).lengths == (1.0, 1.0)


def test_point_lists_may_carry_rounded_coordinates(tmp_path):
    file = tmp_path / "scan.xyz"
    rows = points()
    rows[:, :2] += np.random.default_rng(2).uniform(-1e-3, 1e-3, (20, 2))
    np.savetxt(file, rows)
    surface = read_surface(file)
    assert surface.grid == (5, 4)
    assert surface.lengths == pytest.approx(SIDES, abs=4e-3)  # as good as the coordinates


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        (
            "a.txt",
            "1 2 3 4\n1 2 3\n",
            "not a matrix of numbers: line 2 has 3 of them, line 1 has 4 ",
        ),
        ("a.csv", "1,2,x\n", "not a matrix of numbers: line 1, column 3: 'x' is no number"),
        ("a.csv", "# \n\n1;2;3\n1;?;3\n", "line 4, column 2: '.' is no number .*nan where"),
        ("a.txt", "1 BAD 3 4\n" + "1 2 3 4\n" * 4, "1 of 20 heights are missing"),
        ("a.txt", "BAD BAD BAD BAD\n" + "1 2 3 4\n" * 4, "4 of 20 heights are missing"),
        ("a.csv", "1,234;2,345\n", "column 1: it is not clear what the comma in '1,234' means"),
        ("a.csv", "1,5;2.5\n", "column 1: it is not clear what the comma in '1,5' means"),
        ("a.csv", "0,386,-1,029\n0,12,0,4\n", "what the comma in '0,386,-1,029' means"),
        ("a.csv", "0,386, 0,435\n1,25, -0,4\n", "what the comma in '0,386,' means"),
        ("a.txt", "1 2\n1 2,3,4\n", "line 2, column 2: it is not clear .* '2,3,4' means"),
        ("a.csv", ";\n;\n", "2 rows of 1 numbers are a profile"),
        ("a.txt", "1 2 3\n" * 4 + "Mean: 5\n", "line 5, column 1: 'Mean:' is no number"),
        (
            "a.csv",
            "".join(f"{i},{j},0.1,7\n" for i in range(4) for j in range(4)),
            "a list of points with 4 columns: the first two are the places",
        ),
        ("a.dat", "", "the file is empty"),
        ("a.dat", "# nothing\n", "the file is empty"),
        (
            "a.txt",
            "1 2 3 4\n" * 3 + "1 nan 3 4\n",
            r"1 of 16 heights are missing, the first at .*\(3, 1\)",
        ),
        ("a.txt", "1 2 3 4 5\n", "1 rows of 5 numbers are a profile, not a surface"),
        ("a.dat", "0 1\n1 1\n2 3\n", "3 rows of 2 numbers are a profile, not a surface"),
        ("a.txt", "0 1 2 3\n" * 3, r"a surface needs at least 4 × 4 heights.*: \(3, 4\)"),
        ("a.txt", "# Value units: V\n" + "0 1 2 3\n" * 4, "is no unit of heights: 'V'"),
        ("a.npy", "not an array", "not a whole, readable numpy array"),
        ("a.npy", "", "not a whole, readable numpy array"),
        ("a.xyz", "1 2\n3 4\n", "a point list needs three columns x, y, z: 2 .*a profile"),
        ("a.xyz", "0 0 1\n0 1 1\n0 2 1\n", "all points have the same x, they are a profile"),
        ("a.xyz", "0 0 1\n1 0 1\nnan 1 1\n", "some coordinates x, y are not finite"),
        ("a.xyz", "0 0 1\n1 0 1\n2 1 1\n3 2 1\n", "4 × 3: 8 places are empty, 0 taken more"),
        ("a.xyz", "0 0 1\n1 0 1\n1 1 1\n0 1 1\n0 1 1\n", "0 places are empty, 1 taken more"),
        ("a.xyz", "0 0 1\n1 0 1\n2.3 1 1\n3 1 1\n", "the points are not evenly spaced along x"),
    ],
)
def test_unreadable_content_names_the_file_and_the_fault(tmp_path, name, text, message):
    (tmp_path / name).write_text(text)
    with pytest.raises(InputError, match=rf"a\.\w+: .*{message}"):
        read_surface(tmp_path / name, lengths=(1.0, 1.0))


def test_points_are_as_even_as_their_digits_tell(tmp_path):
    """Gwyddion writes points in metres with five digits: those of many rows lie beside a step."""
    rows, heights = 1501, 1e-9 * np.random.default_rng(5).standard_normal((4, 1501))
    step = 1.2345678e-3 / rows
    places = [(i, j) for j in range(rows) for i in range(4) if j != 700]
    lines = [
        f"{step * (i + 0.5):.5g} {step * (j + 0.5):.5g} {heights[i, j]:.9g}\n" for i, j in places
    ]
    (tmp_path / "a.xyz").write_text("".join(lines), encoding="utf-8")
    (tmp_path / "stated.xyz").write_text(
        "".join(["# Channel: Z\n# Lateral units: m\n# Value units: m\n", *lines]), encoding="utf-8"
    )
    stated = read_surface(tmp_path / "stated.xyz", missing="fill")
    found = read_surface(tmp_path / "a.xyz", xy_unit="m", height_unit="m", missing="fill")
    assert found.grid == (4, rows) and stated.lengths == found.lengths
    np.testing.assert_array_equal(stated.heights, found.heights)
    # five digits of the last row, over all of them
    assert found.lengths[1] == pytest.approx(1e3 * step * rows, rel=1e-4)
    kept = np.arange(rows) != 700
    np.testing.assert_allclose(found.heights[:, kept], 1e3 * heights[:, kept], rtol=1e-8)


def test_missing_files_and_folders(tmp_path):
    with pytest.raises(InputError, match=r"gone\.npy: there is no such file"):
        read_surface(tmp_path / "gone.npy", lengths=SIDES)
    with pytest.raises(InputError, match=rf"{tmp_path}: is a folder \(allowed: a file\)"):
        read_surface(tmp_path, lengths=SIDES)


@pytest.mark.parametrize("save", [np.savez, np.savez_compressed])
def test_an_archive_holds_one_array(tmp_path, save):
    save(tmp_path / "a.npz", heights=HEIGHTS)
    found = read_surface(tmp_path / "a.npz", lengths=SIDES)
    np.testing.assert_array_equal(found.heights, HEIGHTS)
    for wrong, message in (
        ({"a": HEIGHTS, "b": HEIGHTS}, r"an .npz of 2 arrays: a, b \(allowed: one array"),
        ({}, "an .npz of 0 arrays"),
        ({"a": HEIGHTS[0]}, "not a two-dimensional array"),
        ({"a": np.array([None])}, "not a whole, readable numpy archive"),
    ):
        save(tmp_path / "a.npz", **wrong)
        with pytest.raises(InputError, match=message):
            read_surface(tmp_path / "a.npz", lengths=SIDES)
    (tmp_path / "a.npz").write_bytes(b"PK\x03\x04" + bytes(50))
    with pytest.raises(InputError, match="not a whole, readable numpy archive"):
        read_surface(tmp_path / "a.npz", lengths=SIDES)


@pytest.mark.long
@pytest.mark.parametrize("separator", ["\t", ",", ";", " "])
@pytest.mark.parametrize(
    "word",
    [
        "",
        "No Data",
        '"No Data"',
        "nodata",
        "BAD",
        "Bad",
        "n/a",
        "#N/A",
        "#DIV/0!",
        "---",
        "***",
        "NaN",
    ],
)
def test_words_and_empty_cells_are_missing_heights(tmp_path, separator, word):
    """At the beginning, the end and in the middle of rows, and in the first row."""
    if separator == " " and not word:
        return
    rows = [[f"{one:.9f}" for one in row] for row in HEIGHTS]
    places = [(0, 0), (1, 2), (3, len(rows[0]) - 1)]
    for ix, iy in places:
        rows[ix][iy] = word
    text = "\n".join(separator.join(row) for row in rows)
    (tmp_path / "a.txt").write_text(text, encoding="utf-8")
    found = read_surface(tmp_path / "a.txt", lengths=SIDES, missing="fill")
    known = np.ones(HEIGHTS.shape, dtype=bool)
    known[tuple(np.transpose(places))] = False
    np.testing.assert_allclose(found.heights[known], HEIGHTS[known], atol=1e-9)
    with pytest.raises(InputError, match=f"3 of {HEIGHTS.size} heights are missing"):
        read_surface(tmp_path / "a.txt", lengths=SIDES)


def test_words_state_sides_and_unit_as_comments_do(tmp_path):
    rows = "\n".join("\t".join(f"{1e3 * one:.6f}" for one in row) for row in HEIGHTS)
    for mark in ("", "# "):
        head = f"{mark}Channel: Topography\n{mark}Width: 2.5 mm\n{mark}Height: 2000 µm\n"
        (tmp_path / "a.txt").write_text(f"{head}{mark}Value units: µm\n{rows}", encoding="utf-8")
        found = read_surface(tmp_path / "a.txt")
        assert found.lengths == pytest.approx((2.5, 2.0), rel=1e-15)
        np.testing.assert_allclose(found.heights, HEIGHTS.T, atol=1e-9)  # a row runs along x
        assert "left out" not in found.source
    said = "sides of 2.5 × 2 mm, and lengths of 2.5 × 2.5 mm are taken instead"
    for side, count in ((2.0, 0), (2.5, 1)):
        notes = read_surface(tmp_path / "a.txt", lengths=(2.5, side)).notes
        assert sum(said in note for note in notes) == count


def test_points_may_be_in_metres(tmp_path):
    rows = points() * 1e-3
    np.savetxt(tmp_path / "scan.xyz", rows, fmt="%.15g")
    found = read_surface(tmp_path / "scan.xyz", xy_unit="m", height_unit="m")
    np.testing.assert_allclose(found.heights, HEIGHTS, atol=1e-9)
    assert found.lengths == pytest.approx(SIDES, rel=1e-12)
    np.savetxt(tmp_path / "scan.xyz", rows * [1e-3, 1e-3, 1e-3], fmt="%.15g")
    notes = " ".join(read_surface(tmp_path / "scan.xyz").notes)
    assert "are they in m? Then say xy_unit = 'm'" in notes
    assert "xy_unit" not in " ".join(read_surface(tmp_path / "scan.xyz", lengths=SIDES).notes[:1])
    np.savetxt(tmp_path / "scan.txt", HEIGHTS)
    with pytest.raises(InputError, match="xy_unit = 'm': is for lists of points"):
        read_surface(tmp_path / "scan.txt", lengths=SIDES, xy_unit="m")


def test_heights_in_metres_are_suspected(tmp_path):
    steep = 0.1 * np.random.default_rng(1).random((12, 12))
    np.savetxt(tmp_path / "scan.txt", 1e-3 * steep * 1e-3)
    notes = read_surface(tmp_path / "scan.txt", lengths=(1.0, 1.0)).notes
    assert any("For heights in m say height_unit = 'm'" in note for note in notes)


@pytest.mark.parametrize("name", ["scan.npy", "scan.txt"])
def test_lengths_are_needed_where_the_file_has_none(tmp_path, name):
    np.save(tmp_path / "scan.npy", HEIGHTS)
    np.savetxt(tmp_path / "scan.txt", HEIGHTS)
    with pytest.raises(InputError, match=rf"{name}: .*no sides in a unit of length"):
        read_surface(tmp_path / name)


def test_the_grid_must_match_when_given(tmp_path):
    np.save(tmp_path / "scan.npy", HEIGHTS)
    with pytest.raises(InputError, match=r"the file's number of heights.*: \(5, 4\) .*\(4, 5\)"):
        read_surface(tmp_path / "scan.npy", lengths=SIDES, grid=(4, 5))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (header((10**5, 10**5)) + bytes(800), "not a whole, readable numpy array: mmap length is"),
        (header((4, 4), "<c16") + bytes(256), "not an array of real numbers: 'complex128'"),
        (header((4, 4), "|O") + pickle.dumps(Bomb()), "readable numpy array: .*Python objects"),
        (pickle.dumps(Bomb()), "not a whole, readable numpy array"),
        (header((16,)) + bytes(128), r"not a two-dimensional array: \(16,\) \(allowed: \(nx, ny"),
        (header((-4, -4)) + bytes(128), "not a whole, readable numpy array: negative dim"),
        (b"\x93NUMPY\7\0" + header((4, 4))[8:], "not a whole, readable numpy array: .*version"),
        (np.lib.format.MAGIC_PREFIX + b"\1\0v\0{'descr'", "not a whole, readable numpy array: EOF"),
    ],
)
def test_headers_are_not_believed(tmp_path, content, message):
    (tmp_path / "a.npy").write_bytes(content)
    with pytest.raises(InputError, match=rf"a\.npy: .*{message}"):
        read_surface(tmp_path / "a.npy", lengths=(1.0, 1.0))


@pytest.mark.parametrize(("name", "size"), [("a.npy", 9 * 10**12), ("a.txt", 10**13)])
def test_files_larger_than_memory_are_refused_unread(tmp_path, name, size):
    with (tmp_path / name).open("wb") as file:  # nearly all of it a hole, which takes no disk
        file.write(header((10**5, 10**7)))
        file.truncate(size)
    with pytest.raises(InputError, match=rf"{name}: the heights need about .* GB of memory \(allo"):
        read_surface(tmp_path / name, lengths=(1.0, 1.0))


def test_what_is_no_regular_file_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "pipe.txt")
    for path in (tmp_path / "pipe.txt", "/dev/zero", "a\0.npy"):
        with pytest.raises(InputError, match=r"is no regular file|there is no such file"):
            read_surface(path, lengths=(1.0, 1.0))
    with pytest.raises(InputError, match="cannot be read: File name too long"):
        read_surface(tmp_path / ("x" * 300), lengths=(1.0, 1.0))


def test_sizes_of_no_scale_are_refused(tmp_path):
    np.savetxt(tmp_path / "a.txt", 1e200 * HEIGHTS)
    with pytest.raises(InputError, match=r"all heights are missing .allowed: .* within ±1e\+15 mm"):
        read_surface(tmp_path / "a.txt", lengths=(1.0, 1.0))
    np.savetxt(tmp_path / "b.txt", HEIGHTS)
    with pytest.raises(InputError, match=r"lengths = .*; 1e-300 must be greater"):
        read_surface(tmp_path / "b.txt", lengths=(1e-300, 1.0))
    np.savetxt(tmp_path / "c.xyz", points() * (1e300, 1.0, 1.0))
    with pytest.raises(InputError, match=r"coordinates x, y are not finite, or beyond 1e\+15 mm"):
        read_surface(tmp_path / "c.xyz")


def test_heights_below_any_scale_are_refused(tmp_path):
    np.save(tmp_path / "h.npy", 1e-110 * HEIGHTS)
    with pytest.raises(
        InputError, match=r"h.npy: the heights differ by less than any roughness: [0-9.]*e-11"
    ):
        read_surface(tmp_path / "h.npy", lengths=SIDES)


def test_rounding_is_no_roughness(tmp_path):
    np.save(tmp_path / "h.npy", 1.0 + 1e-15 * HEIGHTS)
    surface = read_surface(tmp_path / "h.npy", lengths=SIDES)
    assert np.ptp(surface.heights) == 0.0 and surface.source.endswith(", level but for rounding")
    np.save(tmp_path / "h.npy", 1.0 + 1e-12 * HEIGHTS)
    assert np.ptp(read_surface(tmp_path / "h.npy", lengths=SIDES).heights) > 1e-13


@settings(
    max_examples=100,
    derandomize=True,
    database=None,
    deadline=None,
    suppress_health_check=list(HealthCheck),
)
@given(anything, sides)
def test_files_of_any_content(tmp_path_factory, file, lengths):
    suffix, content = file
    path = tmp_path_factory.getbasetemp() / f"heights{suffix}"
    path.write_bytes(content)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert read(path, lengths) in ("read", "refused")
