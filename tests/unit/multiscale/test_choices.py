"""What a scene leaves open: chosen by cost and error, with respect for what is stated."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from geometry.errors import InputError
from multiscale import Scene, make_stage
from multiscale.plan import statements, warnings
from multiscale.planning.choices import MESH_CELLS, cheapest, open_keys
from multiscale.planning.decision import Alternative, decided
from multiscale.planning.forecast import Forecast, forecast, forecast_statements


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


OPEN = {
    "patches": {"grid": "auto"},
    "micro": {"model": "auto"},
    "coupling": {"kind": "auto"},
    "block": block(cells="auto"),
}


def random_alternatives(seed):
    random = np.random.default_rng(seed)
    return [
        Alternative(kind="concurrent", patches=(8, 8), cells=None, error=float(e), seconds=float(s))
        for e, s in random.uniform(0.001, 0.1, (12, 2)).round(2 if seed % 2 else 9)
    ]


@pytest.mark.parametrize("seed", range(8))
def test_a_tighter_accuracy_never_takes_a_larger_error(seed):
    found = random_alternatives(seed)  # odd seeds have ties
    taken = [decided(found, accuracy).taken for accuracy in np.linspace(0.002, 0.12, 60)]
    promised = [decided(found, accuracy).promised for accuracy in np.linspace(0.002, 0.12, 60)]
    errors = [each.error for each in taken]
    assert errors == sorted(errors)
    assert promised == sorted(promised)  # what was promised stays promised
    costs = [each.seconds for each, kept in zip(taken, promised, strict=True) if kept]
    assert costs == sorted(costs, reverse=True)


def test_the_cheapest_that_promises_is_taken_or_else_the_least_error():
    found = random_alternatives(0)
    good = [each for each in found if each.error <= 0.05]
    assert decided(found, 0.05).taken is min(good, key=lambda each: each.seconds)
    hopeless = decided(found, 1e-4)
    assert not hopeless.promised
    assert hopeless.taken is min(found, key=lambda each: each.error)
    assert "for none promises an accuracy of 0.01 %" in hopeless.sentence


def test_tighter_scenes_expect_no_larger_error():
    errors = []
    for accuracy in (0.2, 0.05, 0.01):
        stage = make_stage(scene({"grid": "auto"}, accuracy=accuracy, **OPEN))
        errors.append(forecast(stage).error)
    assert errors == sorted(errors, reverse=True)
    assert errors[-1] < errors[0]


def test_open_keys_become_values_and_isolated_laws_are_not_offered():
    stage = make_stage(scene({"grid": "auto"}, **OPEN))
    settled = stage.scene
    assert settled.coupling.kind in ("concurrent", "consistent")
    assert settled.patches.grid in ((8, 8), (16, 16))
    assert settled.surface.grid == stage.surface.grid
    assert settled.block.cells == "auto"  # of no mesh
    assert {each.kind for each in stage.decision.alternatives} == {"concurrent", "consistent"}
    assert stage.decision.accuracy == 0.02
    assert dict(statements(stage))["choice"] == stage.decision.sentence


def test_cells_are_left_to_the_plan_only_under_laws_on_a_mesh():
    meshed = {"kind": "consistent", "compliance": "finite-element"}
    for coupling, free in (({}, False), ({"kind": "concurrent"}, False), (meshed, True)):
        given = scene(coupling=coupling, block=block(cells="auto"))
        assert open_keys(given) == ({"block.cells"} if free else set())
    decision = make_stage(given).decision
    assert {each.cells for each in decision.alternatives} == set(MESH_CELLS)
    assert decision.taken.cells in MESH_CELLS


def test_few_steps_press_together_and_many_steps_make_laws():
    cheap = {"accuracy": 0.2, "micro": {"model": "half-space"}, "block": block(cells=[8, 8, 8])}
    for steps, kind in ((1, "concurrent"), (3000, "consistent")):
        load = {"approach": 0.004, "steps": steps}
        stage = make_stage(scene(load=load, **cheap))
        assert stage.decision.promised
        assert stage.scene.coupling.kind == kind


@pytest.mark.parametrize(
    "stated",
    [
        {"patches": {"grid": [3, 5]}},
        {"coupling": {"kind": "consistent"}},
        {"coupling": {"kind": "isolated"}},
        {"block": block(cells=[10, 10, 6])},
        {"micro": {"model": "elliptic"}},
        {"micro": {"border": "include"}},
    ],
)
def test_stated_keys_are_respected(stated):
    settled = make_stage(scene(accuracy=0.05, **stated)).scene
    for section, keys in stated.items():
        for key, value in keys.items():
            found = getattr(getattr(settled, section), key)
            assert list(found) == value if isinstance(value, list) else found == value
    assert settled.surface.grid == (48, 48)


@pytest.mark.parametrize(
    ("coupling", "kinds"),
    [
        ({"compliance": "finite-element"}, {"consistent"}),
        ({"newton": "full"}, {"consistent"}),
        ({"table_tolerance": 0.01}, {"consistent"}),
        ({"compliance": "decomposed"}, {"concurrent", "consistent"}),
    ],
)
def test_other_keys_narrow_the_couplings(coupling, kinds):
    stage = make_stage(scene(coupling=coupling | {"kind": "auto"}))
    assert {each.kind for each in stage.decision.alternatives} == kinds


def test_without_accuracy_and_auto_nothing_is_open():
    assert open_keys(scene()) == frozenset()
    assert open_keys(scene(accuracy=0.1)) == {"micro.model", "coupling.kind", "patches.grid"}
    assert make_stage(scene()).decision is None


def test_patches_are_nearly_square():
    stage = make_stage(scene({"grid": [96, 48], "lengths": [2.0, 1.0]}, patches={"grid": "auto"}))
    assert stage.patches.grid in ((16, 8), (32, 16))


def test_the_grid_follows_the_shortest_wave_and_the_accuracy():
    def grid(waves, accuracy):
        source = {"spectrum": {"hurst": 0.8, "waves": waves, "rms_slope": 0.2}, "grid": "auto"}
        return make_stage(scene(source, accuracy=accuracy)).surface.grid[0]

    assert grid([2, 12], 0.1) >= 96  # eight heights along a wave at least
    assert grid([2, 6], 0.02) >= grid([2, 6], 0.1) >= 48


def test_what_cannot_be_promised_is_said():
    stage = make_stage(scene(accuracy=0.001, micro={"model": "elliptic-independent"}))
    made = forecast(stage)
    assert made.error > 0.001
    said = [text for text in warnings(stage, made) if "cannot be promised" in text]
    assert len(said) == 1
    assert "an accuracy of 0.1 % cannot be promised" in said[0]
    assert "most of it by the micro model" in said[0]
    assert made.broken_promise == said[0]
    assert dataclasses.replace(made, accuracy=None).broken_promise is None


@pytest.mark.parametrize(
    ("wrong", "problem"),
    [
        ({"accuracy": 0.5}, r"accuracy = 0.5: must be less than 0.5"),
        (
            {"accuracy": "2 %"},
            r"accuracy = '2 %': is not a number \(allowed: a number without quotes",
        ),
        ({"patches": {"grid": "many"}}, r"patches.grid = 'many': must be a valid tuple"),
        ({"coupling": {"kind": "auto", "love": "centre"}}, r"love = 'centre' does not go with"),
        ({"source": {"spectrum": None, "file": "a.npy", "grid": "auto"}}, r"needs a 'spectrum'"),
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
def test_sizes_that_fit_no_memory_are_refused_before_anything_is_made(
    monkeypatch, sections, problem
):
    def never(scene):
        raise AssertionError("a surface was made")

    monkeypatch.setattr("multiscale.staging.make_surface", never)
    pages = {"SC_PAGE_SIZE": 4096, "SC_PHYS_PAGES": 4_000_000}  # 16 GB
    monkeypatch.setattr("multiscale.nodes.os.sysconf", pages.__getitem__)
    with pytest.raises(InputError, match=problem):
        make_stage(scene(**sections))


def test_open_keys_survive_a_dump_and_are_in_the_schema():
    given = scene({"grid": "auto"}, accuracy=0.03, **OPEN)
    again = Scene.from_dict(given.model_dump(by_alias=True, mode="json"))
    assert open_keys(again) == open_keys(given) == {
        "surface.grid", "micro.model", "coupling.kind", "patches.grid",
    }  # fmt: skip
    patches = Scene.model_json_schema(by_alias=True)["$defs"]["PatchesSection"]
    assert {"const": "auto"} in patches["properties"]["grid"]["anyOf"]


def test_the_plan_says_how_fine_the_heights_are():
    said = dict(statements(make_stage(scene())))["surface"]
    assert "8 heights along the shortest wavelength" in said  # 48 heights, 6 waves


def test_nothing_to_choose(monkeypatch):
    monkeypatch.setattr("multiscale.planning.choices._scenes", lambda *given: [])
    with pytest.raises(InputError, match=r"coupling\.kind: leaves nothing to choose"):
        cheapest(None, None, frozenset(), None)


def test_a_bound_beyond_the_force_itself_is_no_number():
    made = Forecast(
        seconds={}, memory=1e9, errors={"mesh": 1.0, "block": 0.004}, slopes=0.0, accuracy=0.02
    )
    told = dict(forecast_statements(made))["error"]
    assert told == (
        "no accuracy can be told: the force may be off by as much as it is "
        "(mesh an unknown error, block 0.4 %)"
    )
    assert "off by as much as it is, most of it by the mesh" in made.broken_promise
    small = dataclasses.replace(made, errors={"mesh": 0.0123}, slopes=0.026)
    assert dict(forecast_statements(small))["error"].startswith(
        "the force, at a given approach, within 1.2 % of the small-slope limit (mesh 1.2 %); finite"
    )
