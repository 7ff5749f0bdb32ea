"""Sections on bodies, the other side and laws: what is read, and the words of refusals."""

import pytest

from patchlaw.multiscale import Scene

SAMPLE = {"spectrum": {"hurst": 0.8, "waves": [2, 4], "rms_slope": 0.1}, "grid": [16, 16]}
SURFACE = {**SAMPLE, "lengths": ["1 mm", "1 mm"]}
STEEL = {"young_modulus": "210 GPa", "poisson_ratio": 0.3}
HELD = [{"surface": "back", "displacement": ["0", "free", "0.1 um"]}]
BODY = {"mesh": "part.msh", "contact": "face", "supports": HELD, **STEEL}


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


def test_regions_have_hardness_and_friction_of_their_own_or_those_of_the_face():
    own = {"hardness": "inf", "friction": 0.1}, {}, {"hardness": "1 GPa"}
    regions = [{"surface": n, **SURFACE, **one} for n, one in enumerate(own)]
    sections = {"body": BODY, "law": {"kind": "representative", "regions": regions}}
    found = scene(**sections, micro={"hardness": "2 GPa"}, friction={"coefficient": 0.3})
    assert found.hardnesses == [2000.0, None, 2000.0, 1000.0]
    assert found.coefficients == [0.3, 0.1, 0.3, 0.3]
    assert found.hardness_key == "micro.hardness"
    regions[0].pop("friction")
    elastic = scene(**sections)
    assert elastic.hardnesses == [None, None, None, 1000.0] and elastic.coefficients == []
    assert elastic.hardness_key == "law.regions.2.hardness"


@pytest.mark.parametrize("whole", [False, True])
@pytest.mark.parametrize("sections", [
    {"counter_body": STEEL, "counter_surface": SURFACE}, {"body": BODY, "counter_body": BODY},
    {"body": BODY, "law": {"kind": "representative", "seeds": [1]}},
])  # fmt: skip
def test_scenes_are_read_back_as_they_are_written(sections, whole):
    given = scene(**sections)
    dumped = given.to_dict(whole=whole)
    assert Scene.from_dict(dumped) == given
