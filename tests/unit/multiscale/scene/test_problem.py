"""How far laws are made for the loads that are near, tilted or out of reach."""

from pathlib import Path

import numpy as np
import pytest

from patchlaw import InputError
from patchlaw.multiscale import CellContact, Scene, make_setup, run
from patchlaw.multiscale.models.problem import plane_at_largest_load
from patchlaw.support import NotConverged

PAPER = Path(__file__).parents[4] / "demos" / "scenes" / "paper.toml"

PEAKS = {"hurst": 0.8, "waves": [2, 16], "rms_slope": 0.2, "seed": 2}


def scene(seed=1, coupling="consistent", **load):
    small = [f"surface.spectrum.seed={seed}", "surface.grid=[33, 33]", "block.cells=[8, 8, 6]"]
    models = ["micro.model=half-space", f"coupling.kind={coupling}"]
    if coupling != "concurrent":
        models.append("coupling.table_tolerance=0.01")
    data = Scene.load(PAPER, [*small, *models]).to_dict()
    return Scene.from_dict(data | {"load": {"steps": 1} | load})


@pytest.mark.parametrize(("seed", "coupling"), [(3, "isolated")])
def test_small_force_on_the_lower_side_of_a_tilted_plane(seed, coupling):
    asked = scene(seed, coupling, force=5e-3, tilt=[0.01, 0.01])
    setup = make_setup(asked)
    assert (
        setup.parts.plane_at_largest_load.approach < 0.0
    )  # at the middle the plane is clear of the surface
    x, y = np.meshgrid(setup.parts.surface.x - 0.5, setup.parts.surface.y - 0.5, indexing="ij")
    below = (
        setup.parts.plane_at_largest_load.approach
        + 0.01 * (x + y)
        - (setup.parts.surface.highest - setup.parts.surface.heights)
    )
    assert setup.parts.largest_interference == pytest.approx(below.max(), rel=1e-12)
    assert setup.parts.largest_interference > 0.0
    # Newton's residual of a prescribed force is below 1e-10 on the mesh
    assert run(asked).force_N[-1] == pytest.approx(5e-3, rel=1e-9)


@pytest.mark.parametrize("tilt", [0.0, 1e-5])  # patches on one side lie beyond the plane
@pytest.mark.parametrize("coupling", ["isolated", "consistent", "concurrent"])
def test_plane_that_does_not_touch_carries_nothing(coupling, tilt):
    asked = scene(coupling=coupling, approach=1e-6, tilt=[tilt, 0.0])
    setup = make_setup(asked)
    assert setup.parts.micro.first_touch > 1e-5  # cells miss the interpolant's highest point
    assert any("nothing lies within" in text for text in setup.about.warnings())
    history = run(asked)
    assert (history.force_N[-1], history.contacts[-1]) == (0.0, 0)


def test_cells_of_contacts_tell_what_lies_within_an_approach():
    asked = scene(coupling="concurrent", approach="2 um")
    for cells, touches in ((33, True), (4, False)):
        setup = make_setup(asked.with_({"micro.cells": [cells, cells]}))
        assert bool(setup.parts.interfering_cells) == touches
        assert any("nothing lies" in text for text in setup.about.warnings()) != touches


@pytest.mark.parametrize(("tilt", "coupling", "load"), [
    ([0.01, -0.0025], "under the load's tilt;", "tilted by 10 and -2.5 µm/mm along x and y"),
    ("free", "under the tilt that the plane takes at each approach;", "the plane free to tilt"),
    ([0.0, 0.0], "one solution of the whole surface;", "an approach of 8 µm"),
])  # fmt: skip
def test_plan_says_under_which_tilt_laws_are_made(tilt, coupling, load):
    said = dict(make_setup(scene(approach=8e-3, tilt=tilt)).about.statements())
    assert coupling in said["coupling"]
    assert load in said["load"]


def test_laws_reach_a_contact_at_the_corner_of_the_block():
    """There the plane comes further than on the half-space; the laws know how the block bends."""
    history = run(scene(1, "consistent", force=5e-3, tilt=[0.01, 0.01]))
    assert history.force_N[-1] == pytest.approx(5e-3, rel=1e-9)


@pytest.mark.parametrize(("model", "warns"), [("elliptic", True), ("half-space", False)])
def test_the_plan_warns_of_flat_summits_that_carry_nothing(tmp_path, model, warns):
    x = np.linspace(-0.5, 0.5, 33)
    waves = 0.01 * np.cos(4 * np.pi * x[:, None]) * np.cos(4 * np.pi * x)
    steps = np.round(waves / 2e-3) * 2e-3  # heights in steps of 2 µm
    steps[:16] = waves[:16]
    np.save(tmp_path / "steps.npy", steps)
    surface = {"file": str(tmp_path / "steps.npy"), "lengths": ["1 mm", "1 mm"]}
    block = {"young_modulus": "4 GPa", "poisson_ratio": 0.15, "cells": [8, 8, 6]}
    stepped = Scene.from_dict({
        "surface": surface, "block": block, "patches": {"grid": [2, 2]}, "micro": {"model": model},
        "coupling": {"kind": "isolated"}, "load": {"approach": "4 um", "steps": 1},
    })  # fmt: skip
    said = [text for text in make_setup(stepped).about.warnings() if "summits are flat" in text]
    assert len(said) == warns


class Shy(CellContact):
    """Presses no further than by a micrometre at once."""

    reached = 0.0

    def press(self, control):
        if control.approach > self.reached + 1.01e-3:
            raise NotConverged("it", reason="TOO_FAR", iterations=1, remedy="take smaller steps")
        self.reached = control.approach
        return super().press(control)


def test_free_plane_that_is_not_found_at_once_is_found_in_smaller_steps():
    setup = make_setup(scene(coupling="concurrent", approach=3e-3, tilt="free"))
    coupling = Shy(setup.parts.micro, setup.parts.patches, setup.parts.mean_heights)
    path = setup.parts.path
    plain = CellContact(setup.parts.micro, setup.parts.patches, setup.parts.mean_heights)
    known, found = (
        plane_at_largest_load(path, one, setup.parts.surface) for one in (plain, coupling)
    )
    assert found.approach == known.approach
    # moments to 1e-8 of force times length
    np.testing.assert_allclose(found.tilt, known.tilt, rtol=1e-5)
    coupling.reached = -1.0
    with pytest.raises(NotConverged, match=r"load step 1 \(approach .*: TOO_FAR .* halved 8 times"):
        plane_at_largest_load(path, coupling, setup.parts.surface)


@pytest.mark.parametrize(("given", "height"), [({}, 20), ({"height": "5 um"}, 5)])
def test_a_block_is_as_high_as_the_shorter_side_unless_told(given, height):
    spectrum = {"hurst": 0.95, "waves": [2, 4], "rms_slope": 0.2, "seed": 1}
    made = make_setup(Scene.from_dict({
        "surface": {"spectrum": spectrum, "grid": [32, 16], "lengths": ["40 um", "20 um"]},
        "block": {"young_modulus": 4000.0, "poisson_ratio": 0.15, **given},
        "micro": {"model": "half-space"}, "load": {"approach": "0.1 um"},
    }))  # fmt: skip
    assert made.parts.body.shape.height == pytest.approx(1e-3 * height, rel=1e-12)
    said = dict(made.about.statements())["block"]
    assert f"40 µm × 20 µm and {height} µm high, free sides" in said


def test_approaches_below_the_rounding_of_heights_are_refused(tmp_path):
    heights = np.full((8, 8), 1e9)
    heights[::2, 1::2] += 0.02
    heights[1::2, ::2] += 0.02
    np.save(tmp_path / "heights.npy", heights)
    given = {
        "surface": {"file": str(tmp_path / "heights.npy"), "lengths": [1.0, 1.0]},
        "block": {"young_modulus": 4000.0, "poisson_ratio": 0.3},
        "coupling": {"kind": "analytic"},
        "load": {"approach": 1e-9},
    }
    with pytest.raises(InputError, match="is lost in the rounding of the heights") as told:
        make_setup(Scene.from_dict(given))
    assert told.value.key == "load.approach"


@pytest.mark.parametrize("coupling", ["analytic", "concurrent", "consistent"])
def test_a_plane_that_load_steps_find_is_not_solved_for_ahead(coupling):
    setup = make_setup(scene(coupling=coupling, force=1.0))
    assert (setup.parts.plane_at_largest_load is None) == (not setup.scene.on_mesh)
    assert "approach" not in dict(setup.about.statements())["load"] or setup.scene.on_mesh
