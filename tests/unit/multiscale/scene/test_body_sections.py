"""Sections on bodies, the other side and laws: what is read, and the words of refusals."""

import re

import pytest

from multiscale.scene.scene import Scene
from support.errors import InputError

SAMPLE = {"spectrum": {"hurst": 0.8, "waves": [2, 4], "rms_slope": 0.1}, "grid": [16, 16]}
SURFACE = {**SAMPLE, "lengths": ["1 mm", "1 mm"]}
STEEL = {"young_modulus": "210 GPa", "poisson_ratio": 0.3}
HELD = [{"surface": "back", "displacement": ["0", "free", "0.1 um"]}]
BODY = {"mesh": "part.msh", "contact": "face", "supports": HELD, **STEEL}
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


REFUSED = {
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
        "counter_body: does not go with coupling.kind = 'reference', which meshes a block",
    ),
    "meshed roughness on a mesh": (
        {"body": BODY, "coupling": {"kind": "reference"}},
        "body: does not go with coupling.kind = 'reference', which meshes a block under",
    ),
    "isolated on the mesh": (
        {"counter_body": STEEL, "coupling": {"kind": "isolated", "newton": "full"}},
        "coupling.kind: isolated laws against a half-space need the compliance of both bodies",
    ),
    "one periodic side": (
        {"counter_surface": {**SURFACE, "periodic": True}},
        "counter_surface.periodic: is not surface.periodic",
    ),
    "grid to be chosen": (
        {"surface": {**SURFACE, "grid": "auto"}, "counter_surface": SURFACE},
        "surface.grid: is not chosen with [counter_surface]",
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
    "accuracy on a mesh": (
        {"body": BODY, "accuracy": 0.02},
        "accuracy: is not kept on [body], nor are surface.grid or coupling.kind chosen there",
    ),
    "seeds of a file": (
        {
            "body": BODY,
            "surface": {"file": "a.npy"},
            "law": {"kind": "representative", "seeds": [1]},
        },
        "law.seeds: needs surface.spectrum",
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
