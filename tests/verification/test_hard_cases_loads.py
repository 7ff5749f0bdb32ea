"""Hard loads: first touch, steps too large, nearly vertical laws, ten thousand steps and back."""

import tracemalloc
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from helpers.hard_cases import KINDS, centred, coarse_tables, from_file, history, scene
from helpers.laws_on_mesh import lay_on_mesh
from scipy.optimize import brentq

from patchlaw.geometry import Control, Material, PatchGrid
from patchlaw.micro import influence_matrix
from patchlaw.multiscale import PatchLaw, PatchLaws, Run
from patchlaw.multiscale.laws.patch_law import repaired_law
from patchlaw.multiscale.laws.rows import LawRows
from patchlaw.multiscale.models.patch_contact import equilibrium
from patchlaw.support import NotConverged

every_kind = pytest.mark.parametrize("kind", KINDS)
# isolated laws are tables as consistent ones are
isolated_later = pytest.mark.parametrize(
    "kind", [pytest.param(kind, marks=[pytest.mark.long] * (kind == "isolated")) for kind in KINDS]
)


@pytest.mark.long
@every_kind
def test_first_touch_of_one_asperity(kind, tmp_path):
    # hard: p ~ c^1.5 has no stiffness at first touch, where closures of 0.1 mm differ by 1e-10 mm
    x, y = centred(33)
    sphere = from_file(tmp_path, -(x**2 + y**2) / (2 * 0.5))  # radius 0.5 mm
    approach = [1e-10, 1e-8, 1e-6]
    found = history(
        coupling__kind=kind, micro__model="circular", load__approach=[*approach, 0.0],
        **sphere, **coarse_tables(kind),
    )  # fmt: skip
    modulus = Material(young_modulus=4000.0, poisson_ratio=0.15).contact_modulus
    hertz = 4 / 3 * modulus * np.sqrt(0.5) * np.array(approach) ** 1.5
    # the block yields by 1e-3 of 1e-6 mm; closures of 0.5 mm are known to 4e-7 of 1e-10 mm
    np.testing.assert_allclose(found.force_N[:3], hertz, rtol=5e-3)
    assert found.force_N[3] <= 1e-18  # lands exactly on first touch; gaps are known to 1e-17 mm
    assert found.newton_iterations.max() <= 8


@isolated_later
def test_smallest_forces_first(kind):
    # hard: the plane has to be placed to far below the rounding of what closures start at
    forces = [1e-9, 1e-6, 1e-3, 1.0, 0.0]
    load = {"load__approach": None, "load__force": forces}
    found = history(coupling__kind=kind, **load, **coarse_tables(kind))
    # 1e-9 N moves the plane by 1e-11 mm, known to 1e-17 mm: force to 2e-6 of itself
    np.testing.assert_allclose(found.force_N[:4], forces[:4], rtol=1e-5)
    assert found.force_N[4] == 0.0
    assert np.all(np.diff(found.approach_mm[:4]) > 0.0)


@pytest.mark.slow
@every_kind
def test_a_step_a_hundred_times_too_large_and_back(kind):
    # hard: from first touch to full contact at once; isolated laws end where they are functions
    load = {"coupling__kind": kind, "surface__grid": [16, 16], "patches__grid": [2, 2]}
    load |= coarse_tables(kind)
    near = history(load__approach="8 um", **load)
    there = history(load__approach=["800 um", "8 um", "0 um"], **load)
    if kind in ("analytic", "concurrent"):  # laws that reach further have other rows
        assert there.force_N[1] == pytest.approx(near.force_N[0], rel=1e-7)  # their 1e-8 each
    assert there.force_N[0] > 500.0 * near.force_N[0]
    assert there.force_N[2] == 0.0 and not there.patch_pressure_MPa[2].any()
    slow = history(load__approach=["800 um"], load__steps=3, **load)
    assert there.force_N[0] == pytest.approx(slow.force_N[-1], rel=1e-5)


@pytest.mark.long
def test_a_patch_alone_at_full_contact_on_the_mesh_is_refused(monkeypatch):
    # hard: the pressure stops being a function of closure, and no smaller step helps
    lay_on_mesh(monkeypatch)
    with pytest.raises(NotConverged, match=r"stops being a function.*coupling.kind = 'consistent'"):
        history(
            coupling__kind="isolated",
            load__approach="800 um",
            surface__grid=[16, 16],
            patches__grid=[2, 2],
        )


@pytest.mark.long
@every_kind
def test_tilt_that_leaves_half_the_patches_open(kind):
    # hard: contact at one side only, where the approach at the middle says little
    load = {"load__tilt": ["40 um/mm", "0 um/mm"], "load__steps": 4}
    found = history(coupling__kind=kind, **load, **coarse_tables(kind))
    pressed = found.patch_pressure_MPa[-1] > 0.0
    assert 4 <= np.count_nonzero(pressed) <= 8
    assert found.moment_x_N_mm[-1] > 0.1 * found.force_N[-1]  # the force acts on the lower side
    # conjugate gradients over all passes of slopes, 37 and 49 were counted; steps of Newton
    assert found.newton_iterations.max() <= (60 if kind in ("analytic", "concurrent") else 8)


@isolated_later
def test_a_gap_shifted_by_a_ten_thousandth(kind):
    # hard: a table of laws must not turn a small change of the gap into noise
    small = {"coupling__kind": kind, "surface__grid": [16, 16], **coarse_tables(kind)}
    below, at, above = history(
        load__approach=[0.008 * (1 + shift) for shift in (-1e-4, 0.0, 1e-4)], **small
    ).force_N
    wide = history(load__approach=[0.0079, 0.0081], **small).force_N
    slope = (wide[1] - wide[0]) / 0.0002
    assert (above - below) / 1.6e-6 == pytest.approx(
        slope, rel=0.02
    )  # curvature, kinks of contacts
    assert above - at == pytest.approx(at - below, rel=0.01)


def law(closure, pressure, shift=0.0):
    closure, pressure = np.array(closure) + shift, np.array(pressure)
    zero = np.zeros(len(closure))
    rows = LawRows(
        closure=closure, pressure=pressure, approach=closure, contact_area_fraction=zero,
        contacts=zero.astype(int), unresolved_displacement=zero,
    )  # fmt: skip
    return PatchLaw(rows=rows, first_touch=float(closure[0]), initial_separation=0.02)


STEEP = np.array([0.0, 1e-3, 1e-3 + 1e-9, 9e-3])
TABLES = {
    "kink": ([0.0, 4e-3, 4.01e-3, 9e-3], [0.0, 1.0, 60.0, 400.0]),
    "plateau": ([0.0, 2e-3, 6e-3, 9e-3], [0.0, 20.0, 20.0, 90.0]),
    "nearly vertical": (STEEP, [0.0, 1.0, 100.0, 120.0]),
    "noisy": (np.linspace(0.0, 9e-3, 19), 4e5 * np.linspace(0.0, 9e-3, 19) ** 1.5),
}


@pytest.mark.parametrize("name", TABLES)
@pytest.mark.parametrize("force", [None, 50.0], ids=["approach", "force"])
def test_laws_with_a_kink_a_plateau_a_wall_or_noise(name, force):
    # hard: the tangent jumps, vanishes or is a wall; with noise the pressure falls here and there
    closure, pressure = TABLES[name]
    if name == "noisy":
        noise = np.random.default_rng(4).normal(0.0, 0.05, len(pressure))
        pressure = np.abs(pressure * (1.0 + noise))
    one, yields = law(closure, pressure), 1e-4
    patch = PatchGrid(grid=(1, 1), lengths=(1.0, 1.0))
    newton = partial(equilibrium, PatchLaws([one]), np.array([[yields]]), patch)
    control = Control(approach=0.012, tilt=(0.0, 0.0))
    if force is not None:
        control = Control(force=force, tilt=(0.0, 0.0))
    state = newton(control)
    assert state.iterations <= 40

    def missing(local):
        return float(local + yields * one.along(local).pressure) - state.plane[0]

    root = brentq(missing, 0.0, 0.02, xtol=1e-18, rtol=1e-15)
    assert float(state.local[0]) == pytest.approx(root, rel=1e-9)  # 1e-12 over the slope
    if force is not None:
        assert state.load[0] == pytest.approx(force, rel=1e-9)


@pytest.mark.parametrize("name", TABLES)
def test_nine_patches_with_such_laws(name):
    # hard: which patches are before the kink or wall, and which beyond, is one choice of 2^9
    closure, pressure = TABLES[name]
    if name == "noisy":
        noise = np.random.default_rng(4).normal(0.0, 0.3, len(pressure))
        pressure = np.abs(pressure * (1.0 + noise))
    laws = [law(closure, pressure, shift) for shift in np.linspace(0.0, 4e-3, 9)]
    laws = laws if name != "noisy" else list(map(repaired_law, laws))
    patches = PatchGrid(grid=(3, 3), lengths=(1.0, 1.0))
    yields = influence_matrix(patches) / (np.pi * 4092.0)
    newton = partial(equilibrium, PatchLaws(laws), yields, patches)
    level = newton(Control(approach=0.01, tilt=(0.0, 0.0)))
    state = newton(Control(force=float(level.load[0]), tilt=(0.0, 0.0)))
    # the force is met to 1e-12, the approach follows from it
    assert state.plane[0] == pytest.approx(level.plane[0], rel=1e-7)
    # 74 and 92 at kinks, and none found at walls, before steps were bent along the laws
    assert max(level.iterations, state.iterations) <= 12
    # patch after patch by Brent's method, until nothing moves: slow and sure from any start, as
    # energy is convex; from the solution, which has to stay where it is
    found = state.point.pressure.copy()
    for _ in range(200):
        before = found.copy()
        for i, one in enumerate(laws):
            others = yields[i] @ found - yields[i, i] * found[i]

            def missing(s, one=one, i=i, others=others):
                return s + yields[i, i] * float(one.along(s).pressure) + others - state.plane[0]

            root = brentq(missing, -0.1, 0.1, xtol=1e-18, rtol=1e-15)
            found[i] = float(one.along(root).pressure)
        # at the wall a rounding of closures, 1e-18 mm, is 1e-7 MPa
        if np.abs(found - before).max() <= 2e-7:
            break
    else:
        raise AssertionError("patch after patch nothing comes to rest")
    np.testing.assert_allclose(state.point.pressure, found, rtol=1e-6, atol=1e-6)


LAPS = {
    "analytic": ({}, 1e-9),
    "isolated": ({"coupling__interface": "pointwise"}, 1e-10),
    "consistent": ({}, 1e-12),
    "concurrent": ({}, 2e-8),  # two solutions, each to its tolerance
    "reference": ({"reference__meshes": 1, "reference__fine": 0.15, "block__element": "P1"}, 1e-8),
}


@pytest.mark.slow
@pytest.mark.parametrize("kind", LAPS)
def test_hundreds_of_load_steps_do_not_drift_nor_grow(kind):
    # hard: what is carried from step to step must neither wander nor pile up; ten thousand steps
    # take minutes, and did neither: forces came back to 2e-11, with 1 to 2 kB of history each
    laps, small = 6, {"block__cells": [6, 6, 4], "surface__grid": [16, 16], "patches__grid": [2, 2]}
    changes, tolerance = LAPS[kind]
    work = Run(
        scene(
            coupling__kind=kind, load__approach=["8 um", "2 um"] * laps, load__steps=5,
            **small, **changes, **coarse_tables(kind),
        )
    )  # fmt: skip
    tracemalloc.start()
    try:
        force, memory = [], []
        for step in work.load_steps():
            force.append(step.force_N)
            memory.append(tracemalloc.get_traced_memory()[0])
    finally:
        tracemalloc.stop()
    turns = np.array(force).reshape(laps, 10)
    np.testing.assert_allclose(turns[:, 4], turns[0, 4], rtol=tolerance)
    np.testing.assert_allclose(turns[1:], turns[1:2].repeat(laps - 1, axis=0), rtol=tolerance)
    assert np.all(turns[:, 4] > 1.5 * turns[:, 6])  # it does go up and down
    half = len(memory) // 2
    assert (memory[-1] - memory[half]) / half < 4000.0  # bytes a step: the history itself, 1 kB


def test_a_plane_on_nothing_but_its_own_law_counts_from_rounding():
    # hard: two patches of which one starts 10^8 times further away than the load goes
    patches = PatchGrid(grid=(2, 1), lengths=(2.0, 1.0))
    touch = np.array([0.0, 100.0])

    def along(local):
        depth = np.maximum(local - touch, 0.0)
        return SimpleNamespace(
            closure=touch + (local - touch), pressure=1e5 * depth**1.5,
            dclosure=np.ones(2), dpressure=1.5e5 * np.sqrt(depth),
        )  # fmt: skip

    newton = partial(
        equilibrium, SimpleNamespace(first_touch=touch, along=along), np.diag([1e-6, 1e-6]), patches
    )
    state = newton(Control(approach=1e-6, tilt=(0.0, 0.0)))
    depth = brentq(lambda s: s + 1e-6 * 1e5 * s**1.5 - 1e-6, 0.0, 1e-6, xtol=1e-20, rtol=1e-14)
    assert state.point.pressure[0] == pytest.approx(1e5 * depth**1.5, rel=1e-6)
    assert state.point.pressure[1] == 0.0
