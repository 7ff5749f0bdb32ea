"""Two elastic bodies in contact: pairs that are known from one body against a rigid plane."""

import numpy as np
import pytest
from helpers.laws_on_mesh import lay_on_mesh

from patchlaw.geometry import Spectrum, synthesise
from patchlaw.multiscale import Scene, run

SURFACE = synthesise(
    Spectrum(hurst=0.9, waves=(2, 4), rms_slope=0.2, seed=3), grid=(16, 20), lengths=(1.0, 1.2)
)
E, NU = 4000.0, 0.15
APPROACH = 0.006
SMALL = {"micro": {"finite_slopes": False}}


def pressed(*, heights=SURFACE.heights, modulus=E, second=None, other=None, **sections):
    """Run a scene to one approach in two steps; without error checks and figures."""
    lengths = list(SURFACE.lengths)
    data = {
        "surface": {"heights": heights, "lengths": lengths},
        "block": {"young_modulus": modulus, "poisson_ratio": NU},
        "coupling": {"kind": "analytic"},
        "load": {"approach": APPROACH, "steps": 2},
        "output": {"figures": False, "report": False, "check": "none", "contact": "none"},
    }
    if second is not None:
        data["counter_body"] = {"young_modulus": second, "poisson_ratio": NU}
    if other is not None:
        data["counter_surface"] = {"heights": other, "lengths": lengths}
    return run(Scene.from_dict(data | sections))


def forces(**changes):
    return pressed(**changes).force_N


@pytest.mark.parametrize("model", ["half-space", "elliptic"])
def test_two_identical_half_spaces_are_one_of_half_the_modulus(model):
    micro = {"micro": {"model": model, "finite_slopes": False}}
    two, one = forces(second=E, **micro), forces(modulus=0.5 * E, **micro)
    assert one[-1] > 0.0
    assert two == pytest.approx(one, rel=1e-11)  # 1/E* is rounded


def test_mirror_images_touch_in_a_plane_with_finite_slopes():
    half = 0.5 * SURFACE.heights
    pair = pressed(heights=half, other=half[::-1], second=E)
    single = pressed(heights=half, load={"approach": 0.5 * APPROACH, "steps": 2})
    assert pair.force_N == pytest.approx(single.force_N, rel=1e-8)  # tolerance of the slopes
    flat = forces(heights=half, other=half[::-1], second=E, **SMALL)
    assert pair.force_N[-1] < 0.99 * flat[-1]  # they count


def test_heights_of_both_sides_add_at_mirrored_places():
    part = np.where(np.arange(16)[:, None] % 3 == 0, 0.3, 0.8) * SURFACE.heights
    rest = (SURFACE.heights - part)[::-1]
    found = forces(heights=part, other=rest, second=E, **SMALL)
    assert found == pytest.approx(forces(second=E, **SMALL), rel=1e-9)  # heights are rounded


KINDS = {
    "concurrent": {"kind": "concurrent"},
    "decomposed": {"kind": "consistent", "table_tolerance": 5e-3},
    "condensed": {"kind": "consistent", "table_tolerance": 5e-3},
    "full": {"kind": "consistent", "table_tolerance": 5e-3},
}


def on_block(name, *, modulus=E, patches=(3, 2), **changes):
    block = {"poisson_ratio": NU, "cells": [6, 6, 4], "young_modulus": modulus}
    sections = {"coupling": KINDS[name], "block": block, "patches": {"grid": patches}}
    return forces(**(SMALL | sections | changes))


@pytest.mark.long
@pytest.mark.parametrize("name", ["decomposed", "condensed", "full"])
def test_laws_against_a_half_space_give_the_contact_problem(name, monkeypatch):
    if name != "decomposed":
        lay_on_mesh(monkeypatch, condensed=name == "condensed")
    load = {"load": {"approach": APPROACH, "steps": 2, "tilt": (2e-3, -1e-3)}}
    expected = on_block("concurrent", second=0.5 * E, **load)
    found = on_block(name, second=0.5 * E, **load)
    assert found == pytest.approx(expected, rel=2e-3)  # between the rows of the laws


def test_a_stiff_half_space_is_a_rigid_plane_with_finite_slopes():
    stiff = on_block("concurrent", second=1e9 * E, micro={})
    assert stiff == pytest.approx(on_block("concurrent", micro={}), rel=1e-8)


@pytest.mark.long
@pytest.mark.parametrize("name", KINDS)
def test_on_a_stiff_block_the_half_space_alone_gives_way(name, monkeypatch):
    if name in ("condensed", "full"):
        lay_on_mesh(monkeypatch, condensed=name == "condensed")
    found = on_block(name, modulus=1e7 * E, second=E)
    assert found == pytest.approx(forces(**SMALL), rel=1e-6 if name == "concurrent" else 2e-3)
