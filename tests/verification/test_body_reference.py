"""Bodies that are no cuboids against their own roughness, meshed."""

import numpy as np
import pytest
from mpi4py import MPI

from benchmarks.l_shape import LENGTHS, SPECTRUM, Reference, reach, scene, write_foot
from benchmarks.random_bodies import drawn, mesh_of
from patchlaw.geometry import Spectrum, synthesise
from patchlaw.macro import planar_face, write_mesh
from patchlaw.multiscale import Scene, run

SEED, APPROACH, CELLS = 193, 10e-3, 128
ALLOWED = 5e-3
"""Difference to the reference beyond its error bar, relative to the force."""


@pytest.mark.slow
def test_concurrent_and_calibrated_laws_are_within_the_bar_of_the_meshed_foot(tmp_path):
    foot = write_foot(tmp_path / "foot.msh", 0.25)

    def go(kind, mesh=foot):
        return run(scene(SEED, APPROACH, 1, foot=mesh, cells=CELLS, coupling={"kind": kind}))

    concurrent, consistent, cuboid = go("concurrent"), go("consistent"), go("concurrent", None)
    spectrum = Spectrum(**SPECTRUM, seed=SEED)
    reference = Reference(
        surface=synthesise(spectrum, grid=(CELLS, CELLS), lengths=LENGTHS),
        approaches=(APPROACH,),
        plane=reach(concurrent),
        edges=2.0,
        count=2,
    )
    solved = [reference.solved(shape) for shape in reference.shapes]
    found = reference.extrapolated([[state.force for state in states] for _, states in solved])
    value, bar = float(found.value[0]), float(found.error[0])
    assert bar < 0.02 * value
    for history in (concurrent, consistent):
        assert abs(history.force_N[-1] - value) < bar + ALLOWED * value
    np.testing.assert_allclose(consistent.force_N, concurrent.force_N, rtol=1e-3)
    # the arm matters: the face sinks, and turns by what a plane would tilt
    assert cuboid.force_N[-1] > 1.1 * value
    assert abs(reach(concurrent)[1][0]) > 5e-4
    problem, (state,) = solved[-1]
    assert state.reaction == pytest.approx(state.force, rel=1e-8)
    assert problem.top.area.sum() == pytest.approx(1.0, rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("number", [0, 2, 4], ids=["feet", "pad of hexahedra", "wedge"])
def test_bodies_with_meshed_roughness_bear_what_contact_problem_and_laws_say(number, tmp_path):
    """Bodies that no other test of the reference uses; the pad has two materials."""
    content = random_scene(number, tmp_path / "body.xdmf")

    def go(kind):
        return run(Scene.from_dict({**content, "coupling": {"kind": kind}}))

    found = go("reference").reference.force
    value, bar = float(found.value[0]), float(found.error[0])
    assert bar < 3e-3 * value
    for kind in ("concurrent", "consistent"):
        assert abs(go(kind).force_N[-1] - value) < bar + ALLOWED * value, kind


def random_scene(number, path):
    """Return a scene of a surface in the middle of a random body's face, and write the body."""
    drawn_body = drawn(number, coarser=0.7)
    mesh = mesh_of(drawn_body, MPI.COMM_SELF)
    write_mesh(mesh, path)
    side = 0.5 * min(planar_face(mesh, mesh.facet_names["contact"]).lengths)
    materials = {
        str(tag): vars_of(material)
        for tag, material in zip(
            sorted(mesh.cell_names.values()), drawn_body.materials, strict=False
        )
    }
    body = {
        "mesh": str(path),
        "contact": "contact",
        "element": "quadratic",
        "supports": [{"surface": "support"}],
        "materials": materials,
    }
    surface = {"spectrum": {**SPECTRUM, "seed": number}, "grid": [CELLS, CELLS]}
    return {
        "surface": surface | {"lengths": [side, side]},
        "body": body,
        "patches": {"grid": [4, 4]},
        "load": {"approach": 8e-3 * side, "steps": 1},
        "output": {"figures": False, "report": False, "check": "none", "contact": "none"},
    }


def vars_of(material):
    """Return the elastic constants as a section has them."""
    return {"young_modulus": material.young_modulus, "poisson_ratio": material.poisson_ratio}
