"""What a scene leaves open: chosen by measured errors, with respect for what is stated."""

from __future__ import annotations

import json

import numpy as np
import pytest

from patchlaw.multiscale import Scene, make_setup
from patchlaw.multiscale.auto.keys import auto_keys, resolved_sections
from patchlaw.multiscale.machine import ClusterNodes
from patchlaw.support.errors import InputError


def scene(source=None, **sections):
    spectrum = {"hurst": 0.95, "waves": [2, 6], "rms_slope": 0.2, "seed": 1}
    surface = {"spectrum": spectrum, "grid": [48, 48], "lengths": [1.0, 1.0]} | (source or {})
    given = {
        "surface": surface,
        "block": {"young_modulus": 4000.0, "poisson_ratio": 0.15},
        "load": {"approach": 0.008, "steps": 2},
    }
    return Scene.from_dict(given | sections)


def block(**keys):
    return {"young_modulus": 4000.0, "poisson_ratio": 0.15} | keys


def test_tighter_accuracies_measure_smaller_errors_on_finer_grids():
    source = {"spectrum": {"hurst": 0.7, "waves": [2, 8], "rms_slope": 0.2}, "grid": None}
    coupling = {"kind": "analytic"}
    found = [
        make_setup(scene(source, accuracy=accuracy, coupling=coupling))
        for accuracy in (0.2, 0.02, 0.005)
    ]
    errors = [setup.decision.error for setup in found]
    grids = [setup.surface.grid for setup in found]
    assert errors == sorted(errors, reverse=True)
    assert grids == sorted(grids)
    assert grids[0] < grids[-1]
    for setup in found:
        assert setup.decision.kept
        assert not [text for text in setup.warnings() if "accuracy" in text]


def test_auto_values_are_resolved_and_the_plan_says_what_was_measured():
    setup = make_setup(scene({"grid": None}, accuracy=0.05))
    resolved = setup.scene
    assert resolved.coupling.kind in ("concurrent", "consistent")
    assert resolved.patches.grid == (8, 8)
    assert resolved.surface.grid == setup.surface.grid == setup.micro.surface.grid
    assert resolved.micro.model == "half-space"
    assert resolved.block.cells is None  # of no mesh
    assert set(setup.decision.errors) == {"body", "slopes", "zero", "grid"}
    assert setup.decision.error <= setup.decision.accuracy == 0.05
    assert dict(setup.statements())["choice"] == setup.decision.sentence


def test_what_a_run_began_with_is_what_it_goes_on_with():
    given = scene(accuracy=0.05)
    setup = make_setup(given)
    kept = json.loads(json.dumps(resolved_sections(setup, given)))
    again = make_setup(given, resolved=kept)
    assert again.scene == setup.scene
    np.testing.assert_array_equal(again.micro.surface.heights, setup.micro.surface.heights)
    assert again.micro.reference_height == setup.micro.reference_height == setup.surface.highest


def test_a_grid_of_heights_is_resampled_for_the_accuracy():
    fine = make_setup(scene({"grid": [256, 256]}, accuracy=0.1))
    assert fine.surface.grid == (256, 256)
    assert fine.micro.surface.grid[0] < 256  # a coarse one will do
    assert fine.decision.kept


def test_finite_slopes_left_out_are_an_error():
    stated = {"model": "half-space", "finite_slopes": False}
    setup = make_setup(scene({"grid": None}, accuracy=0.01, micro=stated))
    assert setup.decision.errors["slopes"] > 0.01
    (said,) = [text for text in setup.warnings() if "accuracy" in text]
    assert "an accuracy of 1 % is not kept" in said
    assert "most of it by slopes" in said


def test_laws_are_interpolated_to_a_tenth_of_the_accuracy():
    load = {"approach": 0.004, "steps": 3000}
    setup = make_setup(scene(load=load, accuracy=0.2, micro={"model": "half-space"}))
    assert setup.decision.kept
    assert setup.scene.coupling.kind == "consistent"
    assert setup.table_tolerance == pytest.approx(0.02, rel=1e-12)
    stated = scene(accuracy=0.2, coupling={"kind": "consistent"}, load=load)
    begun = make_setup(stated)
    again = make_setup(stated, resolved=json.loads(json.dumps(resolved_sections(begun, stated))))
    assert again.table_tolerance == begun.table_tolerance == setup.table_tolerance


def test_patches_are_no_more_than_the_elements_that_are_stated():
    meshed = {"kind": "isolated"}
    given = scene(accuracy=0.05, coupling=meshed, block=block(cells=[5, 9, 4]))
    assert make_setup(given).patches.grid == (5, 8)


def test_cells_are_left_to_the_plan_only_under_laws_on_a_mesh():
    meshed = {"kind": "consistent", "interface": "pointwise"}
    for coupling, free in (({}, False), ({"kind": "concurrent"}, False), (meshed, True)):
        given = scene(coupling=coupling, accuracy=0.4)
        assert ("block.cells" in auto_keys(given)) == free
    assert make_setup(given).scene.block.cells is None  # as by default


@pytest.mark.parametrize(
    "stated",
    [
        {"patches": {"grid": [3, 5]}},
        {"coupling": {"kind": "consistent"}},
        {"coupling": {"kind": "isolated"}},
        {"block": block(cells=[10, 10, 6])},
        {"micro": {"model": "elliptic"}},
        {"micro": {"model": "half-space", "finite_slopes": False}},
    ],
)
def test_stated_keys_are_respected(stated):
    resolved = make_setup(scene(accuracy=0.05, **stated)).scene
    for section, keys in stated.items():
        for key, value in keys.items():
            found = getattr(getattr(resolved, section), key)
            assert list(found) == value if isinstance(value, list) else found == value
    assert resolved.surface.grid == (48, 48)


def test_without_accuracy_nothing_is_open():
    assert auto_keys(scene()) == frozenset()
    assert auto_keys(scene(accuracy=0.1)) == {"micro.model", "coupling.kind", "patches.grid"}
    assert make_setup(scene()).decision is None


def test_patches_are_nearly_square():
    stated = {"coupling": {"kind": "analytic"}, "micro": {"model": "elliptic"}}
    setup = make_setup(scene({"grid": [96, 48], "lengths": [2.0, 1.0]}, accuracy=0.4, **stated))
    assert setup.patches.grid == (16, 8)
    assert setup.decision is None  # patches gather results, and have no error


def test_a_stated_reference_gets_a_grid_and_patches():
    given = scene({"grid": None}, accuracy=0.05, coupling={"kind": "reference"})
    setup = make_setup(given, mesh_error=lambda setup: 0.001)
    assert setup.surface.grid == (96, 96)  # 16 heights along each of 6 waves
    assert setup.patches.grid == (8, 8)
    assert setup.decision.kept


def test_models_without_measure_say_so():
    setup = make_setup(scene(accuracy=0.05, micro={"model": "elliptic"}))
    assert not setup.decision.errors
    assert not setup.decision.kept
    assert "which is not measured beforehand" in setup.decision.sentence
    assert dict(setup.statements())["error"].startswith("not measured: elliptic")


def test_a_reference_is_taken_where_nothing_else_keeps_the_accuracy():
    setup = make_setup(scene(accuracy=0.0015), mesh_error=lambda setup: 0.001)
    assert setup.scene.coupling.kind == "reference"
    assert setup.cells is None
    assert setup.decision.kept
    assert sum(setup.decision.missed.values()) > 0.0015
    assert "without meshing the roughness measured" in setup.decision.sentence


def test_meshes_are_refined_until_their_error_keeps_the_accuracy():
    def made(accuracy, **reference):
        given = scene(accuracy=accuracy, coupling={"kind": "reference"}, reference=reference)
        return make_setup(given, mesh_error=lambda s: (float(s.rough_meshes.sizes[-1]) / 0.03) ** 3)

    coarse, fine = made(0.1), made(0.01)
    assert fine.rough_meshes.sizes[-1] < coarse.rough_meshes.sizes[-1]
    assert fine.decision.error <= 0.01
    stated = made(0.01, fine=0.03)
    assert stated.rough_meshes.sizes[-1] == pytest.approx(0.03)
    assert "most of it by mesh" in stated.decision.warning


@pytest.mark.parametrize(
    ("wrong", "problem"),
    [
        ({"accuracy": 0.5}, r"accuracy = 0.5: must be less than 0.5"),
        (
            {"accuracy": "2 %"},
            r"accuracy = '2 %': must be a valid number",
        ),
        ({"patches": {"grid": "many"}}, r"patches.grid = 'many': must be a list"),
        ({"patches": {"grid": "auto"}}, r"patches.grid = 'auto': is gone .*leave it out, with"),
    ],
)
def test_refuses(wrong, problem):
    with pytest.raises(InputError, match=problem):
        scene(**wrong)


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
        make_setup(given, nodes=ClusterNodes(memory=16e9))


def test_a_dump_states_every_key_but_the_grid():
    given = scene({"grid": None}, accuracy=0.03)
    assert auto_keys(given) == {"surface.grid", "coupling.kind", "patches.grid", "micro.model"}
    assert auto_keys(Scene.from_dict(given.to_dict())) == {"surface.grid"}


def test_the_plan_says_how_fine_the_heights_are():
    said = dict(make_setup(scene()).statements())["surface"]
    assert "8 heights along the shortest wavelength" in said  # 48 heights, 6 waves
