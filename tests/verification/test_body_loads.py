"""Loads of bodies besides the contact, stage by stage: closed forms, balances, and each other."""

import numpy as np
import pytest
from helpers.box_msh import write_box
from helpers.laws_on_mesh import lay_on_mesh
from scipy.optimize import brentq

from patchlaw.geometry import BlockShape
from patchlaw.multiscale import Run, Scene
from patchlaw.multiscale.runs.output.results_folder import FILE_NAME, find_checkpoint
from patchlaw.support.files import write_record

TICKS = BlockShape(interface=(1.0, 1.0), height=1.0, cells=(4, 4, 3)).ticks
E, NU, EXPANSION = 4000.0, 0.15, 20e-6
MATERIAL = {"young_modulus": E, "poisson_ratio": NU}
SAMPLE = {
    "spectrum": {"hurst": 0.9, "waves": [2, 4], "rms_slope": 0.2, "seed": 3},
    "grid": [16, 16],
    "lengths": [0.1, 0.1],
}
QUIET = {"figures": False, "report": False, "check": "none", "contact": "none"}
SLIDING = [
    {"surface": "bottom", "displacement": ["free", "free", 0]},
    {"surface": "left", "displacement": [0, "free", "free"]},
    {"surface": "front", "displacement": ["free", 0, "free"]},
]
"""Supports that leave a column free to grow in all directions."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("meshes")
    x, y, z = TICKS
    write_box(place / "cube.msh", TICKS)
    write_box(place / "halves.msh", TICKS, halves=True)
    write_box(place / "above.msh", (x, y, -z[::-1]))
    return place


def body(folder, name="cube", **changes):
    whole = {"mesh": str(folder / f"{name}.msh"), "contact": "top", "supports": SLIDING}
    return whole | MATERIAL | changes


def sections(load, **others):
    # a law of few rows: both sides of every comparison have the same
    few = {"table_tolerance": 0.02}
    whole = {"surface": SAMPLE, "law": {"kind": "representative"}, "output": QUIET, "load": load,
             "coupling": few}  # fmt: skip
    return {key: value for key, value in (whole | others).items() if value is not None}


def done(load, **others):
    whole = Run(Scene.from_dict(sections(load, **others)))
    list(whole.load_steps())
    return whole


def forces(whole):
    return np.array([step.force_N for step in whole.steps])


def approaches(whole):
    return np.array([step.approach_mm for step in whole.steps])


def column(whole, approach, stretch):
    """Return the pressure of a free column that grows by a stretch, in series with the law."""
    (law,) = whole.coupling.table.laws

    def excess(pressure):
        return float(law.pressure(approach + stretch - pressure / E)) - pressure

    return brentq(excess, 0.0, 100.0, xtol=1e-13)


def test_a_bar_is_heated_between_plates(folder):
    sides = [{"surface": "right", "pressure": "20 MPa"}]
    stages = [
        {"approach": "2 um", "steps": 2},
        {"hold": "approach", "body": {"temperature": "100 K"}, "steps": 2},
        {"hold": "approach", "body": {"temperature": "-20 K"}, "steps": 1},
        {"approach": "1.5 um", "steps": 1, "body": {"tractions": sides}},  # as cold as before
    ]
    found = done({"stage": stages}, body=body(folder, thermal_expansion="20 um/m/K"))
    assert approaches(found) == pytest.approx([1e-3, *[2e-3] * 4, 1.5e-3], rel=1e-14)
    states = [(1e-3, 0.0), (2e-3, 0.0), (2e-3, 50.0), (2e-3, 100.0), (2e-3, -20.0)]
    expected = [column(found, approach, EXPANSION * rise) for approach, rise in states]
    expected.append(column(found, 1.5e-3, NU * 20.0 / E - EXPANSION * 20.0))
    assert forces(found) == pytest.approx(expected, rel=1e-9)  # Newton's residual; on 1 mm²
    assert [step.stage for step in found.steps] == [1, 1, 2, 2, 3, 4]


@pytest.mark.long
def test_volumes_have_temperatures_and_expansions_of_their_own(folder):
    grows = {**MATERIAL, "thermal_expansion": "20e-6 1/K"}
    load = {"force": "2 N", "steps": 1}
    apart = halves(folder) | {"supports": SLIDING}
    sample = [{**SAMPLE, "surface": "upper half"}]
    law = {"kind": "representative", "regions": sample}
    ways = [
        ({"body": grows, "other": grows}, "10 K"),
        ({"body": {**grows, "thermal_expansion": "10e-6 1/K"}, "other": grows},
         {"body": "20 K", "other": "10 K"}),
    ]  # fmt: skip
    found = [
        done(load, law=law, body={**apart, "materials": materials, "temperature": rise})
        for materials, rise in ways
    ]
    whole = body(folder, "halves", thermal_expansion=EXPANSION, temperature=10.0)
    cold = body(folder, "halves")
    expected = approaches(done(load, law=law, body=whole))
    assert [one.steps[0].approach_mm for one in found] == pytest.approx([*expected] * 2, rel=1e-10)
    # 10 K raise the face by 0.2 µm, which the plane goes back
    assert expected == pytest.approx(approaches(done(load, law=law, body=cold)) - 2e-4, rel=1e-8)


def test_a_pressure_on_the_sides_stretches_a_column(folder):
    loads = [{"surface": name, "pressure": "20 MPa"} for name in ("right", "back")]
    found = done({"approach": "2 um", "steps": 1}, body=body(folder, tractions=loads))
    expected = column(found, 2e-3, 2 * NU * 20.0 / E)
    assert forces(found) == pytest.approx([expected], rel=1e-9)
    loads = [
        {"surface": "right", "stress": [-20, 0, 0]},
        {"surface": "back", "stress": [0, -20, 0]},
    ]
    found = done({"approach": "2 um", "steps": 1}, body=body(folder, tractions=loads))
    assert forces(found) == pytest.approx([expected], rel=1e-9)


CLAMPED = [{"surface": "bottom"}]
WASHERS = "upper half"
"""Half of the top; the contact is the other half, 0.5 mm² large."""


def reaction(whole):
    """Return the force that supports bear along the normal, from the whole displacements."""
    solver = whole.coupling.model
    moved = solver.face.body.stiffness.createVecRight()
    moved.array[:] = solver.solved[1].displacement
    return solver.face.body.reaction(moved)


BOLTS = [{"surface": WASHERS, "pull": "6 N"}]


def halves(folder, **changes):
    """Return a body whose top is a contact face and one for washers beside it."""
    constants = {"materials": {name: MATERIAL for name in ("body", "other")}}
    found = body(folder, "halves", supports=CLAMPED, **constants, **changes)
    return {key: value for key, value in found.items() if key not in MATERIAL}


@pytest.mark.long
def test_the_contact_bears_the_pull_of_bolts_and_supports_do_not(folder):
    held = halves(folder)
    stages = [{"name": "bolts", "steps": 2, "body": {"pretension": BOLTS}}]
    found = done({"stage": stages}, body=held)
    assert forces(found) == pytest.approx([3.0, 6.0], rel=1e-9)
    assert abs(reaction(found)) < 1e-6 * 6.0  # residuals of linear solves
    # 6 N beside the bolts go to the supports
    found = done({"stage": [{**stages[0], "force": "6 N"}]}, body=held)
    assert forces(found) == pytest.approx([6.0, 12.0], rel=1e-9)
    assert reaction(found) == pytest.approx(6.0, rel=1e-6)
    # the same by a traction on 0.5 mm², and the sum of forces
    traction = [{"surface": WASHERS, "stress": [0, 0, 12]}]
    by_hand = [{"force": "12 N", "steps": 2, "body": {"tractions": traction}}]
    other = done({"stage": by_hand}, body=held)
    assert approaches(other) == pytest.approx(approaches(found), rel=1e-9)


@pytest.mark.long
def test_bolts_on_one_side_turn_a_free_plane(folder):
    bolts = [{"surface": WASHERS, "pull": "1 N"}]
    load = {"force": "9 N", "steps": 2, "tilt": "free"}
    found = done(load, body=halves(folder, pretension=bolts))
    assert forces(found) == pytest.approx([5.5, 10.0], rel=1e-9)
    moments = np.array([step.moment_N_mm for step in found.steps])
    # the middles of both halves are half a side apart
    np.testing.assert_allclose(moments, [[0.5, 0.0]] * 2, atol=1e-8 * 10.0)
    level = done({**load, "tilt": [0, 0]}, body=halves(folder, pretension=bolts))
    assert abs(level.steps[-1].moment_N_mm[0] - 0.5) > 0.1


@pytest.mark.slow
def test_a_counter_body_is_loaded_too(folder):
    above = body(folder, "above", contact="bottom", supports=[{"surface": "top"}, *SLIDING[1:]])
    load = {"approach": "2 um", "steps": 1}
    grown = {"thermal_expansion": EXPANSION, "temperature": 30.0}
    one = done(load, body=body(folder, **grown), counter_body=above)
    supports = [{"surface": "top", "displacement": ["free", "free", 0]}, *SLIDING[1:]]
    other = done(load, body=body(folder), counter_body=above | {"supports": supports} | grown)
    same = done(load, body=body(folder, **grown), counter_body=above | {"supports": supports})
    assert forces(other) == pytest.approx(forces(same), rel=1e-8)
    assert forces(one)[0] == pytest.approx(forces(same)[0], rel=0.05)  # clamped


BOLTED = [
    {"name": "bolts", "steps": 2, "body": {"pretension": [{"surface": "right", "pull": "6 N"}]}},
    {
        "name": "fluid",
        "force": "-2 N",
        "steps": 2,
        "cycles": 2,
        "body": {"tractions": [{"surface": "back", "pressure": "3 MPa"}]},
    },
    {"name": "heat", "hold": "approach", "steps": 2, "body": {"temperature": "40 K"}},
]


def bolted(folder, **load):
    held = body(folder, supports=CLAMPED, thermal_expansion=EXPANSION)
    return Scene.from_dict(sections({"stage": BOLTED, **load}, body=held))


@pytest.fixture(scope="module")
def whole(folder):
    """The run of all stages, and the folders of its checkpoints by the load steps before them."""
    whole, places = Run(bolted(folder)), {}
    for step in whole.load_steps():
        if step.step in (4, 10):
            places[step.step] = folder / f"after {step.step}"
            places[step.step].mkdir()
            path = places[step.step] / FILE_NAME
            write_record(path, whole.checkpoint(whole.coupling.state()))
    return whole, places


@pytest.mark.long
def test_cyclic_stages_come_back(whole):
    whole, _ = whole
    expected = [3, 6, 5, 4, 5, 6, 5, 4, 5, 6]
    assert forces(whole)[:10] == pytest.approx(expected, rel=1e-9)
    found = approaches(whole)
    assert found[[3, 5]] == pytest.approx(found[[7, 9]], rel=1e-8)
    assert found[5] == pytest.approx(found[1], rel=1e-8)
    assert found[10:] == pytest.approx(found[[9, 9]], rel=1e-14)
    assert [step.stage for step in whole.steps] == [1, 1, *[2] * 8, 3, 3]
    assert whole.steps[3].body_state == 3.0 and whole.steps[-1].body_state == 5.0


@pytest.mark.long
def test_a_run_goes_on_within_stages(folder, whole):
    scene, (first, places) = bolted(folder), whole
    for place in places.values():
        again, kept = Run(scene), find_checkpoint(place, scene)
        again.resume(kept)
        list(again.load_steps())
        assert len(again.steps) == 12, place
        # Newton's residual
        assert forces(again) == pytest.approx(forces(first), rel=1e-9), place
        assert approaches(again) == pytest.approx(approaches(first), rel=1e-9), place


@pytest.mark.slow
def test_steps_that_change_the_force_by_too_much_are_halved_in_stages(folder, whole):
    plain, _ = whole
    divided = Run(bolted(folder, force_change=0.15))
    divided.coupling.table = plain.coupling.table
    list(divided.load_steps())
    found = forces(divided)
    changes = np.abs(np.diff(found)) / np.maximum.accumulate(found)[1:]
    assert changes.max() <= 0.15 * (1 + 1e-9)
    assert len(found) > 12
    assert found[-1] == pytest.approx(plain.steps[-1].force_N, rel=1e-8)


PATCHES = {
    "surface": {**SAMPLE, "lengths": [1, 1]},
    "patches": {"grid": [2, 2]},
    "micro": {"finite_slopes": False},
    "law": None,
}
BLOCK = {"young_modulus": E, "poisson_ratio": NU, "cells": [4, 4, 3]}
COUPLINGS = {
    "half-space": ({"kind": "analytic"}, {"block": BLOCK}),
    "concurrent": ({"kind": "concurrent"}, {"block": BLOCK}),
    "laws": ({"kind": "consistent", "table_tolerance": 0.01}, {"block": BLOCK}),
    "reference": ({"kind": "reference"}, {"block": BLOCK, "reference": {"fine": 0.15}}),
    "body": ({"kind": "isolated", "table_tolerance": 0.01}, {}),
}


# one for each place that knows the nominal area
@pytest.mark.long
@pytest.mark.parametrize("name", ["half-space", "reference", "body"])
def test_a_mean_pressure_is_a_force(folder, name):
    coupling, others = COUPLINGS[name]
    others = PATCHES | {"coupling": coupling} | (others or {"body": body(folder)})
    found = done({"pressure": ["0.3 MPa", "0.1 MPa"], "steps": 1}, **others)
    expected = done({"force": [0.3, 0.1], "steps": 1}, **others)
    assert forces(found) == pytest.approx(forces(expected), rel=1e-14)
    assert approaches(found) == pytest.approx(approaches(expected), rel=1e-12)
    assert found.history().mean_pressure_MPa == pytest.approx([0.3, 0.1], rel=1e-8)


def test_a_mean_pressure_on_a_face_of_another_size(folder):
    found = done({"pressure": "3 MPa", "steps": 1}, body=body(folder, mesh_unit="um"))
    assert forces(found) == pytest.approx([3e-6], rel=1e-9)


@pytest.mark.parametrize("name", ["half-space", "concurrent", "laws"])
def test_stages_of_the_plane_alone_are_turning_points(folder, name):
    coupling, others = COUPLINGS[name]
    others = PATCHES | {"coupling": coupling} | others
    plain = done({"approach": ["6 um", "2 um"], "steps": 2}, **others)
    load = {"stage": [{"approach": "6 um"}, {"approach": "2 um"}], "steps": 2}
    assert forces(done(load, **others)) == pytest.approx(forces(plain), rel=1e-9)
    # there by approach, back by the forces that belong to it
    force = float(forces(plain)[-1])
    load["stage"][1] = {"force": force, "steps": 1}
    mixed = done(load, **others)
    assert approaches(mixed) == pytest.approx([3e-3, 6e-3, 2e-3], rel=1e-6)


@pytest.mark.long
@pytest.mark.parametrize(
    ("kind", "interface"),
    [("isolated", "pointwise"), pytest.param("consistent", "patchwise", marks=pytest.mark.slow)],
)
def test_laws_of_patches_know_loads_of_the_body(folder, kind, interface, monkeypatch):
    """The uniform growth of a body by heat is an approach."""
    coupling = {"kind": kind, "table_tolerance": 0.01, "interface": interface}
    laws = PATCHES | {"coupling": coupling}
    warm = body(folder, thermal_expansion=EXPANSION, temperature=100.0)
    found = done({"approach": "4 um", "steps": 1}, **laws, body=warm)
    assert not found.coupling.condensed
    lay_on_mesh(monkeypatch)
    cold = Run(Scene.from_dict(sections(
        {"approach": "6 um", "steps": 1},
        **laws, body=body(folder),
    )))  # fmt: skip
    cold.coupling.table = found.coupling.table
    list(cold.load_steps())
    assert forces(found) == pytest.approx(forces(cold), rel=1e-8)


@pytest.mark.slow
def test_laws_on_a_block_know_loads_of_a_counter_body(folder):
    """The counter-body grows by heat: as an approach that is larger by its growth."""
    x, y, _ = TICKS
    block = {**MATERIAL, "cells": [len(x) - 1, len(y) - 1, 3]}
    above = body(folder, "above", contact="bottom", supports=[
        {"surface": "top", "displacement": ["free", "free", 0]}, *SLIDING[1:]
    ])  # fmt: skip
    grown = {"thermal_expansion": EXPANSION, "temperature": 100.0}
    laws = PATCHES | {"coupling": {"kind": "consistent", "table_tolerance": 0.01}, "block": block}
    warm = done({"approach": "4 um", "steps": 1}, **laws, counter_body=above | grown)
    cold = done({"approach": "6 um", "steps": 1}, **laws, counter_body=above)
    # one on the mesh of the block, the other without: a coarse mesh is a few per cent stiffer
    assert forces(warm) == pytest.approx(forces(cold), rel=0.1)
