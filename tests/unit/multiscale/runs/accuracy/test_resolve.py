"""What a scene leaves open: chosen by measured errors, with respect for what is stated."""

from __future__ import annotations

import json

import numpy as np
import pytest

from patchlaw.multiscale import Scene, make_setup, resolve, run
from patchlaw.multiscale.machine import ClusterNodes
from patchlaw.support import InputError


def scene(source=None, **sections):
    spectrum = {"hurst": 0.95, "waves": [2, 6], "rms_slope": 0.2, "seed": 1}
    surface = {"spectrum": spectrum, "grid": [48, 48], "lengths": [1.0, 1.0]} | (source or {})
    given = {
        "surface": surface,
        "block": {"young_modulus": 4000.0, "poisson_ratio": 0.15},
        "load": {"approach": 0.008, "steps": 2},
    }
    return Scene.from_dict(given | sections)


def made(given, nodes=None, **options):
    return make_setup(resolve(given, nodes=nodes, **options), nodes=nodes)


def block(**keys):
    return {"young_modulus": 4000.0, "poisson_ratio": 0.15} | keys


@pytest.mark.long
def test_tighter_accuracies_measure_smaller_errors_on_finer_grids():
    source = {"spectrum": {"hurst": 0.7, "waves": [2, 8], "rms_slope": 0.2}, "grid": None}
    coupling = {"kind": "analytic"}
    found = [
        made(scene(source, accuracy=accuracy, coupling=coupling)) for accuracy in (0.2, 0.02, 0.005)
    ]
    errors = [setup.parts.decision.error for setup in found]
    grids = [setup.parts.surface.grid for setup in found]
    assert errors == sorted(errors, reverse=True)
    assert grids == sorted(grids)
    assert grids[0] < grids[-1]
    for setup in found:
        assert setup.parts.decision.kept
        assert not [text for text in setup.about.warnings() if "accuracy" in text]


def test_auto_values_are_resolved_and_the_plan_says_what_was_measured():
    setup = made(scene({"grid": None}, accuracy=0.05))
    resolved = setup.scene
    assert resolved.coupling.kind in ("concurrent", "consistent")
    assert resolved.patches.grid == (8, 8)
    assert resolved.surface.grid == setup.parts.surface.grid == setup.parts.micro.surface.grid
    assert resolved.micro.model == "half-space"
    assert resolved.block.cells is None  # of no mesh
    assert set(setup.parts.decision.errors) == {"body", "slopes", "zero", "grid"}
    assert setup.parts.decision.error <= setup.parts.decision.accuracy == 0.05
    assert dict(setup.about.statements())["choice"] == setup.parts.decision.sentence


def test_a_grid_of_heights_is_resampled_for_the_accuracy():
    fine = made(scene({"grid": [256, 256]}, accuracy=0.1))
    assert fine.parts.surface.grid == (256, 256)
    assert fine.parts.micro.surface.grid[0] < 256  # a coarse one will do
    assert fine.parts.decision.kept


def test_finite_slopes_left_out_are_an_error():
    stated = {"model": "half-space", "finite_slopes": False}
    setup = made(scene({"grid": None}, accuracy=0.01, micro=stated))
    assert setup.parts.decision.errors["slopes"] > 0.01
    (said,) = [text for text in setup.about.warnings() if "accuracy" in text]
    assert "an accuracy of 1 % is not kept" in said
    assert "most of it by slopes" in said


def test_laws_are_interpolated_to_a_tenth_of_the_accuracy():
    load = {"approach": 0.004, "steps": 3000}
    setup = made(scene(load=load, accuracy=0.2, micro={"model": "half-space"}))
    assert setup.parts.decision.kept
    assert setup.scene.coupling.kind == "consistent"
    assert setup.table_tolerance == pytest.approx(0.02, rel=1e-12)
    stated = scene(accuracy=0.2, coupling={"kind": "consistent"}, load=load)
    begun = made(stated)
    again = made(Scene.from_dict(json.loads(json.dumps(begun.scene.written))))
    assert again.table_tolerance == begun.table_tolerance == setup.table_tolerance


def test_patches_are_no_more_than_the_elements_that_are_stated():
    meshed = {"kind": "isolated"}
    given = scene(accuracy=0.05, coupling=meshed, block=block(cells=[5, 9, 4]))
    assert made(given).parts.patches.grid == (5, 8)


def test_cells_are_left_to_the_plan_only_under_laws_on_a_mesh():
    meshed = {"kind": "consistent", "interface": "pointwise"}
    for coupling, free in (({}, False), ({"kind": "concurrent"}, False), (meshed, True)):
        given = scene(coupling=coupling, accuracy=0.4)
        assert ("block.cells" in given.open_keys) == free
    assert made(given).scene.block.cells == (40, 40, 25)  # as by default


@pytest.mark.parametrize("stated", [
    {"patches": {"grid": [3, 5]}}, {"coupling": {"kind": "consistent"}},
    {"coupling": {"kind": "isolated"}}, {"block": block(cells=[10, 10, 6])},
    {"micro": {"model": "elliptic"}}, {"micro": {"model": "half-space", "finite_slopes": False}},
])  # fmt: skip
def test_stated_keys_are_respected(stated):
    resolved = made(scene(accuracy=0.05, **stated)).scene
    for section, keys in stated.items():
        for key, value in keys.items():
            found = getattr(getattr(resolved, section), key)
            assert list(found) == value if isinstance(value, list) else found == value
    assert resolved.surface.grid == (48, 48)


def test_without_accuracy_nothing_is_open():
    assert scene().open_keys == frozenset()
    assert scene(accuracy=0.1).open_keys == {"micro.model", "coupling.kind", "patches.grid"}
    assert made(scene()).scene.decision is None


def test_what_is_left_open_is_no_setup():
    for source, opened in (({"grid": None}, ", surface.grid open"), ({}, "patches.grid open")):
        with pytest.raises(InputError, match=rf"coupling.kind.*{opened}.*resolve\(scene"):
            make_setup(scene(source, accuracy=0.05))


@pytest.mark.parametrize("grid", [[64, 64], [64, 16]])
def test_cells_are_no_fewer_than_patches(grid):
    source, patches = {"grid": [64, 64]}, {"grid": grid}
    found = resolve(scene(source, accuracy=0.2, patches=patches, coupling={"kind": "analytic"}))
    assert found.micro.cells == (64, max(48, grid[1]))


def test_edges_that_were_chosen_have_their_unit(monkeypatch):
    """So that no one is warned of a number without one."""
    monkeypatch.setattr("patchlaw.multiscale.runs.refining.Search.is_small", lambda *_: False)
    given = scene(accuracy=0.03, coupling={"kind": "reference"})
    found = made(given, mesh_error=lambda _: 0.001)
    assert found.scene.decision.keys["reference.fine"].endswith(" mm")
    assert "reference.fine" not in " ".join(found.about.warnings())


def test_patches_are_nearly_square():
    stated = {"coupling": {"kind": "analytic"}, "micro": {"model": "elliptic"}}
    setup = made(scene({"grid": [96, 48], "lengths": [2.0, 1.0]}, accuracy=0.4, **stated))
    assert setup.parts.patches.grid == (16, 8)
    assert setup.parts.decision is None  # patches gather results, and have no error


def test_a_stated_reference_gets_a_grid_and_patches():
    given = scene({"grid": None}, accuracy=0.05, coupling={"kind": "reference"})
    setup = made(given, mesh_error=lambda setup: 0.001)
    assert setup.parts.surface.grid == (96, 96)  # 16 heights along each of 6 waves
    assert setup.parts.patches.grid == (8, 8)
    assert setup.parts.decision.kept


def test_models_without_measure_say_so():
    setup = made(scene(accuracy=0.05, micro={"model": "elliptic"}))
    assert not setup.parts.decision.errors
    assert not setup.parts.decision.kept
    assert "which is not measured beforehand" in setup.parts.decision.sentence
    assert dict(setup.about.statements())["error"].startswith("not measured: elliptic")


@pytest.mark.long
def test_a_reference_is_taken_where_nothing_else_keeps_the_accuracy():
    setup = made(scene(accuracy=0.0015), mesh_error=lambda setup: 0.001)
    assert setup.scene.coupling.kind == "reference"
    assert setup.parts.cells is None
    assert setup.parts.decision.kept
    assert sum(setup.parts.decision.missed.values()) > 0.0015
    assert "without meshing the roughness measured" in setup.parts.decision.sentence


def test_meshes_are_refined_until_their_error_keeps_the_accuracy():
    def refined(accuracy, **reference):
        given = scene(accuracy=accuracy, coupling={"kind": "reference"}, reference=reference)
        return made(given, mesh_error=lambda s: (float(s.rough_meshes.sizes[-1]) / 0.03) ** 3)

    coarse, fine = refined(0.1), refined(0.01)
    assert fine.rough_meshes.sizes[-1] < coarse.rough_meshes.sizes[-1]
    assert fine.parts.decision.error <= 0.01
    stated = refined(0.01, fine=0.03)
    assert stated.rough_meshes.sizes[-1] == pytest.approx(0.03)
    assert "most of it by mesh" in stated.parts.decision.warning


@pytest.mark.parametrize(
    ("sections", "problem"),
    [
        ({"patches": {"grid": [1000, 1000]}}, r"patches\.grid = \[1000, 1000\]: the interaction"),
        (
            {"coupling": {"kind": "concurrent"}, "patches": {"grid": [600, 600]}},
            r"patches\.grid = \[600, 600\]: the interaction of all patches with each other needs",
        ),
        (
            {"patches": {"grid": [40, 40]}, "load": {"approach": 0.01, "steps": 1_000_000}},
            r"load\.steps = 1000000: the history of 1600 patches needs .* GB .*allowed: what fits",
        ),
        (
            {"coupling": {"kind": "analytic"}, "patches": {"grid": [1000, 1000]},
             "load": {"approach": 0.01, "steps": 10_000}},
            r"load\.steps = 10000: the history of 1000000 patches",
        ),
        ({"source": {"grid": [1_000_000, 1_000_000]}}, r"surface\.grid = \[1000000, 1000000\]"),
    ],
)  # fmt: skip
def test_sizes_that_fit_no_memory_are_refused_before_anything_is_made(sections, problem):
    source = {"spectrum": None, "file": "nowhere.npy", "grid": None}  # could not be read
    given = scene(**{"source": source} | sections)
    with pytest.raises(InputError, match=problem):
        made(given, nodes=ClusterNodes(memory=16e9))


def test_a_dump_states_every_key_but_the_grid():
    given = scene({"grid": None}, accuracy=0.03)
    assert given.open_keys == {"surface.grid", "coupling.kind", "patches.grid", "micro.model"}
    assert Scene.from_dict(given.to_dict()).open_keys == {"surface.grid"}


def test_the_plan_says_how_fine_the_heights_are():
    said = dict(made(scene()).about.statements())["surface"]
    assert "8 heights along the shortest wavelength" in said  # 48 heights, 6 waves


def stated(kind="concurrent", **sections):
    return scene({"grid": [64, 64]}, coupling={"kind": kind}, **sections)


@pytest.mark.long
def test_a_resolved_scene_states_all_that_its_run_takes(tmp_path):
    """Run from what was written of it, it has the same numbers, and nothing is chosen again."""
    given = scene({"grid": [64, 64]}, accuracy=0.2, output={"figures": False})
    chosen = resolve(given)
    assert given.open_keys and not chosen.open_keys and resolve(chosen) is chosen
    assert chosen.micro.cells == (48, 48) and chosen.decision.kept
    again = Scene.from_dict(json.loads(json.dumps(chosen.to_dict())))
    assert again == chosen and again.decision is None
    forces = [run(one).force_N for one in (given, chosen, again)]
    np.testing.assert_array_equal(forces[0], forces[1])
    np.testing.assert_array_equal(forces[0], forces[2])


def test_cells_of_contact_problems_are_not_those_of_the_heights():
    """As many as heights change nothing; others lie between the heights, as by resampling."""
    micro = {"model": "half-space", "finite_slopes": False}
    own, same, other = (
        run(stated(micro=micro | cells)) for cells in ({}, {"cells": [64, 64]}, {"cells": [80, 48]})
    )
    np.testing.assert_allclose(same.force_N, own.force_N, rtol=1e-12)
    assert not np.allclose(other.force_N, own.force_N, rtol=1e-8)
    np.testing.assert_allclose(other.force_N, own.force_N, rtol=0.05)
    setup = make_setup(stated(micro=micro | {"cells": [80, 48]}))
    assert setup.parts.cells == (80, 48) and setup.parts.surface.grid == (64, 64)


@pytest.mark.long
@pytest.mark.parametrize("coupled", [False, True])
def test_friction_is_that_of_the_cells(coupled):
    """Shear on more cells than heights is near that on these, not that of cells of other sizes."""
    sections = {
        "friction": {"coefficient": 0.3, "coupled": coupled},
        "load": {"force": 1.0, "steps": 1, "shear": ["0.02 um", "0"]},
        "output": {"figures": False, "check": "none"},
    }
    flat = {"finite_slopes": False}
    fine, coarse = (
        run(stated("analytic", micro=flat | {"cells": cells}, **sections)).steps[-1]
        for cells in ([128, 128], [64, 64])
    )
    # the error of the coarser cells; spacings of the heights would double the shear
    assert fine.shear_force_x_N == pytest.approx(coarse.shear_force_x_N, rel=0.25)


def test_patches_are_no_more_than_cells():
    given = stated(micro={"cells": [8, 8]}, patches={"grid": [9, 4]})
    with pytest.raises(InputError, match=r"patches\.grid = \[9, 4\]: more patches than cells of"):
        make_setup(given)
