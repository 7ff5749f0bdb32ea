"""What a plan says of bodies on meshes and of laws of samples."""

import pytest
from helpers.box_msh import write_box

from patchlaw.geometry import BlockShape
from patchlaw.multiscale import Scene, make_setup

TICKS = BlockShape(interface=(1.0, 1.0), height=1.0, cells=(3, 3, 2)).ticks
SPECTRUM = {"hurst": 0.9, "waves": [2, 4], "rms_slope": 0.2, "seed": 3}
SURFACE = {"spectrum": SPECTRUM, "grid": [16, 16], "lengths": [0.5, 0.5]}
HALF_SPACE = {"young_modulus": "100 GPa", "poisson_ratio": 0.3}
SAMPLES = {"law": {"kind": "representative", "seeds": [1, 2]}}


@pytest.fixture(scope="module")
def mesh(tmp_path_factory):
    """A cube as a file."""
    return write_box(tmp_path_factory.mktemp("mesh") / "cube.msh", TICKS)


def setup_of(mesh, **sections):
    body = {"mesh": str(mesh), "contact": "top", "supports": [{"surface": "bottom"}]}
    data = {
        "surface": SURFACE,
        "body": {**body, "young_modulus": "4 GPa", "poisson_ratio": 0.48},
        "load": {"force": "2 N", "steps": 2},
    }
    return make_setup(Scene.from_dict(data | sections))


def test_a_plan_says_size_faces_and_body_term(mesh):
    setup = setup_of(mesh, coupling={"kind": "consistent"})
    said = dict(setup.about.statements())
    assert "18 hexahedra (linear), 144 unknowns, contact face of 1 mm²" in said["body"]
    assert "the body lies below the plane of its contact face" in said["body term"]
    assert "E = 4 GPa, ν = 0.48" in said["inputs"] and "body 1 mm high" in said["inputs"]
    assert [one.key for one in setup.about.memory_requests()].count("body.mesh") == 1
    assert any("linear elements lock" in warning for warning in setup.about.warnings())


@pytest.mark.parametrize(
    ("sections", "way"),
    [
        ({}, "condensed to the patches"),
        ({"load": {"force": "2 N", "tilt": "free"}}, "along the rows of the laws"),
        (
            {"load": {"force": "2 N", "sliding": ["1 m"]}, "wear": {"coefficient": 1e-8}},
            "along the rows of the laws",
        ),
        ({"coupling": {"kind": "consistent", "interface": "pointwise"}}, "on the mesh of the body"),
    ],
    ids=["patches", "free", "wear", "points"],
)
def test_a_plan_says_how_load_steps_are_found(mesh, sections, way):
    setup = setup_of(mesh, **{"coupling": {"kind": "consistent"}, **sections})
    assert dict(setup.about.statements())["newton"] == way


def test_a_plan_says_what_samples_there_are(mesh):
    setup = setup_of(mesh, **SAMPLES)
    said = dict(setup.about.statements())
    assert "top: 2 periodic samples of 500 µm × 500 µm" in said["coupling"]
    assert said["newton"] == "on the mesh of the body"
    told = "; ".join(setup.about.warnings())
    assert "a sample stands for faces that are much larger" in told
    measured = {**SURFACE, "detrend": "plane"}
    told = "; ".join(setup_of(mesh, surface=measured, **SAMPLES).about.warnings())
    assert "do not continue periodically: their sample is four mirror images" in told


def test_surfaces_lie_in_the_middle_of_a_face_or_where_the_scene_says(mesh):
    centred = setup_of(mesh).bodies.first.frame
    assert centred.origin.tolist() == pytest.approx([0.25, 0.25, 0.0], abs=1e-12)
    body = {"mesh": str(mesh), "contact": 1, "supports": [{"surface": 2}], "place": ["0.5 mm", 0]}
    moved = setup_of(mesh, body={**body, **HALF_SPACE}).bodies.first.frame
    assert moved.origin.tolist() == pytest.approx([0.5, 0.0, 0.0], abs=1e-12)
