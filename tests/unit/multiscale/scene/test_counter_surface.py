"""How the counter-surface of a scene lies on the surface: shifted, turned, as an ensemble."""

import numpy as np
import pytest

from patchlaw.geometry import Spectrum, facing, synthesise, turned_over
from patchlaw.multiscale import Scene, make_setup, run, sweep
from patchlaw.multiscale.scene.surfaces import make_surfaces


def side(seed, lengths=(1.0, 1.0), periodic=False):
    spectrum = {"hurst": 0.9, "waves": [2, 5], "rms_slope": 0.1, "seed": seed}
    return {"spectrum": spectrum, "grid": [20, 20], "lengths": [*lengths], "periodic": periodic}


def scene(periodic=False, lengths=(1.0, 1.0), counter=None, slopes=False, **above):
    return Scene.from_dict(
        {
            "surface": side(1, lengths, periodic),
            "counter_surface": {**(counter or side(2, lengths, periodic)), **above},
            "counter_body": {"young_modulus": "1 GPa", "poisson_ratio": 0.3},
            "block": {"young_modulus": "4 GPa", "poisson_ratio": 0.15},
            "micro": {"finite_slopes": slopes},
            "coupling": {"kind": "analytic"},
            "load": {"approach": "4 um", "steps": 1},
            "output": {"check": "none", "figures": False},
        }
    )


def surfaces():
    return (
        synthesise(
            Spectrum(hurst=0.9, waves=(2, 5), rms_slope=0.1, seed=seed),
            grid=(20, 20),
            lengths=(1.0, 1.0),
        )
        for seed in (1, 2)
    )


def test_shift_and_quarter_turns_move_the_heights_as_they_are():
    first, second = surfaces()
    laid = turned_over(second).heights
    whole, above = make_surfaces(scene(shift=["100 um", "-50 um"], rotation="90 deg"))
    moved = np.roll(np.rot90(laid), (2, -1), axis=(0, 1))
    np.testing.assert_array_equal(above.heights, moved)
    np.testing.assert_array_equal(whole.heights, first.heights + moved)
    np.testing.assert_array_equal(
        make_surfaces(scene())[0].heights, facing(first, turned_over(second)).heights
    )


def test_a_shift_of_both_periodic_sides_changes_nothing():
    """Moving the upper side by (s, t) is moving the lower one by (−s, −t)."""
    (moved,) = run(scene(periodic=True, shift=["300 um", "0.45 mm"]))
    first, _ = surfaces()
    heights = np.roll(first.heights, (-6, -9), axis=(0, 1))
    other = side(2, periodic=True)
    below = {"heights": heights, "lengths": [1.0, 1.0], "periodic": True}
    (back,) = run(
        Scene.from_dict({**scene(periodic=True, counter=other).written, "surface": below})
    )
    assert moved.force_N == pytest.approx(back.force_N, rel=1e-8)


def test_the_plan_says_how_they_lie_and_whose_slopes_count():
    said = dict(
        make_setup(scene(slopes=True, shift=["100 um", "0"], rotation="180 deg")).about.statements()
    )
    assert "turned by 180°, moved by 100 µm and 0 µm" in said["two rough sides"]
    assert "the slopes of each count on its own body" in said["two rough sides"]
    rigid = scene(slopes=True).written
    rigid = {key: value for key, value in rigid.items() if key != "counter_body"}
    said = dict(make_setup(Scene.from_dict(rigid)).about.statements())
    assert "the slopes of [surface] alone count" in said["two rough sides"]


def test_many_shifts_are_an_ensemble():
    shifts = [["0 mm", "0 mm"], ["250 um", "0 mm"], ["0 mm", "250 um"]]
    found = sweep(scene(), {"counter_surface.shift": shifts})
    assert found.force_N.shape == (3, 1)
    (alone,) = run(scene(shift=shifts[1]))
    assert found.force_N[1, 0] == pytest.approx(alone.force_N, rel=1e-12)
    assert np.unique(found.force_N.round(6)).size == 3
