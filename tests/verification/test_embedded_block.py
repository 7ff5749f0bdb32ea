"""The whole chain against what it must tend to: the micro model alone on a half-space."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from patchlaw.multiscale import Run, Scene, run

PAPER = Path(__file__).parents[2] / "demos" / "scenes" / "paper.toml"
ONE_PATCH = ["patches.grid=[1, 1]", "load.steps=2", "surface.grid=[128, 128]", "output.check=none"]


@cache
def history(*overrides):
    return run(Scene.load(PAPER, [*ONE_PATCH, *overrides]))


def force(*overrides):
    return history(*overrides).force_N


def block_of(ratio, cells=8):
    """A cube `ratio` times larger than the interface of 1 mm, graded away from it."""
    return [
        f"block.height={ratio} mm",
        f"block.margin={(ratio - 1) / 2} mm",
        f"block.cells=[{cells}, {cells}, 12]",
        f"block.grading={4 * ratio}",
        f"block.margin_grading={2 * ratio}",
    ]


@pytest.fixture(scope="module")
def half_space():
    return force("coupling.kind=analytic")


@pytest.mark.parametrize(
    "interface", ["patchwise", pytest.param("pointwise", marks=pytest.mark.slow)]
)
def test_one_patch_on_a_large_block_is_the_half_space(half_space, interface):
    more = [f"coupling.interface={interface}"] * (interface != "patchwise")  # the default
    errors = [np.abs(force(*block_of(ratio), *more) / half_space - 1) for ratio in (2, 8)]
    # a clamped bottom at distance H takes ~ 1/H off the displacement
    assert np.all(np.diff(errors, axis=0) < 0)
    # what is left at 8 times: the block's size and eight linear cells across the patch
    assert errors[-1].max() < 1e-2


@pytest.mark.long
def test_finer_interface_comes_closer(half_space):
    coarse, fine = (abs(force(*block_of(8, cells))[-1] / half_space[-1] - 1) for cells in (4, 12))
    assert fine < 0.8 * coarse


def test_love_mean_is_the_consistent_choice(half_space):
    """The law made with the centre's displacement is too soft in its own compliance."""
    mean = force(*block_of(8))[-1]  # by default
    centre = force(*block_of(8), "coupling.love=centre")[-1]
    assert abs(mean / half_space[-1] - 1) < 7e-3  # as above
    assert centre / half_space[-1] - 1 > 0.02


def test_paper_scene_in_small():
    scene = Scene.load(PAPER, ["block.cells=[16, 16, 10]", "load.steps=4", "output.check=none"])
    found = run(scene)
    assert found.newton_iterations.max() <= 6
    assert np.all(np.diff(found.force_N) > 0)
    assert np.all(np.diff(found.mean_separation_mm) < 0)
    # the same sum, but for the areas: facets of the mesh there, the partition here
    patch_area = found.patches.area
    total = found.patch_pressure_MPa.sum(axis=1) * patch_area
    np.testing.assert_allclose(total, found.force_N, rtol=1e-10)


def test_mean_gap_is_that_of_the_half_space():
    """The gap counts the dents about the contacts, which the block's closure does not see."""
    alone, embedded = history("coupling.kind=analytic"), history(*block_of(8))
    # the block's displacement of 0.6 µm is 3 % off (its size and mesh), against a gap of 20 µm
    np.testing.assert_allclose(embedded.mean_separation_mm, alone.mean_separation_mm, rtol=1.5e-3)


SMALL_PATCH = ["load.steps=1", *ONE_PATCH[:1], "block.cells=[8, 8, 5]"]


@pytest.mark.long
def test_pointwise_area_is_averaged_like_its_pressure():
    points = [*SMALL_PATCH, "load.approach=2 um", "coupling.interface=pointwise"]
    level, tilted = (
        run(Scene.load(PAPER, [*points, f"load.tilt={tilt}"]))
        for tilt in ("[0.0, 0.0]", "[0.004, 0.0]")
    )
    # p ~ c^1.5 and A ~ c over closures from 0 to 4 µm: their means exceed those at 2 µm
    assert tilted.force_N[0] > 1.1 * level.force_N[0]
    assert tilted.contact_area_fraction[0] > 1.02 * level.contact_area_fraction[0]


@pytest.mark.long
def test_pointwise_laws_reach_to_the_corners_of_tilted_patches():
    overrides = [
        "load.approach=5 um",
        "load.steps=1",
        "patches.grid=[1, 1]",
        "block.cells=[8, 8, 5]",
    ]
    scene = Scene.load(PAPER, [*overrides, "coupling.interface=pointwise", "load.tilt=[0.02, 0.0]"])
    whole = Run(scene)
    assert whole.coupling.parts.largest_closures[0] > 15e-3
    (step,) = whole.load_steps()
    assert step.force_N > 1.0


@pytest.mark.slow
@pytest.mark.parametrize("grid", [(4, 4), (4, 2)])
def test_consistent_laws_go_as_far_as_points_of_patches_ask(grid):
    """Where a patch sinks less than in its mean, closures are larger than in any of its rows."""
    small = ["surface.grid=[64, 64]", "micro.model=half-space", "load.steps=1"]
    small += ["block.cells=[8, 8, 5]", "output.check=none"]
    points = ["coupling.kind=consistent", "coupling.interface=pointwise"]
    points.append(f"patches.grid={list(grid)}")
    found, whole = (
        run(Scene.load(PAPER, [*small, *more])) for more in (points, ["coupling.kind=concurrent"])
    )
    # laws of patches' means, asked for at points: measured 0.9 and 1.2 % off
    assert found.force_N[0] == pytest.approx(whole.force_N[0], rel=0.02)
