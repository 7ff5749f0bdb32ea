"""Which configurations a scene has, in which order, and what tells them apart."""

import os
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from patchlaw.micro import MODEL_NAMES
from patchlaw.multiscale import Scene, resolve
from patchlaw.multiscale.runs.cases import CaseResult
from patchlaw.multiscale.runs.comparison import Row, ranked, refinements, solved
from patchlaw.multiscale.runs.configurations import (
    OWN,
    SMALL_SLOPES,
    coarser_grids,
    configurations,
    pressure_grid,
)
from patchlaw.multiscale.scene.parts import LAW_BLOCK_CELLS

PAPER = Path(__file__).parents[5] / "demos" / "scenes" / "paper.toml"


@cache
def made(*overrides):
    return configurations(Scene.load(PAPER, overrides))


def small(*overrides):
    """Return the configurations of a surface with few heights, which takes less time."""
    return made("surface.grid=[64, 64]", *overrides)


def test_paper_has_every_kind_and_the_scene_itself():
    """The scene comes first, the dearest last, and none twice."""
    found = made()
    kinds = {one.kind for one in found}
    assert kinds == {"analytic", "isolated", "consistent", "concurrent", "reference"}
    models = {one.model for one in found if one.kind == "analytic"}
    assert models == set(MODEL_NAMES)
    for kind in ("isolated", "consistent"):
        grids = {one.scene.patches.grid[0] for one in found if one.kind == kind}
        assert grids == {1, 2, 4, 8, 16}
    own, given = found[0], Scene.load(PAPER)
    assert own.name.startswith(OWN)
    assert (own.scene.coupling, own.scene.block) == (given.coupling, given.block)
    assert (found[1].kind, found[-1].kind) == ("analytic", "reference")
    assert len({one.key for one in found}) == len({one.name for one in found}) == len(found)
    for one in found:  # cells of the block are stated by laws on its mesh alone
        assert (one.scene.block.cells is None) != one.scene.on_mesh


def test_coarser_surfaces_still_carry_the_band():
    halves = {one.heights[0] for one in made() if one.name.startswith("analytic, half-space")}
    assert sorted(halves) == [32, 64, 128, 256]
    scene = Scene.load(PAPER, ["surface.spectrum.waves=[2, 30]"])
    assert coarser_grids((256, 256), scene) == [(128, 128), (256, 256)]  # three heights per wave


def test_heights_from_a_file_are_taken_as_they_are(tmp_path):
    file = tmp_path / "scan.npy"
    np.save(file, 1e-3 * np.random.default_rng(1).normal(size=(40, 20)))
    text = (
        "[surface]\nfile = 'scan.npy'\nlengths = [2, 1]\n[block]\nyoung_modulus = '4 GPa'\n"
        "poisson_ratio = 0.3\n[load]\napproach = '1 um'\n"
    )
    (tmp_path / "scan.toml").write_text(text, encoding="utf-8")
    scene = Scene.load(tmp_path / "scan.toml")
    found = configurations(scene)
    assert {one.heights for one in found} == {(40, 20)}
    assert {one.scene.path_of(one.scene.surface.file) for one in found} == {file}
    before = {one.key for one in found}
    np.save(file, 1e-3 * np.random.default_rng(2).normal(size=(40, 20)))
    assert not before & {one.key for one in configurations(scene)}  # other heights, other results


@pytest.mark.long
def test_other_scenes_have_other_keys():
    keys = {one.key for one in small()}
    assert not keys & {one.key for one in small("surface.spectrum.seed=2")}
    assert keys & {one.key for one in small("patches.grid=[2, 2]")}  # what does not see patches


def test_all_configurations_take_the_same_steps():
    for one in small("load.force_change=0.2", "load.steps=3"):
        assert one.scene.loading.force_change is None
        approaches = [step.approach for step in one.scene.loading.path()]
        assert approaches == pytest.approx([8e-3 / 3, 16e-3 / 3, 8e-3])


@pytest.mark.parametrize(
    ("grid", "common"), [((1, 1), (4, 4)), ((3, 8), (6, 8)), ((5, 2), (5, 4)), ((4, 4), (4, 4))]
)
def test_pressures_are_compared_on_multiples_of_the_patches(grid, common):
    assert pressure_grid(Scene.load(PAPER, [f"patches.grid={list(grid)}"])) == common


@pytest.mark.long
def test_load_by_force_or_free_tilt_has_configurations_too():
    for overrides in (["load.tilt=free"], ["load.force=3 N"]):
        scene = Scene.load(PAPER, ["surface.grid=[64, 64]"]).to_dict(whole=False)
        if overrides == ["load.force=3 N"]:
            scene["load"] = {"force": 3.0, "steps": 2}
            found = configurations(Scene.from_dict(scene))
        else:
            found = small(*overrides)
        assert {"analytic", "concurrent", "reference"} <= {one.kind for one in found}


def test_scene_that_leaves_all_open_has_configurations_that_stand(tmp_path):
    text = (
        "accuracy = 0.05\n[surface]\nspectrum = { hurst = 0.95, waves = [2, 4], rms_slope = 0.2 }\n"
        "lengths = [1, 1]\n[block]\nyoung_modulus = '4 GPa'\npoisson_ratio = 0.3\n"
        "[load]\napproach = '8 um'\nsteps = 2\n"
    )
    (tmp_path / "open.toml").write_text(text, encoding="utf-8")
    scene = Scene.load(tmp_path / "open.toml")
    settled = resolve(scene)
    found = configurations(settled)
    (own,) = [one for one in found if one.name.startswith(OWN)]
    assert own.scene.coupling.kind in ("consistent", "concurrent")
    assert own.scene.accuracy == 0.05
    assert not any(one.scene.open_keys for one in found)
    meshed = [one.scene.block.cells for one in found if "elements" in one.name]
    assert LAW_BLOCK_CELLS in meshed  # laws on a mesh are not left with what a smooth rest needs


def ended(one, *, finite_slopes=True):
    measured = {"finite_slopes": finite_slopes}
    result = CaseResult(measured=measured, arrays={"force": np.ones(2)})
    return Row(name=one.name, scene=one.scene, result=result)


def test_the_best_has_finite_slopes_and_then_the_most_heights():
    concurrent = [one for one in made() if one.kind == "concurrent"]
    found = [ended(one, finite_slopes=not one.name.endswith(SMALL_SLOPES)) for one in concurrent]
    best = [one.name.removeprefix("concurrent, half-space ") for one in found]
    assert sorted(best) == sorted(
        ["32 × 32", "64 × 64", "128 × 128", "256 × 256", f"128 × 128{SMALL_SLOPES}"]
    )
    best = ranked(found, "concurrent")
    assert best[0].heights == (256, 256)
    assert best[-1].name.endswith(SMALL_SLOPES)
    (pair,) = refinements(best)
    assert [one.name for one in pair] == [f"concurrent, half-space {n} × {n}" for n in (128, 256)]


def test_the_best_has_the_most_cells_whatever_its_heights():
    found = small("coupling.kind=concurrent", "micro.model=half-space", "micro.cells=[24, 24]")
    own, *others = (one for one in found if one.kind == "concurrent")
    assert own.name == f"{OWN}: concurrent, half-space 24 × 24"
    assert ranked([ended(one) for one in (own, *others)], "concurrent")[-1].name == own.name
    assert all(one.cells == one.heights for one in others)


def test_all_configurations_see_the_true_heights():
    found = made()
    slopes = {one.scene.surface.spectrum.rms_slope for one in found}
    assert slopes == {0.215}
    for kind in ("analytic", "consistent", "concurrent"):
        half_spaces = [one for one in found if one.kind == kind and one.model == "half-space"]
        assert len({one.heights for one in half_spaces}) == 4
        small = [one for one in half_spaces if one.scene.micro.finite_slopes is False]
        assert [one.name.endswith(SMALL_SLOPES) for one in small] == [True]
        names = [one.name for one in half_spaces]
        assert small[0].name.removesuffix(SMALL_SLOPES) in names


def test_configurations_that_fit_no_memory_stay_and_say_so_when_they_are_run(monkeypatch):
    pages = {"SC_PAGE_SIZE": 4096, "SC_PHYS_PAGES": 30_000}  # 0.12 GB
    monkeypatch.setattr(os, "sysconf", pages.__getitem__)
    found = {one.name: one for one in made("block.cells=[8, 8, 4]")}
    result = solved(found["reference, 3 meshes, 7.37 µm"], lambda: None)
    assert result.status == "not started"  # on another machine it may be run
    assert "GB of memory" in result.failure


def test_two_bodies_are_compared_without_meshed_roughness():
    surface = {
        "spectrum": {"hurst": 0.9, "waves": [2, 4], "rms_slope": 0.2, "seed": 3},
        "grid": [16, 16],
        "lengths": [1, 1],
    }
    elastic = {"young_modulus": "4 GPa", "poisson_ratio": 0.15}
    scene = Scene.from_dict({
        "surface": surface, "counter_surface": surface, "block": elastic, "counter_body": elastic,
        "load": {"approach": "4 um", "steps": 2},
    })  # fmt: skip
    kinds = {one.kind for one in configurations(scene)}
    assert kinds == {"analytic", "concurrent", "consistent"}
