"""A scene takes heights in memory, as it takes them from a file."""

import json

import numpy as np
import pytest

from patchlaw.multiscale import Scene, run
from patchlaw.multiscale.scene.surfaces import make_surface
from patchlaw.support import InputError


def scene(heights, **surface):
    return Scene.from_dict({
        "surface": {"heights": heights, "lengths": ["1 mm", "0.5 mm"], **surface},
        "block": {"young_modulus": "4 GPa", "poisson_ratio": 0.3}, "micro": {"model": "half-space"},
        "coupling": {"kind": "analytic"}, "load": {"approach": "2 um", "steps": 2},
        "output": {"check": "none"},
    })  # fmt: skip


@pytest.fixture
def heights():
    x, y = np.meshgrid(np.arange(24) + 0.5, np.arange(12) + 0.5, indexing="ij")
    return 0.01 * np.sin(0.7 * x) * np.cos(0.5 * y) + 2e-3 * np.sin(0.2 * x + 0.4)


def test_heights_are_pressed_as_those_of_a_file(heights, tmp_path):
    np.save(tmp_path / "map.npy", heights)
    file = scene(heights).with_({"surface.file": str(tmp_path / "map.npy")})
    assert file.surface.heights is None
    np.testing.assert_array_equal(run(scene(heights)).force_N, run(file).force_N)


def test_heights_have_a_unit_and_are_prepared(heights):
    forces = run(scene(heights, detrend="plane")).force_N
    tilted = 1e3 * (heights + 1e-3 * np.arange(24)[:, None])
    gap = tilted.copy()
    gap[3, 4] = np.nan
    other = scene(tilted, height_unit="um", detrend="plane")
    np.testing.assert_allclose(run(other).force_N, forces, rtol=1e-9)
    with pytest.raises(InputError, match=r"surface.heights.*heights are missing"):
        run(scene(gap, height_unit="um"))
    run(scene(gap, height_unit="um", missing="fill", detrend="plane"))


def test_what_a_mask_hides_is_missing(heights):
    masked = np.ma.array(heights, mask=False)
    masked.data[3, 4] = 0.9  # junk, 0.89 mm above all others
    masked[3, 4] = np.ma.masked
    gap = masked.filled(np.nan)
    with pytest.raises(InputError, match=r"surface.heights.*1 of 288 heights are missing"):
        run(scene(masked))
    force = run(scene(masked, missing="fill")).force_N
    np.testing.assert_array_equal(force, run(scene(gap, missing="fill")).force_N)
    assert scene(masked) == scene(gap) != scene(masked.data)


def test_the_counter_surface_keeps_its_mask_and_may_be_swapped(heights):
    masked = np.ma.array(heights, mask=False)
    masked[3, 4] = np.ma.masked
    other = {"heights": masked, "lengths": ["1 mm", "0.5 mm"]}
    with pytest.raises(InputError, match=r"counter_surface.heights.*1 of 288 heights are missing"):
        make_surface(scene(heights).with_({"counter_surface": other}))
    turned = {"heights": heights.T, "lengths": ["1 mm", "0.5 mm"], "swap_xy": True}
    whole = {**other, "heights": heights}
    both = [
        make_surface(scene(heights).with_({"counter_surface": one})).heights
        for one in (turned, whole)
    ]
    np.testing.assert_array_equal(*both)


def test_scenes_are_equal_when_their_heights_are(heights):
    assert scene(heights) == scene(heights.copy())
    assert scene(heights) != scene(heights + 1e-6)
    assert scene(heights.tolist()) == scene(heights)
    text = json.dumps(scene(heights).to_dict())
    assert "(24, 12) float64" in text
    assert text != json.dumps(scene(heights + 1e-6).to_dict())


@pytest.mark.parametrize(("value", "problem"), [
    ([1.0, 2.0], "surface.heights.*is no map of heights"),
    ([["a", "b"]], "surface.heights.*not an array of real numbers"),
    (np.zeros((2, 2, 2)), "is no map of heights"),
])  # fmt: skip
def test_what_is_no_map_is_refused(value, problem):
    with pytest.raises(InputError, match=problem):
        scene(value)


def test_heights_bring_their_grid(heights):
    with pytest.raises(InputError, match="have their own grid"):
        scene(heights, grid=[24, 12])
    with pytest.raises(InputError, match="exactly one source"):
        scene(heights, file="map.npy")
    with pytest.raises(InputError, match="need 'lengths'"):
        scene(heights, lengths=None)
