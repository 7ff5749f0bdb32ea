"""Finite slopes of two bodies on meshes: what is one problem seen twice has one answer."""

import numpy as np
import pytest
from helpers.box_msh import cube_section

from patchlaw.geometry import Spectrum, synthesise
from patchlaw.multiscale import Run, Scene

CONSTANTS = {"young_modulus": 4000.0, "poisson_ratio": 0.15}
OTHER = {"young_modulus": 1700.0, "poisson_ratio": 0.15}
LENGTHS = [1.0, 1.0]
SPECTRUM = Spectrum(hurst=0.95, waves=(2, 6), rms_slope=0.215, seed=1)
HEIGHTS = synthesise(SPECTRUM, grid=(24, 24), lengths=(1.0, 1.0)).heights
QUIET = {"figures": False, "report": False, "check": "none", "contact": "none"}


def approach(below, above, bodies, *, force=2.0, **sections):
    """Return the approach of two rough sides under a force [mm]; heights as seen from above."""
    scene = {
        "surface": {"heights": below, "lengths": LENGTHS},
        **({} if "law" in sections else {"coupling": {"kind": "concurrent"}}),
        "load": {"force": force, "steps": 1},
        "output": QUIET,
    }
    if above is not None:
        scene["counter_surface"] = {"heights": above[::-1], "lengths": LENGTHS}
    (step,) = Run(Scene.from_dict(scene | bodies | sections)).load_steps()
    return step.approach_mm


@pytest.fixture(
    scope="module",
    params=[
        pytest.param(0.0, id="free sides", marks=pytest.mark.slow),
        pytest.param(0.25, id="wider bodies"),
    ],
)
def margin(request):
    return request.param


@pytest.fixture(scope="module")
def pair(tmp_path_factory, margin):
    """Return what gives the sections of two cubes of some elastic constants."""
    folder = tmp_path_factory.mktemp("cubes")

    def sections(first, second):
        body, counter = (
            cube_section(folder, 2, margin=margin, above=above) for above in (False, True)
        )
        return {"body": {**body, **first}, "counter_body": {**counter, **second}}

    return sections


FLAT = np.zeros_like(HEIGHTS)
SAME = 1e-7  # slopes are found to 3e-9 of the interference, the approach from first touch


@pytest.mark.slow
def test_roughness_may_be_of_either_body(pair):
    """The two bodies exchanged, turned over about the y axis: x runs the other way."""
    for first, second in ((CONSTANTS, CONSTANTS), (CONSTANTS, OTHER)):
        below = approach(HEIGHTS, FLAT, pair(first, second))
        above = approach(FLAT, HEIGHTS, pair(first, second))
        exchanged = approach(HEIGHTS[::-1], FLAT, pair(second, first))
        assert exchanged == pytest.approx(above, rel=SAME)
        if first is second:
            assert above == pytest.approx(below, rel=SAME)
        else:  # the softer body has the larger share
            assert abs(above / below - 1.0) > 1e-3


@pytest.mark.long
def test_roughness_split_over_both_bodies(pair):
    both = pair(CONSTANTS, CONSTANTS)
    found = [approach(s * HEIGHTS, (1.0 - s) * HEIGHTS, both) for s in (0.3, 0.7)]
    assert found[0] == pytest.approx(found[1], rel=SAME)
    # to first order slopes are those of the sum; the rest is second order
    assert found[0] == pytest.approx(approach(HEIGHTS, FLAT, both), rel=5e-3)


@pytest.mark.long
def test_mirror_images_meet_in_a_plane(pair):
    half = 0.5 * HEIGHTS
    both = pair(CONSTANTS, CONSTANTS)
    alone = approach(half, None, {"body": both["body"]})
    assert approach(half, half, both) == pytest.approx(2.0 * alone, rel=SAME)


@pytest.mark.long
@pytest.mark.parametrize("way", [np.s_[::-1, :], np.s_[:, ::-1]], ids=["x", "y"])
def test_mirrored_in_the_plane(pair, way):
    rough = 0.6 * HEIGHTS, 0.4 * HEIGHTS.T
    bodies = pair(CONSTANTS, OTHER)
    mirrored = approach(rough[0][way], rough[1][way], bodies)
    assert mirrored == pytest.approx(approach(*rough, bodies), rel=SAME)


@pytest.mark.long
def test_a_stiff_body_is_rigid(pair):
    stiff = {**CONSTANTS, "young_modulus": 1e6 * CONSTANTS["young_modulus"]}
    alone = {"body": pair(CONSTANTS, stiff)["body"]}
    plane = approach(HEIGHTS, None, alone)
    assert approach(HEIGHTS, FLAT, pair(CONSTANTS, stiff)) == pytest.approx(plane, rel=3e-6)
    # a rigid rough body: only the flat one gives way, which has no slopes
    small = approach(HEIGHTS, None, alone, micro={"finite_slopes": False})
    assert approach(FLAT, HEIGHTS, pair(CONSTANTS, stiff)) == pytest.approx(small, rel=3e-6)


@pytest.mark.slow
@pytest.mark.parametrize("margin", [0.25], indirect=True, ids=["wider bodies"])
@pytest.mark.parametrize("continues", [True, False])
def test_samples_of_two_rough_sides(pair, continues):
    """Their laws know which body is rough; mirror images of a sample meet in a plane."""
    periodic = synthesise(SPECTRUM, grid=(16, 16), lengths=(0.1, 0.1)).heights

    def law(below, above, bodies):
        side = {"lengths": [0.1, 0.1], "periodic": continues}
        return approach(
            below,
            above,
            bodies,
            surface={"heights": below, **side},
            law={"kind": "representative"},
            micro={"finite_slopes": True},
            load={"force": 20.0, "steps": 1},
            **({} if above is None else {"counter_surface": {"heights": above[::-1], **side}}),
        )

    flat, other = np.zeros_like(periodic), pair(CONSTANTS, OTHER)
    below, above = law(periodic, flat, other), law(flat, periodic, other)
    exchanged = law(periodic[::-1], flat, pair(OTHER, CONSTANTS))
    # rows of a law are solved to 1e-10; between them laws of mirrored samples are one law
    assert exchanged == pytest.approx(above, rel=1e-6)
    assert abs(above / below - 1.0) > 1e-3
    half = law(0.5 * periodic, None, {"body": other["body"]})
    both = law(0.5 * periodic, 0.5 * periodic, pair(CONSTANTS, CONSTANTS))
    assert both == pytest.approx(2.0 * half, rel=2e-3)  # tolerance of tables, twice


@pytest.mark.long
def test_errors_of_either_body_count(tmp_path):
    """A coarse and a fine body exchanged have the same error by their elements."""

    def error(below, above):
        body, counter = (
            {**cube_section(tmp_path, cells, margin=0.25, above=up), **CONSTANTS}
            for cells, up in ((below, False), (above, True))
        )
        heights = HEIGHTS[::2, ::2] if below < above else HEIGHTS[::2, ::2][::-1]
        scene = {
            "surface": {"heights": heights, "lengths": LENGTHS},
            "coupling": {"kind": "concurrent"},
            "micro": {"finite_slopes": False},
            "load": {"force": 2.0, "steps": 1},
            "output": {**QUIET, "check": "last"},
        }
        (step,) = Run(Scene.from_dict(scene | {"body": body, "counter_body": counter})).load_steps()
        return dict(step.errors)["body"]

    # solutions of errors are found to 1e-5 of the force, errors are some per cent of it
    assert error(2, 1) == pytest.approx(error(1, 2), rel=5e-3)
