"""Sections on bodies, the other side and laws: what is read, and the words of refusals."""

import re

import pytest

from patchlaw.multiscale.scene.scene import Scene
from patchlaw.support.errors import InputError

SAMPLE = {"spectrum": {"hurst": 0.8, "waves": [2, 4], "rms_slope": 0.1}, "grid": [16, 16]}
SURFACE = {**SAMPLE, "lengths": ["1 mm", "1 mm"]}
STEEL = {"young_modulus": "210 GPa", "poisson_ratio": 0.3}
HELD = [{"surface": "back", "displacement": ["0", "free", "0.1 um"]}]
BODY = {"mesh": "part.msh", "contact": "face", "supports": HELD, **STEEL}
PULLED = {"surface": 1, "stress": ["0", "0", "1 MPa"]}
REPRESENTATIVE = {"law": {"kind": "representative"}}


def scene(**sections):
    data = {"surface": SURFACE, "load": {"approach": "1 um"}}
    if "body" not in sections and "block" not in sections:
        data["block"] = STEEL
    return Scene.from_dict({**data, **sections})


def test_a_body_has_supports_materials_and_loads():
    materials = {"steel": STEEL, "lining": {"young_modulus": "8 GPa", "poisson_ratio": 0.25}}
    body = {key: BODY[key] for key in ("mesh", "contact", "supports")}
    loads = [{"surface": 7, "stress": ["0", 0, "1 MPa"]}]
    found = scene(body={**body, "materials": materials, "tractions": loads}).body
    assert found.supports[0].displacement == (0.0, "free", pytest.approx(1e-4))
    assert found.materials["lining"].young_modulus == 8000.0
    assert found.tractions[0].surface == 7 and found.tractions[0].stress == (0.0, 0.0, 1.0)
    assert found.whole_material is None
    assert (found.element, found.mesh_unit, found.place) == ("linear", "mm", None)


def test_a_counter_body_is_a_half_space_or_a_mesh():
    assert scene(counter_body=STEEL).counter_body.whole_material.young_modulus == 210e3
    assert scene(counter_body=BODY).counter_body.contact == "face"


def test_a_law_of_samples():
    law = {"kind": "representative", "seeds": [1, 2], "crown": ["2 m", "inf"]}
    law["regions"] = [{"surface": "ring", **SURFACE}]
    found = scene(body=BODY, law=law).law
    assert found.representative and found.crown == (2000.0, "inf")
    assert found.regions[0].surface == "ring" and found.regions[0].grid == (16, 16)


def without(data, *keys):
    return {key: value for key, value in data.items() if key not in keys}


HOT = {"temperature": "50 K"}
BOLTED = {**BODY, "pretension": [{"surface": 1, "pull": "3 N"}]}
EXPANDS = {"steel": {**STEEL, "thermal_expansion": "12 ppm/K"}}


def staged(**stage):
    return {"load": {"stage": [stage]}}


REFUSED_LOADS = {
    "heat that does nothing": (
        {"body": {**BODY, **HOT}, **REPRESENTATIVE},
        "body.temperature = '50 K': changes nothing, which does not expand (allowed: with therm",
    ),
    "heat of another volume": (
        {
            "body": {**without(BODY, *STEEL), "materials": EXPANDS, "temperature": {"oak": 9}},
            **REPRESENTATIVE,
        },
        "body.temperature = {'oak': 9}: changes nothing in 'oak', which does not expand",
    ),
    "degrees of a scale": (
        {"body": {**BODY, "thermal_expansion": "12e-6 1/K", "temperature": "50 degC"}},
        "body.temperature = '50 degC': cannot be read as a quantity (allowed: a quantity in units",
    ),
    "expansion twice": (
        {"body": {**without(BODY, *STEEL), "materials": EXPANDS, "thermal_expansion": 1e-5}},
        "body.thermal_expansion = 1e-05: is that of the whole body, which has materials by volume",
    ),
    "face without a load": (
        {"body": {**BODY, "tractions": [{"surface": 1}]}},
        "body.tractions.0: a loaded face needs exactly one load (allowed: either 'stress' or 'pre",
    ),
    "bolts that push": (
        {"body": {**BODY, "pretension": [{"surface": 1, "pull": "-3 N"}]}},
        "body.pretension.0.pull = '-3 N': must be greater than or equal to 0",
    ),
    "bolts on the other side": (
        {"counter_body": BOLTED},
        "counter_body.pretension: bolts pull the body towards the counter-body",
    ),
    "bolts without laws": (
        {"body": BOLTED, "coupling": {"kind": "concurrent"}},
        "coupling.kind: is 'concurrent', but loads of the body besides the contact need laws on it",
    ),
    "moved supports without laws": (
        {"body": BODY, "coupling": {"kind": "concurrent"}},
        "coupling.kind: is 'concurrent', but loads of the body besides the contact need laws on it",
    ),
    "bolts and spots": (
        {"body": BOLTED, "output": {"contact": "last"}},
        "output.contact: the contact problem behind laws does not know of loads of the body",
    ),
    "two loads of the plane": (
        {"load": {"approach": 1, "pressure": 2}},
        "load: needs exactly one load (allowed: 'approach', 'force', 'pressure' or 'stage')",
    ),
    "two loads of a stage": (
        staged(approach=1, hold="force"),
        "load.stage.0: a stage states approach and hold of the plane (allowed: at most one of",
    ),
    "body of a block": (
        staged(approach=1, body=HOT),
        "load.stage.0.body: loads a mesh, and there is no [body] of one",
    ),
    "stage that heats nothing": (
        {**staged(approach=1, body=HOT), "body": BODY, **REPRESENTATIVE},
        "load.stage.0.body.temperature = 50.0: changes nothing, which does not expand",
    ),
    "cycles of all stages": (
        {"load": {"stage": [{"approach": 1}], "cycles": 2}},
        "load: cycles = 2 needs two turning points (allowed: a list of loads, or cycles = 1; of a",
    ),
    "key of a stage": (staged(aproach=1), "load.stage.0.aproach: unknown key; did you mean 'appr"),
}
"""Loads of the plane and of bodies: sections, and what is said of them."""

REFUSED = REFUSED_LOADS | {
    "two bodies": ({"body": BODY, "block": STEEL}, "body: is a second body below the surface"),
    "no body": ({"block": None}, "block: is required and missing (allowed: [block]; or [body]"),
    "mesh key of a block": ({"body": {**BODY, "cells": [4, 4, 4]}}, "body.cells: unknown key"),
    "near key": (
        {"body": {**BODY, "supports": [{"surfac": "back"}]}},
        "body.supports.0.surfac: unknown key; did you mean 'surface'?",
    ),
    "near constant": (
        {"body": {**without(BODY, *STEEL), "materials": {"steel": {"young": "1 GPa"}}}},
        "body.materials.steel.young: unknown key; did you mean 'young_modulus'?",
    ),
    "no contact": ({"body": without(BODY, "contact")}, "body.contact: is required and missing"),
    "no supports": ({"body": without(BODY, "supports")}, "body: a 'mesh' needs 'supports'"),
    "no material": ({"body": without(BODY, *STEEL)}, "body: needs the elastic constants of the"),
    "two materials": ({"body": {**BODY, "materials": {"a": STEEL}}}, "body: needs the elastic"),
    "fraction for a face": ({"body": {**BODY, "contact": 1.5}}, "body.contact = 1.5: must be a"),
    "half a support": (
        {"body": {**BODY, "supports": [{"surface": 1, "displacement": ["0", "fre", "0"]}]}},
        "body.supports.0.displacement.1 = 'fre': cannot be read as a quantity",
    ),
    "half a half-space": ({"counter_body": {"poisson_ratio": 0.3}}, "counter_body: needs the"),
    "supports of a half-space": (
        {"counter_body": {**STEEL, "supports": HELD}},
        "counter_body: 'supports' needs a 'mesh' (allowed: a mesh; or young_modulus and",
    ),
    "reference": (
        {"counter_body": STEEL, "coupling": {"kind": "reference"}},
        "counter_body: does not go with coupling.kind = 'reference', which meshes a body",
    ),
    "meshed roughness under tractions": (
        {"body": {**BODY, "tractions": [PULLED]}, "coupling": {"kind": "reference"}},
        "coupling.kind: is 'reference', but loads of the body besides the contact need laws",
    ),
    "a half-space against isolated laws": (
        {"counter_body": STEEL, "coupling": {"kind": "isolated"}},
        "counter_body: is a half-space, which isolated laws do not know (allowed: a meshed block "
        "in its place, counter_body.mesh)",
    ),
    "a half-space against laws of samples": (
        {**REPRESENTATIVE, "block": {**STEEL, "lengths": [9, 9]}, "counter_body": STEEL},
        "counter_body: is a half-space, which laws of samples do not know (allowed: a meshed block "
        "in its place, counter_body.mesh)",
    ),
    "one periodic side": (
        {"counter_surface": {**SURFACE, "periodic": True}},
        "counter_surface.periodic: is not surface.periodic",
    ),
    "lengths of the block": ({"block": {**STEEL, "lengths": [1, 1]}}, "block.lengths: needs law.k"),
    "no lengths": (REPRESENTATIVE, "block.lengths: is required with law.kind = 'rep"),
    "regions of a block": (
        {
            "block": {**STEEL, "lengths": [9, 9]},
            "law": {"kind": "representative", "regions": [{"surface": "ring", **SURFACE}]},
        },
        "law.regions: names faces of a mesh",
    ),
    "coupling of a sample": (
        {"body": BODY, "coupling": {"kind": "consistent"}, **REPRESENTATIVE},
        "coupling.kind: does not go with law.kind = 'representative', which stands at points",
    ),
    "patches of a sample": (
        {"body": BODY, "patches": {"grid": [2, 2]}, **REPRESENTATIVE},
        "patches.grid: does not go with law.kind = 'representative'",
    ),
    "place of a sample": (
        {"body": {**BODY, "place": [0, 0]}, **REPRESENTATIVE},
        "body.place: does not go with law.kind = 'representative'",
    ),
    "spots of a sample": (
        {"body": BODY, "output": {"contact": "last"}, **REPRESENTATIVE},
        "output.contact: does not go with law.kind = 'representative', which has no spots",
    ),
    "seeds of a file": (
        {
            "body": BODY,
            "surface": {"file": "a.npy"},
            "law": {"kind": "representative", "seeds": [1]},
        },
        "law.seeds: needs surface.spectrum",
    ),
    "further maps of a spectrum": (
        {"body": BODY, "law": {"kind": "representative", "samples": ["b.npy"]}},
        "law.samples: needs surface.file",
    ),
    "further maps of patches": (
        {"law": {"samples": ["b.npy"]}},
        "law: 'samples' needs kind = 'representative'",
    ),
    "seeds of patches": ({"law": {"seeds": [1]}}, "law: 'seeds' needs kind = 'representative'"),
    "a seed twice": (
        {"body": BODY, "law": {"kind": "representative", "seeds": [1, 1]}},
        "law: seeds = [1, 1] has one twice",
    ),
    "a region twice": (
        {
            "body": BODY,
            "law": {"kind": "representative", "regions": 2 * [{"surface": "a", **SURFACE}]},
        },
        "law: regions name a face twice: ['a', 'a']",
    ),
}


@pytest.mark.parametrize(("sections", "text"), REFUSED.values(), ids=REFUSED)
def test_what_makes_no_sense_is_refused(sections, text):
    with pytest.raises(InputError, match=re.escape(text)):
        scene(**sections)


@pytest.mark.parametrize("whole", [False, True])
@pytest.mark.parametrize(
    "sections",
    [
        {"counter_body": STEEL, "counter_surface": SURFACE},
        {"body": BODY, "counter_body": BODY},
        {"body": BODY, "law": {"kind": "representative", "seeds": [1]}},
    ],
)
def test_scenes_are_read_back_as_they_are_written(sections, whole):
    given = scene(**sections)
    dumped = given.to_dict(whole=whole)
    assert Scene.from_dict(dumped) == given
