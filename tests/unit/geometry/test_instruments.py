import sys

import numpy as np
import pytest
from helpers import instrument_files as files

from patchlaw import InputError
from patchlaw.geometry import read_surface

REASON = "SurfaceTopography is not installed: ./setup.sh --instruments"
SINGLE = 2e-7  # relative rounding of single precision, in which several formats keep numbers


def library():
    return pytest.importorskip("SurfaceTopography", reason=REASON)


def expected(name):
    """Return heights and sides [mm] that a file was made of."""
    heights = files.UNIT * files.NUMBERS
    if name not in files.WITHOUT_GAPS:
        heights[files.GAP] = np.nan
    y = files.STEP[0] if name in files.SQUARE_CELLS else files.STEP[1]
    return heights, (files.NX * files.STEP[0], files.NY * y)


def what_the_library_reads(reader, channel):
    """Return heights, masked where missing, and sides [mm] of a channel."""
    chosen = reader.default_channel if channel is None else reader.channels[channel]
    topography = chosen.topography().to_unit("mm")
    return np.ma.array(topography.heights(), copy=True), topography.physical_sizes


def same_as_the_library(path, channel=None):
    """Compare a surface with what SurfaceTopography itself says of the file."""
    with library().open_topography(str(path)) as reader:
        heights, lengths = what_the_library_reads(reader, channel)
    surface = read_surface(path, missing="fill", channel=channel)
    known = ~np.ma.getmaskarray(heights)
    np.testing.assert_allclose(surface.heights[known], heights.data[known], rtol=1e-13)
    assert surface.lengths == pytest.approx(lengths, rel=1e-13)
    assert ("missing and filled" in surface.source) == (not known.all())
    return surface, known


@pytest.mark.long
@pytest.mark.parametrize("periodic", [False, True])
def test_a_file_may_say_that_heights_continue_periodically(tmp_path, periodic):
    """SurfaceTopography writes so; nothing else in the file or the scene would tell."""
    path = tmp_path / "map.nc"
    heights = 1e-4 * files.NUMBERS
    written = library().Topography(heights, (1.7, 4.6), unit="um", periodic=periodic)
    written.to_netcdf(str(path))
    surface = read_surface(path)
    assert surface.lengths == pytest.approx((1.7e-3, 4.6e-3), rel=SINGLE)
    assert periodic == any("continue periodically" in note for note in surface.notes)


@pytest.mark.long
@pytest.mark.parametrize("name", files.MAKERS)
def test_instruments_files(tmp_path, name):
    path = tmp_path / name
    path.write_bytes(files.MAKERS[name]())
    heights, lengths = expected(name)
    channel = 1 if name == "scan.mi" else None  # its default is a deflection
    surface, known = same_as_the_library(path, channel)
    np.testing.assert_array_equal(known, ~np.isnan(heights))
    np.testing.assert_allclose(surface.heights[known], heights[known], rtol=SINGLE)
    assert surface.lengths == pytest.approx(lengths, rel=SINGLE)
    if not known.all():
        with pytest.raises(InputError, match=r"1 of 35 heights are missing, .* index \(2, 1\)"):
            read_surface(path)


@pytest.mark.parametrize(
    ("kind", "missing"),
    [("<i2", -(2**15))]
    + [(kind, one) for kind in ("<f4", "<f8") for one in (np.nan, np.inf, -np.inf)]
    + [("<f4", s * np.finfo("f4").max) for s in (-1, 1)]
    + [("<f8", s * np.finfo("f8").max) for s in (-1, 1)],
)
def test_what_no_instrument_measures_is_missing(tmp_path, kind, missing):
    library()
    path = tmp_path / "scan.sdf"
    path.write_bytes(files.sdf_binary(kind, missing))
    heights, lengths = expected(path.name)
    with pytest.raises(InputError, match=r"1 of 35 heights are missing, .* index \(2, 1\)"):
        read_surface(path)
    surface, known = read_surface(path, missing="fill"), ~np.isnan(heights)
    np.testing.assert_allclose(surface.heights[known], heights[known], rtol=SINGLE)
    assert surface.lengths == pytest.approx(lengths)


def test_sdf_of_one_height_a_line(tmp_path):
    """It was refused, its first word taken for a damaged height."""
    library()
    head, body = files.sdf().decode().split("*", 1)
    path = tmp_path / "scan.sdf"
    path.write_text(head + "*\n" + "\n".join(body.split()) + "\n", encoding="ascii")
    heights, lengths = expected("scan.sdf")
    surface, known = same_as_the_library(path)
    np.testing.assert_array_equal(known, ~np.isnan(heights))
    np.testing.assert_allclose(surface.heights[known], heights[known], rtol=SINGLE)
    assert surface.lengths == pytest.approx(lengths)


@pytest.mark.parametrize("unit", [1e-6, 1.0])
def test_headers_of_nms_are_in_nm(tmp_path, unit):
    """SurfaceTopography takes them for mm and makes maps of metres."""
    library()
    path = tmp_path / "scan.nms"
    path.write_bytes(files.nms(unit))
    surface = read_surface(path)
    # a height is a sum of two of the range's ends
    np.testing.assert_allclose(surface.heights, expected("scan.mi")[0], rtol=0, atol=1e-15)
    assert surface.lengths == pytest.approx(expected("scan.mi")[1], rel=1e-12)
    assert any("this .nms are taken in nm" in note for note in surface.notes) == (unit < 1.0)


def test_maps_of_metres_are_refused(tmp_path):
    np.savetxt(
        tmp_path / "a.xyz", [(1e4 * i, 2e4 * j, 1e-3 * i * j) for i in range(9) for j in range(5)]
    )
    with pytest.raises(InputError, match=r"a map of 90 × 100 m: .*; lengths \(Lx, Ly\), wh"):
        read_surface(tmp_path / "a.xyz")
    assert read_surface(tmp_path / "a.xyz", lengths=(9.0, 10.0)).lengths == (9.0, 10.0)


@pytest.mark.parametrize(
    ("maker", "name", "flag", "value"),
    [(files.sur, "scan.sur", "inversion", one) for one in range(4)]
    + [(files.metropro, "scan.dat", "sign", one) for one in range(2)],
)
def test_maps_that_were_turned_over_are_noted(tmp_path, maker, name, flag, value):
    library()
    path = tmp_path / name
    path.write_bytes(maker(value))
    notes = read_surface(path, missing="fill").notes
    assert any(f"({flag} flag {value})" in note for note in notes) == bool(value)


@pytest.mark.parametrize("name", ["scan.datx", "renamed.h5"])
def test_fringes_of_datx_are_not_taken_for_heights(tmp_path, name):
    """The library's reader of HDF5 took them, with x and y exchanged."""
    import h5py

    library()
    path = tmp_path / name
    with h5py.File(path, "w") as file:
        file["Data/Surface/map"] = np.hypot.outer(np.arange(6.0), np.arange(5.0))
        file["Data/Surface/map"].attrs["Unit"] = np.array([b"Fringes"])
    with pytest.raises(InputError, match=r"those of this one may be in fringes"):
        read_surface(path, lengths=(7.0, 5.0), height_unit="um")


@pytest.mark.parametrize("word", ["---", "1.#QNAN", "n/a", "BAD"])
def test_rows_that_the_library_leaves_out_are_not_lost(tmp_path, word):
    """The other rows were stretched over the sides that the words before them state."""
    library()
    heights, _ = expected("scan.mi")
    rows = [[repr(float(one)) for one in line] for line in 1e6 * heights.T]
    rows[1][2] = word
    head = "Width: 14 um\nHeight: 15 um\nValue units: nm\n"
    path = tmp_path / "scan.txt"
    path.write_text(head + "\n".join(map(" ".join, rows)), encoding="utf-8")
    surface, known = read_surface(path, missing="fill"), heights != heights[2, 1]
    np.testing.assert_allclose(surface.heights[known], heights[known], rtol=1e-12)
    path.write_text(path.read_text("utf-8").replace(f" {word} ", " ? "), encoding="utf-8")
    with pytest.raises(InputError, match=r"line 5, column 3: '.' is no number"):
        read_surface(path, missing="fill")


def test_sdf_of_an_edition_that_is_not_known_is_no_matrix(tmp_path):
    library()
    path = tmp_path / "scan.sdf"
    text = files.sdf().decode().replace("aISO-1.0", "aISO-2.0").replace("BAD", "7")
    path.write_text(text.rstrip("*\n"), encoding="ascii")
    with pytest.raises(InputError, match="states no sides that SurfaceTopography knows"):
        read_surface(path, lengths=(0.014, 0.015), height_unit="nm")


def test_heights_of_a_stated_unit_are_not_asked_for_it(tmp_path):
    (tmp_path / "scan.txt").write_text(files.gwyddion_text("m", 1e-4), encoding="utf-8")
    with pytest.raises(InputError, match=r"so steep: the file states its heights in m; is that ri"):
        read_surface(tmp_path / "scan.txt")


@pytest.mark.parametrize("name", ["scan.nc", "scan.x3p", "scan.gwy"])
def test_files_of_the_formats_own_writers(tmp_path, name):
    heights, lengths = expected(name)
    masked = np.ma.masked_invalid(1e3 * heights)
    made = library().Topography(masked, tuple(1e3 * side for side in lengths), unit="µm")
    writers = {"scan.nc": "to_netcdf", "scan.x3p": "to_x3p", "scan.gwy": "to_gwy"}
    getattr(made, writers[name])(str(tmp_path / name))
    surface, known = same_as_the_library(tmp_path / name)
    np.testing.assert_array_equal(known, ~np.isnan(heights))
    np.testing.assert_allclose(surface.heights[known], heights[known], rtol=SINGLE)
    assert surface.lengths == pytest.approx(lengths, rel=SINGLE)
    assert any("1 heights lie below a mask" in note for note in surface.notes) == (
        name == "scan.gwy"
    )


@pytest.mark.parametrize(
    ("places", "hidden"), [((), []), ((files.GAP,), []), ((files.GAP, (3, 3), (4, 2)), ["2"])]
)
def test_heights_below_a_mask_are_counted_without_those_that_are_missing(tmp_path, places, hidden):
    library()
    marked = np.zeros((files.NX, files.NY), bool)
    for place in places:
        marked[place] = True
    (tmp_path / "scan.gwy").write_bytes(files.gwy(marked if places else None))
    surface, known = same_as_the_library(tmp_path / "scan.gwy")
    np.testing.assert_array_equal(known, ~(marked | np.isnan(expected("scan.gwy")[0])))
    notes = [note.split()[0] for note in surface.notes if "heights lie below a mask" in note]
    assert notes == hidden


def test_a_unit_whose_utf8_was_taken_for_latin1_is_known(tmp_path):
    """As surfalize writes it: the others read 'Âµm'."""
    library()
    found = []
    for encoding in ("latin-1", "utf-8"):
        path = tmp_path / f"{encoding}.sur"
        path.write_bytes(files.sur(unit="µm", encoding=encoding))
        found.append(read_surface(path, missing="fill"))
    assert found[0].lengths == found[1].lengths
    np.testing.assert_array_equal(found[0].heights, found[1].heights)


@pytest.mark.parametrize("suffix", ["", ".txt", ".xyz", ".bin"])
def test_the_content_tells_the_format(tmp_path, suffix):
    library()
    path = tmp_path / f"scan{suffix}"
    path.write_bytes(files.sur())
    assert read_surface(path, missing="fill").grid == (files.NX, files.NY)


def test_channels(tmp_path):
    library()
    path = tmp_path / "scan.mi"
    path.write_bytes(files.mi())
    heights = files.UNIT * files.NUMBERS
    for channel in (None, "Topography", 1):  # the first channel of heights by default
        surface = read_surface(path, channel=channel)
        np.testing.assert_allclose(surface.heights, heights, rtol=SINGLE)
        assert surface.source == f"{path}, channel 'Topography'"
    with pytest.raises(InputError, match=r"no such channel: 'Höhe' .*0 'Deflection', 1 'Topogr"):
        read_surface(path, channel="Höhe")
    with pytest.raises(InputError, match="the channel 'Deflection' holds deflection, no heights"):
        read_surface(path, channel=0)


def test_lengths_are_passed_on_to_formats_without(tmp_path):
    from scipy.io import savemat

    library()
    savemat(tmp_path / "scan.mat", {"heights": 1e-3 * files.NUMBERS})
    with pytest.raises(InputError, match="no sides in a unit of length, they must be given"):
        read_surface(tmp_path / "scan.mat")
    surface = read_surface(tmp_path / "scan.mat", lengths=(0.7, 0.5), height_unit="um")
    assert surface.lengths == (0.7, 0.5)
    assert np.ptp(surface.heights) == pytest.approx(1e-6 * np.ptp(files.NUMBERS))
    assert surface.source.endswith("heights taken in µm")


def test_sides_without_a_unit_are_none(tmp_path):
    made = library().Topography(1e-4 * files.NUMBERS, (0.7, 0.5))
    made.to_netcdf(str(tmp_path / "scan.nc"))
    with pytest.raises(InputError, match="no sides in a unit of length, they must be given"):
        read_surface(tmp_path / "scan.nc")
    assert read_surface(tmp_path / "scan.nc", lengths=(0.7, 0.5)).lengths == (0.7, 0.5)


@pytest.mark.parametrize("title", ["", "H", "Hö", "Höh"])  # one to four zeros after the header
def test_simple_fields_need_no_library(tmp_path, title):
    path, (heights, lengths) = tmp_path / "scan.gsf", expected("scan.gsf")
    path.write_bytes(files.gsf(Title=title))
    surface, known = read_surface(path, missing="fill"), ~np.isnan(heights)
    np.testing.assert_allclose(surface.heights[known], heights[known], rtol=SINGLE)
    assert surface.lengths == pytest.approx(lengths, rel=1e-13)
    with pytest.raises(InputError, match=r"1 of 35 heights are missing, .* index \(2, 1\)"):
        read_surface(path)


def test_simple_fields_state_units_or_are_asked_for_them(tmp_path):
    path, (heights, lengths) = tmp_path / "scan.dat", expected("scan.gsf")  # its content tells
    path.write_bytes(files.gsf(XReal=14.0, YReal=15.0, XYUnits="µm", ZUnits=None))
    surface, known = read_surface(path, missing="fill", height_unit="m"), ~np.isnan(heights)
    np.testing.assert_allclose(surface.heights[known], heights[known], rtol=SINGLE)
    assert surface.lengths == pytest.approx(lengths, rel=1e-13)
    for left_out in ("XReal", "XYUnits"):
        path.write_bytes(files.gsf(**{left_out: None}))
        with pytest.raises(InputError, match="no sides in a unit of length, they must be given"):
            read_surface(path)
        assert read_surface(path, lengths=(0.2, 0.3), missing="fill").lengths == (0.2, 0.3)


@pytest.mark.parametrize(
    ("stated", "cut", "said"),
    [
        ({"ZUnits": "V"}, None, "is no unit of heights: 'V'"),
        ({"XYUnits": "s"}, None, r"states no sides: \['1.4\S*', '1.5\S*', 's'\]"),
        ({"XReal": "wide"}, None, "states no sides"),
        ({"XReal": "nan"}, None, "scan.gsf"),
        ({"XRes": "7.5"}, None, r"states no numbers of heights: \['7.5', '5'\]"),
        ({"YRes": None}, None, "states no numbers of heights"),
        ({"YRes": 6}, None, r"140 bytes follow .* \(allowed: 168, of 7 × 6 heights\)"),
        ({}, -1, "139 bytes follow"),
        ({}, 40, "states no numbers of heights"),
    ],
)
def test_simple_fields_that_are_none_are_refused(tmp_path, stated, cut, said):
    path = tmp_path / "scan.gsf"
    path.write_bytes(files.gsf(**stated)[:cut])
    with pytest.raises(InputError, match=said):
        read_surface(path, missing="fill")


@pytest.mark.parametrize("words", [("Channel", "Width", "Height"), ("Kanal", "Breite", "Höhe")])
def test_text_exports_state_unit_and_size(tmp_path, words):
    path = tmp_path / "scan.txt"
    path.write_text(files.gwyddion_text(words=words), encoding="utf-8")
    surface = read_surface(path)
    np.testing.assert_allclose(surface.heights, files.UNIT * files.NUMBERS, rtol=1e-13)
    assert surface.lengths == pytest.approx((0.014, 0.015))
    with pytest.raises(InputError, match="states its heights in m, height_unit says um"):
        read_surface(path, height_unit="um")
    same_as_the_library(path)


def test_profiles_are_refused_as_profiles(tmp_path):
    made = library().UniformLineScan(np.arange(9.0), 9.0, unit="um")
    made.to_netcdf(str(tmp_path / "profile.nc"))
    with pytest.raises(InputError, match=r"profile\.nc: the file holds a profile, not a surface"):
        read_surface(tmp_path / "profile.nc")


def test_what_no_reader_knows(tmp_path, caplog):
    """What readers log while they try is no message of ours."""
    library()
    (tmp_path / "scan.dat").write_bytes(bytes(range(256)) * 4)  # Igor's reader logs an error
    with pytest.raises(InputError, match=r"scan\.dat: SurfaceTopography cannot read it: Cannot"):
        read_surface(tmp_path / "scan.dat")
    assert not caplog.records
    (tmp_path / "scan.opd").write_bytes(b"\0")
    with pytest.raises(InputError, match=r"scan\.opd: SurfaceTopography cannot read it: Cannot"):
        read_surface(tmp_path / "scan.opd")


@pytest.mark.parametrize("name", ["scan.opd", "scan.dat"])
def test_without_the_library_the_formats_and_the_option_are_named(monkeypatch, tmp_path, name):
    monkeypatch.setitem(sys.modules, "SurfaceTopography", None)  # an import of None fails
    (tmp_path / name).write_bytes(b"\0")
    with pytest.raises(
        InputError, match=r"\./setup\.sh --instruments .*patchlaw\[instruments\].*\.xyz"
    ):
        read_surface(tmp_path / name)
    rows = "Instrument,ACME 3000\n" + "1,2,4,3\n2,4,8,5\n3,5,9,1\n4,1,3,2\n"
    (tmp_path / "scan.csv").write_text(rows, encoding="utf-8")
    with pytest.raises(
        InputError, match=r"numbers stand below words.* # before each line of words"
    ):
        read_surface(tmp_path / "scan.csv", lengths=(1.0, 1.0))
    (tmp_path / "scan.csv").write_text(f"# {rows}", encoding="utf-8")
    assert read_surface(tmp_path / "scan.csv", lengths=(9.0, 9.0), height_unit="um").grid == (4, 4)


def test_files_without_a_channel_that_is_known(tmp_path):
    """It said "list index out of range"."""
    from scipy.io import savemat

    library()
    savemat(tmp_path / "scan.mat", {"word": "none"})
    with pytest.raises(InputError, match="SurfaceTopography knows no channel of this file"):
        read_surface(tmp_path / "scan.mat", channel=2)
