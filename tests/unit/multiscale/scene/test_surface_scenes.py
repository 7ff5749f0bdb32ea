"""Surfaces as scenes describe them: files, units, preparation, periodic contact."""

from pathlib import Path

import numpy as np
import pytest

from patchlaw.geometry import Control, Spectrum, synthesise
from patchlaw.micro import HalfSpaceModel
from patchlaw.multiscale import Scene, make_setup, run
from patchlaw.support import InputError

PAPER = Path(__file__).parents[4] / "demos" / "scenes" / "paper.toml"
SMALL_SLOPES = ["micro.finite_slopes=false", "load.steps=2", "output.check=none"]
PERIODIC = ["surface.periodic=true", "coupling.kind=analytic", "micro.model=half-space"]


def test_a_map_is_prepared_as_the_scene_says(tmp_path):
    np.save(tmp_path / "scan.npy", 10.0 * np.random.default_rng(1).random((40, 40)))
    section = {
        "file": str(tmp_path / "scan.npy"), "lengths": ["1 mm", "1 mm"], "height_unit": "um",
        "crop": {"x": ["0.1 mm", "0.9 mm"]}, "detrend": "plane",
        "filter": {"short": "100 um", "long": "500 um"}, "resample": [16, 20],
    }  # fmt: skip
    block = {"young_modulus": "4 GPa", "poisson_ratio": 0.3}
    rest = {"block": block, "patches": {"grid": [2, 2]}, "load": {"approach": "1 um"}}
    surface = make_setup(Scene.from_dict({"surface": section, **rest})).parts.surface
    assert surface.grid == (16, 20) and surface.lengths == (pytest.approx(0.8), 1.0)
    for done in ("taken in µm", "cropped to 800 × 1000 µm", "its plane removed", "below 100 µm"):
        assert done in surface.source
    with pytest.raises(InputError, match=r"surface.filter.short = 0.01: the short cut-off"):
        changed = {**section, "filter": {"short": "10 um"}}
        make_setup(Scene.from_dict({"surface": changed, **rest}))


def test_missing_heights_are_no_value_of_the_file_key(tmp_path):
    heights = np.zeros((8, 8))
    heights[3, 1] = np.nan
    np.save(tmp_path / "scan.npy", heights)
    data = {"file": str(tmp_path / "scan.npy"), "lengths": [1.0, 1.0]}
    block = {"young_modulus": 4e3, "poisson_ratio": 0.3}
    scene = Scene.from_dict({"surface": data, "block": block, "load": {"approach": 1e-3}})
    text = r"scan\.npy: surface\.file: 1 of 64 heights are missing, the first at index \(3, 1\)"
    with pytest.raises(InputError, match=text):
        make_setup(scene)


def test_a_periodic_scene_is_pressed_periodically():
    scene = Scene.load(PAPER, [*PERIODIC, "surface.grid=[32, 32]"])
    setup = make_setup(scene)
    assert setup.parts.micro.name == "half-space-periodic"
    small = run(Scene.load(PAPER, [*PERIODIC, "surface.grid=[32, 32]", *SMALL_SLOPES]))
    alone = HalfSpaceModel(setup.parts.surface, contact_modulus=4e3 / (1 - 0.15**2), periodic=True)
    forces = [alone.press(Control(approach=approach)).force for approach in small.approach_mm]
    np.testing.assert_allclose(small.force_N, forces, rtol=1e-7)  # ten times the tolerance


def test_a_periodic_surface_is_pressed_within_its_gap(tmp_path):
    surface = make_setup(Scene.load(PAPER)).parts.surface
    gap = surface.highest - surface.mean_height
    within = Scene.load(PAPER, [*PERIODIC, f"load.approach=[{0.999 * gap}, 0.001]"])
    make_setup(within)
    beyond = Scene.load(PAPER, [*PERIODIC, f"load.approach=[{gap}, 0.001]"])
    with pytest.raises(
        InputError, match=r"paper.toml: load.approach = .* mm.\]: leaves no gap .* load.force\)"
    ):
        make_setup(beyond)
    make_setup(beyond.with_({"micro.hardness": "1 GPa"}))  # which lets cells yield instead


def test_further_maps_are_samples_like_seeds(tmp_path):
    """Maps of the surfaces that seeds draw are the same samples, and are read like any file."""
    spectrum = {"hurst": 0.8, "waves": [2, 5], "rms_slope": 0.1}
    extent = {"grid": [24, 24], "lengths": [1.0, 1.0]}
    for seed in (1, 2, 3):
        drawn = synthesise(Spectrum(**spectrum, seed=seed), **extent)
        np.save(tmp_path / f"{seed}.npy", 1e3 * drawn.heights)
    maps = {"file": "1.npy", "height_unit": "um", "periodic": True, **extent}
    law = {"kind": "representative"}
    rest = {
        "block": {"young_modulus": 4e3, "poisson_ratio": 0.3, "lengths": [9, 9], "height": 9},
        "load": {"pressure": 1.0},
    }

    def setup(surface, **samples):
        data = {"surface": surface, "law": law | samples, **rest}
        return make_setup(Scene.from_dict(data, source=tmp_path / "scene.toml"))

    found = setup(maps, samples=["2.npy", "3.npy"]).parts.samples[0].surfaces
    drawn = setup({"spectrum": spectrum, **extent}, seeds=[1, 2, 3]).parts.samples[0].surfaces
    for one, other in zip(found, drawn, strict=True):
        np.testing.assert_allclose(one.heights, other.heights, rtol=1e-14, atol=1e-17)
    with pytest.raises(InputError, match=r"none.npy: law.samples: there is no such file"):
        setup(maps, samples=["none.npy"])


def test_a_map_named_twice_hides_the_scatter(tmp_path):
    """Copies of a file are found by their heights."""
    heights = 1e-3 * np.random.default_rng(5).random((16, 16))
    for name in ("one", "two", "copy"):
        np.save(tmp_path / f"{name}.npy", heights + (1e-4 * heights**2 if name == "two" else 0.0))
    data = {
        "surface": {"file": "one.npy", "lengths": [1.0, 1.0], "height_unit": "um"},
        "block": {"young_modulus": 4e3, "poisson_ratio": 0.2, "lengths": [5.0, 5.0]},
        "load": {"pressure": 1.0},
    }

    def setup(*samples):
        law = {"kind": "representative", "samples": list(samples)}
        return make_setup(Scene.from_dict({**data, "law": law}, source=tmp_path / "scene.toml"))

    assert len(setup("two.npy").parts.samples[0].surfaces) == 2
    for samples, text in (
        (["one.npy"], r"law.samples = 'one.npy': has the heights of 'one.npy'"),
        (["two.npy", "copy.npy"], r"law.samples = 'copy.npy': has the heights of 'one.npy', which"),
        (["two.npy", "two.npy"], r"law.samples = 'two.npy': has the heights of 'two.npy', which"),
    ):
        with pytest.raises(InputError, match=text):
            setup(*samples)
