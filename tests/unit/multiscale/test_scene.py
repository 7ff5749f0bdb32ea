"""Reading scenes: what is accepted, and the words with which the rest is refused."""

import re
from pathlib import Path

import pytest

from geometry.errors import InputError
from multiscale.scene import Scene

PAPER = Path(__file__).parents[3] / "demos" / "scenes" / "paper.toml"

REFUSED = {
    "unknown key": ("block.young=3", "block.young: unknown key; did you mean 'young_modulus'?"),
    "unknown section": ("bloc.height=3", "bloc: unknown key; did you mean 'block'?"),
    "unknown nested key": ("surface.spectrum.hurt=1", "surface.spectrum.hurt: unknown key"),
    "negative modulus": ("block.young_modulus=-4", "block.young_modulus = -4: must be greater"),
    "impossible unit": ("block.young_modulus='4 kg'", "'4 kg': has the wrong unit (allowed: a"),
    "unknown unit": ("load.approach='8 foo'", "'8 foo': cannot be read as a quantity"),
    "no unit": ("load.approach='8'", "load.approach = '8': has no unit"),
    "not finite": ("load.approach=nan", "load.approach = nan: is not finite"),
    "bool for a number": ("load.approach=true", "load.approach = True: is not a quantity"),
    "negative approach": ("load.approach=-1", "load.approach = -1: must be greater than 0"),
    "poisson ratio 0.5": (
        "block.poisson_ratio=0.5",
        "block.poisson_ratio = 0.5: must be less than",
    ),
    "poisson ratio -1": (
        "block.poisson_ratio=-1",
        "block.poisson_ratio = -1: must be greater than",
    ),
    "wrong type": ("load.steps='x'", "load.steps = 'x': must be a valid integer"),
    "bool for a ratio": ("block.poisson_ratio=false", "block.poisson_ratio = False: is not a"),
    "text for a ratio": ("block.poisson_ratio='\"0.2\"'", "block.poisson_ratio = "),
    "text for a flag": ("output.figures=no", "output.figures = 'no': must be a valid boolean"),
    "fraction for an integer": ("load.steps=1.5", "load.steps = 1.5: must be a valid integer"),
    "no patches": ("patches.grid=[0, 4]", "patches.grid.0 = 0: must be greater than or equal to 1"),
    "short grid": ("patches.grid=[4]", "patches.grid.1: is required and missing"),
    "not a section": ("block=3", "block = 3: must be a section"),
    "unknown coupling": ("coupling.kind='magic'", "coupling.kind = 'magic': must be 'isolated' or"),
    "two sources": ("surface.file='a.npy'", "surface: needs exactly one source"),
    "two amplitudes": ("surface.spectrum.rms_height=1", "surface.spectrum: "),
    "empty band": ("surface.spectrum.waves=[10, 2]", "waves is not a band"),
}


@pytest.mark.parametrize(("override", "text"), REFUSED.values(), ids=REFUSED)
def test_refusal_names_file_key_and_value(override, text):
    with pytest.raises(InputError, match=re.escape(str(PAPER)) + ".*" + re.escape(text)):
        Scene.load(PAPER, [override])


def test_override_needs_an_equals_sign():
    with pytest.raises(InputError, match=r"'load.steps': is not an override .allowed: --set key=v"):
        Scene.load(PAPER, ["load.steps"])


def test_override_of_a_value_as_section():
    with pytest.raises(InputError, match="'approach' is not a section"):
        Scene.load(PAPER, ["load.approach.x=3"])


@pytest.mark.parametrize(
    ("content", "text"),
    [
        (b"[load\n", "is not valid TOML"),
        (b"\xff\xfe\x00", "is not UTF-8 text"),
        (b"[surface]\n", "surface: needs exactly one source"),
        (b"", "surface: is required and missing"),
    ],
)
def test_unreadable_file(tmp_path, content, text):
    path = tmp_path / "scene.toml"
    path.write_bytes(content)
    with pytest.raises(InputError, match=re.escape(str(path)) + ": " + text):
        Scene.load(path)


def test_missing_file(tmp_path):
    with pytest.raises(InputError, match=r"nowhere.toml: cannot be read: No such file"):
        Scene.load(tmp_path / "nowhere.toml")


@pytest.mark.parametrize(
    ("override", "value"),
    [("'8 um'", 8e-3), ("'0.008 mm'", 8e-3), ("8e-3", 8e-3), ("8 µm", 8e-3), ("'8e-6 m'", 8e-3)],
)
def test_quantities_become_millimetres(override, value):
    scene = Scene.load(PAPER, [f"load.approach={override}"])
    # one rounding of the unit's factor
    assert scene.loading.approach == pytest.approx(value, rel=1e-15)


def test_stress_and_slope_units():
    scene = Scene.load(PAPER, ["block.young_modulus='4e9 Pa'", "load.tilt=['5 um/mm', 0]"])
    assert scene.block.young_modulus == pytest.approx(4000.0, rel=1e-15)  # one rounding
    assert scene.loading.tilt == pytest.approx((5e-3, 0.0), rel=1e-14)  # one rounding


def test_paths_start_in_the_folder_of_the_scene(tmp_path):
    path = tmp_path / "scene.toml"
    text = PAPER.read_text(encoding="utf-8").replace("spectrum = {", 'file = "scan.npy" # {')
    path.write_text(text, encoding="utf-8")
    assert Scene.load(path).surface_path == tmp_path / "scan.npy"


def test_scene_is_frozen():
    with pytest.raises(ValueError, match="frozen"):
        Scene.load(PAPER).loading.steps = 3


def test_schema_knows_every_section():
    schema = Scene.model_json_schema(by_alias=True)
    assert {"surface", "block", "patches", "micro", "coupling", "load"} <= set(schema["properties"])
    assert schema["additionalProperties"] is False
