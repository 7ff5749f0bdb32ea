import sys
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest

from geometry import InputError, read_surface

HEIGHTS = np.random.default_rng(0).normal(size=(5, 4))


def install(monkeypatch, read):
    """Put a stand-in with SurfaceTopography's interface in its place."""
    library = ModuleType("SurfaceTopography")
    library.read_topography = read
    monkeypatch.setitem(sys.modules, "SurfaceTopography", library)


def topography(heights, *, unit="um", dim=2):
    def to_unit(name):
        assert name == "mm"
        return SimpleNamespace(heights=lambda: heights * 1e-3, physical_sizes=(0.5, 0.4))

    return SimpleNamespace(dim=dim, unit=unit, to_unit=to_unit)


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "scan.opd"
    path.write_bytes(b"\0")
    return path


def test_heights_and_lengths_arrive_in_mm(monkeypatch, file):
    install(monkeypatch, lambda path: topography(HEIGHTS))
    surface = read_surface(file)
    np.testing.assert_array_equal(surface.heights, HEIGHTS * 1e-3)
    assert surface.lengths == (0.5, 0.4)


def test_points_that_the_instrument_missed_are_reported(monkeypatch, file):
    masked = np.ma.masked_array(HEIGHTS, mask=HEIGHTS > 1.0)
    install(monkeypatch, lambda path: topography(masked))
    with pytest.raises(InputError, match=rf"{(HEIGHTS > 1.0).sum()} of 20 heights are not finite"):
        read_surface(file)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (topography(HEIGHTS, dim=1), "1: the file holds a profile"),
        (topography(HEIGHTS, unit=None), "the file does not state the unit"),
    ],
)
def test_files_that_are_not_enough_are_refused(monkeypatch, file, content, message):
    install(monkeypatch, lambda path: content)
    with pytest.raises(InputError, match=rf"scan\.opd: {message}"):
        read_surface(file)


@pytest.mark.parametrize(
    ("text", "message"),
    [("truncated", "SurfaceTopography cannot read it: trunc"), ("a\nb", "read it: OSError")],
)
def test_errors_of_the_library_are_passed_on_in_one_line(monkeypatch, file, text, message):
    def fail(path):
        raise OSError(text)

    install(monkeypatch, fail)
    with pytest.raises(InputError, match=message):
        read_surface(file)


def test_without_the_library_the_formats_and_the_extra_are_named(monkeypatch, file):
    monkeypatch.setitem(sys.modules, "SurfaceTopography", None)  # an import of None fails
    message = r"\.opd is not known here; instruments' formats need .*patchlaw\[instruments\].*\.xyz"
    with pytest.raises(InputError, match=message):
        read_surface(file)
