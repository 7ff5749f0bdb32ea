"""A new scene says what it does, and its force makes contact on about a fiftieth of the surface."""

import tomllib

import pytest

from patchlaw.geometry import Control, Material, Spectrum, synthesise
from patchlaw.micro import HalfSpaceModel
from patchlaw.multiscale import Scene
from patchlaw.multiscale.cli.init import (
    CONTACT_AREA,
    START,
    SYNTHESISED,
    UNUSED,
    findings,
    scene_text,
    sensible_force,
)
from patchlaw.multiscale.scene.schema import scene_keys
from patchlaw.support.quantities import parse_quantity

DATA = {**START, "surface": SYNTHESISED, "load": {"steps": 8, "force": "2 N"}}


def test_text_is_the_scene_again_with_every_key_explained():
    text = scene_text(DATA, ["A remark.", "Another."])
    assert tomllib.loads(text) == DATA
    Scene.from_dict(tomllib.loads(text))
    words = " ".join(text.replace("# ", "").split())
    assert words.startswith("A remark. # Another.")
    for section, keys in DATA.items():
        for key in keys:
            assert scene_keys()[f"{section}.{key}"].meaning in words
    assert max(map(len, text.splitlines())) <= 100


def test_odd_file_names_survive():
    data = {"surface": {"file": 'a "b" \\ c\t# µ.npy'}}
    assert tomllib.loads(scene_text(data, [])) == data


@pytest.mark.parametrize(("seed", "slope", "modulus"), [(1, 0.1, 210e3), (2, 0.02, 3e3)])
def test_force_makes_the_contact_area_that_it_says(seed, slope, modulus):
    """The area is that of the contact problem: within the single digit and Persson's factor."""
    spectrum = Spectrum(hurst=0.8, waves=(4, 32), rms_slope=slope, seed=seed)
    surface = synthesise(spectrum, grid=(128, 128), lengths=(0.5, 0.5))
    material = Material(young_modulus=modulus, poisson_ratio=0.3)
    force = parse_quantity(sensible_force(surface, material), "N")
    model = HalfSpaceModel(surface=surface, contact_modulus=material.contact_modulus)
    area = model.press(Control(force=force)).contact_area / surface.area
    assert area == pytest.approx(CONTACT_AREA, rel=0.6)


def test_a_level_surface_has_a_force_too():
    spectrum = Spectrum(hurst=0.8, waves=(2, 4), rms_slope=0.1, seed=1)
    level = synthesise(spectrum, grid=(16, 16), lengths=(1.0, 1.0))
    level = type(level)(heights=0.0 * level.heights, lengths=(1.0, 1.0))
    assert sensible_force(level, Material(young_modulus=1e3, poisson_ratio=0.3)) == "1 N"


def test_findings_are_grid_sides_and_roughness():
    spectrum = Spectrum(hurst=0.8, waves=(2, 8), rms_slope=0.1, seed=1)
    surface = synthesise(spectrum, grid=(32, 32), lengths=(0.02, 0.03))
    text = " ".join(findings(surface))
    assert "32 × 32 heights on 20 µm × 30 µm" in text
    assert "rms gradient 0.0993" in text  # of the spline, where a wave has four heights


UNUSED_KEYS = [(section, key) for section, keys in UNUSED.items() for key in keys]


@pytest.mark.parametrize(("section", "key"), UNUSED_KEYS, ids=str)
def test_what_is_not_used_is_a_comment_that_can_be_used(section, key):
    data = dict(DATA)
    if section in data:
        data[section] = {name: value for name, value in data[section].items() if name != key}
    lines = scene_text(data, []).splitlines()
    (place,) = [number for number, line in enumerate(lines) if line.startswith(f"# {key} = ")]
    lines[place] = lines[place].removeprefix("# ")
    if section not in data:
        lines[lines.index(f"# [{section}]")] = f"[{section}]"
    used = tomllib.loads("\n".join(lines))
    assert used[section][key] == UNUSED[section][key]
    Scene.from_dict(used)


def test_all_that_is_not_used_can_be_used_together():
    sections = {name: DATA.get(name, {}) | UNUSED.get(name, {}) for name in DATA | UNUSED}
    assert tomllib.loads(scene_text(sections, [])) == sections
    Scene.from_dict(sections)
