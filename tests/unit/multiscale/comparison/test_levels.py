"""Which levels a scene has, in which order, and what tells them apart."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from geometry.patches import PatchGrid
from multiscale.comparison.compare import resolved_scene
from multiscale.comparison.level import pressure_grid
from multiscale.comparison.level_results import LevelResult
from multiscale.comparison.levels import SMALL_SLOPES, levels
from multiscale.comparison.measures import Curves
from multiscale.comparison.outcomes import Outcome, ranked, refinements
from multiscale.resolution.auto_keys import auto_keys
from multiscale.scene.scene import Scene
from multiscale.setup.checks import LAW_BLOCK_CELLS

COLUMNS = (
    "approach", "force", "area", "separation", "approach_error", "force_error", "area_error",
)  # fmt: skip
PAPER = Path(__file__).parents[4] / "demos" / "scenes" / "paper.toml"


@cache
def made(*overrides, ranks=1):
    return levels(Scene.load(PAPER, overrides), ranks)


def test_paper_has_every_kind_and_the_scene_itself():
    found = made()
    kinds = {level.kind for level in found}
    assert kinds == {"analytic", "isolated", "consistent", "concurrent", "reference"}
    models = {level.model for level in found if level.kind == "analytic"}
    assert models >= {
        "elliptic", "circular", "elliptic-independent", "circular-independent", "islands",
        "half-space",
    }  # fmt: skip
    for kind in ("isolated", "consistent"):
        grids = {level.content["patches"]["grid"][0] for level in found if level.kind == kind}
        assert grids == {1, 2, 4, 8, 16}
    (own,) = [level for level in found if level.is_own]
    assert own.scene.coupling == Scene.load(PAPER).coupling
    assert own.scene.block == Scene.load(PAPER).block


def test_cheapest_come_first_and_none_twice():
    found = made()
    costs = [level.cost for level in found]
    assert costs == sorted(costs)
    assert found[0].kind == "analytic"
    assert found[-1].kind == "reference"
    assert len({level.key for level in found}) == len({level.name for level in found}) == len(found)


def test_coarser_surfaces_still_carry_the_band():
    halves = {level.heights[0] for level in made() if level.name.startswith("analytic, half-space")}
    assert sorted(halves) == [32, 64, 128, 256]
    waves = made("surface.spectrum.waves=[2, 30]")
    halves = {level.heights[0] for level in waves if level.name.startswith("analytic, half-space")}
    assert sorted(halves) == [128, 256]  # three heights per wave


def test_heights_from_a_file_are_taken_as_they_are(tmp_path):
    file = tmp_path / "scan.npy"
    np.save(file, 1e-3 * np.random.default_rng(1).normal(size=(40, 20)))
    text = (
        "[surface]\nfile = 'scan.npy'\nlengths = [2, 1]\n[block]\nyoung_modulus = '4 GPa'\n"
        "poisson_ratio = 0.3\n[load]\napproach = '1 um'\n"
    )
    (tmp_path / "scan.toml").write_text(text, encoding="utf-8")
    scene = Scene.load(tmp_path / "scan.toml")
    found = levels(scene)
    assert {level.heights for level in found} == {(40, 20)}
    assert {level.content["surface"]["file"] for level in found} == {str(file)}
    before = {level.key for level in found}
    np.save(file, 1e-3 * np.random.default_rng(2).normal(size=(40, 20)))
    assert not before & {level.key for level in levels(scene)}  # other heights, other results


def test_same_scene_same_keys_and_other_scene_other_keys():
    keys = {level.key for level in made()}
    assert keys == {level.key for level in made()}
    assert not keys & {level.key for level in made("surface.spectrum.seed=2")}
    assert keys & {level.key for level in made("patches.grid=[2, 2]")}  # what does not see patches


def test_only_couplings_use_ranks():
    ranks = {(level.kind == "analytic", level.ranks) for level in made(ranks=3)}
    assert ranks == {(True, 1), (False, 3)}
    more, one = made(ranks=3), made()
    assert {level.key for level in more if level.ranks == 3}.isdisjoint(level.key for level in one)


def test_all_levels_take_the_same_steps():
    for level in made("load.force_change=0.2", "load.steps=3"):
        assert level.scene.loading.force_change is None
        targets = np.divide(level.scene.loading.load_history.targets, level.scale)
        assert targets == pytest.approx([8e-3 / 3, 16e-3 / 3, 8e-3])


@pytest.mark.parametrize(
    ("grid", "common"), [((1, 1), (4, 4)), ((3, 8), (6, 8)), ((5, 2), (5, 4)), ((4, 4), (4, 4))]
)
def test_pressures_are_compared_on_multiples_of_the_patches(grid, common):
    assert pressure_grid(Scene.load(PAPER, [f"patches.grid={list(grid)}"])) == common


def test_load_by_force_or_free_tilt_has_levels_too():
    for overrides in (["load.tilt=free"], ["load.force=3 N"]):
        scene = Scene.load(PAPER).model_dump(by_alias=True, mode="json", exclude_none=True)
        if overrides == ["load.force=3 N"]:
            scene["load"] = {"force": 3.0, "steps": 2}
            found = levels(Scene.from_dict(scene))
        else:
            found = made(*overrides)
        assert {"analytic", "concurrent", "reference"} <= {level.kind for level in found}


def test_small_slopes_scale_heights_and_load_together():
    found = made("load.tilt=[0.01, 0]")
    (small,) = [level for level in found if level.scale != 1.0]
    (steep,) = [level for level in found if f"{level.name}, heights × 0.1" == small.name]
    assert (steep.scale, small.scale) == (1.0, 0.1)
    assert small.scene.surface.spectrum.rms_slope == pytest.approx(0.0215, rel=1e-12)  # rounding
    assert small.scene.loading.approach == pytest.approx((0.8e-3,), rel=1e-12)
    assert small.scene.loading.tilt == pytest.approx((1e-3, 0.0), rel=1e-12)
    assert small.scene.reference == steep.scene.reference


def test_scene_that_leaves_all_open_has_levels_that_stand(tmp_path):
    text = (
        "accuracy = 0.05\n[surface]\nspectrum = { hurst = 0.95, waves = [2, 4], rms_slope = 0.2 }\n"
        "grid = 'auto'\nlengths = [1, 1]\n[block]\nyoung_modulus = '4 GPa'\npoisson_ratio = 0.3\n"
        "cells = 'auto'\n[patches]\ngrid = 'auto'\n[micro]\nmodel = 'auto'\n[coupling]\n"
        "kind = 'auto'\n[load]\napproach = '8 um'\nsteps = 2\n"
    )
    (tmp_path / "open.toml").write_text(text, encoding="utf-8")
    scene = Scene.load(tmp_path / "open.toml")
    settled = resolved_scene(scene, tmp_path)
    assert resolved_scene(scene, tmp_path) == settled  # what was kept
    found = levels(settled)
    (own,) = [level for level in found if level.is_own]
    assert own.scene.coupling.kind in ("consistent", "concurrent")
    assert (own.scene.accuracy, own.scene.micro.model) == (0.05, "auto")
    for level in found:
        assert auto_keys(level.scene) <= {"micro.model"}
        assert not auto_keys(level.scene) or level.is_own or level.kind == "reference"
    meshed = [level.scene.block.cells for level in found if "elements" in level.name]
    assert LAW_BLOCK_CELLS in meshed  # laws on a mesh are not left with what a smooth rest needs


def ended(level, *, finite_slopes=True):
    ones = np.ones(2)
    curves = Curves(
        patches=PatchGrid(grid=(1, 1), lengths=(1.0, 1.0)),
        patch_pressure=ones[:, None],
        **{key: ones for key in COLUMNS},
    )
    result = LevelResult(key=level.key, status="done", curves=curves, finite_slopes=finite_slopes)
    return Outcome(level, result)


def test_the_best_has_finite_slopes_and_then_the_most_heights():
    concurrent = [level for level in made() if level.kind == "concurrent"]
    found = [
        ended(level, finite_slopes=not level.name.endswith(SMALL_SLOPES)) for level in concurrent
    ]
    best = [one.level.name.removeprefix("concurrent, half-space ") for one in found]
    assert sorted(best) == sorted(
        ["32 × 32", "64 × 64", "128 × 128", "256 × 256", f"128 × 128{SMALL_SLOPES}"]
    )
    best = ranked(found, "concurrent")
    assert best[0].level.heights == (256, 256)
    assert best[-1].level.name.endswith(SMALL_SLOPES)
    ((coarse, fine),) = refinements(best)
    assert (coarse.level.heights, fine.level.heights) == ((128, 128), (256, 256))


def test_all_levels_but_one_of_low_heights_see_the_true_ones():
    found = made()
    slopes = {level.scene.surface.spectrum.rms_slope for level in found if level.scale == 1.0}
    assert slopes == {0.215}
    for kind in ("analytic", "consistent", "concurrent"):
        half_spaces = [one for one in found if one.kind == kind and one.model == "half-space"]
        assert len({level.heights for level in half_spaces}) == 4
        small = [one for one in half_spaces if one.scene.micro.finite_slopes is False]
        assert [level.name.endswith(SMALL_SLOPES) for level in small] == [True]
        names = [level.name for level in half_spaces]
        assert small[0].name.removesuffix(SMALL_SLOPES) in names


def test_cells_of_the_block_are_stated_by_laws_on_its_mesh_alone():
    for level in made():
        assert (level.scene.block.cells is None) != level.scene.coupling.on_mesh
        assert level.scene.reference.cells is None
    hexahedra = made("reference.cells=[16, 16, 8]")
    assert {level.scene.reference.cells for level in hexahedra} == {(16, 16, 8)}
    assert len([level for level in hexahedra if level.kind == "reference"]) == 3


def test_references_that_fit_no_memory_are_told(monkeypatch):
    pages = {"SC_PAGE_SIZE": 4096, "SC_PHYS_PAGES": 30_000}  # 0.12 GB
    monkeypatch.setattr("multiscale.machine.nodes.os.sysconf", pages.__getitem__)
    refused = {
        level.name: level.refusal for level in made("block.cells=[8, 8, 4]") if level.refusal
    }
    assert "reference, 3 meshes, 7.37 µm" in refused
    assert all(name.startswith("reference") for name in refused)
    assert all("GB of memory" in text for text in refused.values())
