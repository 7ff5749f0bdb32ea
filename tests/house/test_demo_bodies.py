"""The meshes in demos/bodies have the dimensions and names that their scripts say."""

import math
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from helpers.waiting_ranks import alone
from mpi4py import MPI

from patchlaw.macro import compat, planar_face, read_mesh
from patchlaw.macro.mesh.facets import facet_nodes
from patchlaw.macro.mesh.tagged import surface_area
from patchlaw.multiscale import Scene, run

BODIES = Path(__file__).parents[2] / "demos" / "bodies"
SECTOR = (143.0**2 - 100.0**2) / 2.0 * math.radians(56.0)  # of the lining, seen from above
PLATE = (146.0**2 - 97.0**2) / 2.0 * math.radians(64.0)
PISTON = math.pi * (22.0**2 - 15.0**2)


def ring(inner, outer, share=1.0):
    return share * math.pi * (outer**2 - inner**2)


CASES = {  # edges; contact face; volumes; areas
    "brake_pad": (
        5.0,
        "pad face",
        {"back plate": 5.0 * PLATE, "lining": 10.0 * SECTOR - 18.0 * 43.0 - 2.0 * 8.0 * 43.0},
        {"pad face": SECTOR - (3.0 + 2.0 * 4.0) * 43.0, "piston": PISTON, "back": PLATE - PISTON},
    ),
    "flange": (
        5.0,
        "raised face",
        {
            "flange": 18.0 * (ring(27.5, 82.5) - 4.0 * ring(0.0, 9.0))
            + 2.0 * ring(27.5, 51.0)
            + 40.0 * ring(27.5, 35.5)
        },
        {
            "raised face": ring(27.5, 51.0),
            "washers": 4.0 * ring(9.0, 15.0),
            "pipe end": ring(27.5, 35.5),
            "bore": 2.0 * math.pi * 27.5 * 60.0,
        },
    ),
    "seal_ring": (
        0.8,
        "sealing face",
        {"ring": 8.0 * ring(20.0, 26.0, 0.25) + 2.0 * ring(22.0, 24.5, 0.25)},
        {
            "sealing face": ring(22.0, 24.5, 0.25),
            "shoulder": ring(24.5, 26.0, 0.25),
            "seat": ring(20.0, 22.0, 0.25),
            "plane x": 6.0 * 8.0 + 2.5 * 2.0,
            "plane y": 6.0 * 8.0 + 2.5 * 2.0,
        },
    ),
}

WALLS = {"seal_ring": {"bore": 22.0, "rim": 24.5}, "flange": {"bore": 27.5, "rim": 51.0}}
"""Radii of cylindrical faces about z."""


@pytest.fixture(scope="module")
def meshed(tmp_path_factory):
    """Return a function that gives a body's mesh, made by its script once."""

    @cache
    def made(body):
        path = tmp_path_factory.mktemp(body) / "body.msh"
        words = BODIES / f"{body}.py", "--size", CASES[body][0], "--out", path
        done = alone(list(map(str, words)))
        assert done.returncode == 0, done.stderr
        return path

    return made


@pytest.mark.parametrize(
    "body", [pytest.param(one, marks=[pytest.mark.long] * (one != "seal_ring")) for one in CASES]
)
def test_bodies_have_their_dimensions(body, meshed):
    _, face, volumes, areas = CASES[body]
    tagged = read_mesh(meshed(body), MPI.COMM_SELF)
    assert set(tagged.cell_names) == set(volumes)
    walls = WALLS.get(body, {})
    assert set(tagged.facet_names) == set(areas) | set(walls)
    for name, radius in walls.items():
        facets = tagged.facet_tags.find(tagged.facet_tag(name))
        nodes = facet_nodes(tagged.mesh, facets).corners
        assert len(nodes) > 20
        x, y, _ = tagged.mesh.geometry.x[nodes.ravel()].T
        np.testing.assert_allclose(np.hypot(x, y), radius, rtol=1e-9)
    corners = tagged.mesh.geometry.x[compat.cell_vertices(tagged.mesh)]
    for name, volume in volumes.items():
        of_volume = corners[tagged.cell_tags.values == tagged.cell_names[name]]
        # chords instead of arcs
        assert sum(map(_volume, of_volume)) == pytest.approx(volume, rel=0.02)
    for name, area in areas.items():
        tag = tagged.facet_tag(name)
        assert surface_area(tagged, tag) == pytest.approx(area, rel=0.02)
        if name != "bore":
            found = planar_face(tagged, tag, name=name)
            assert found.area == pytest.approx(area, rel=0.02)
        if name == face:
            assert found.frame.normal.tolist() == [0.0, 0.0, 1.0]


SMALL = ("body.element=linear", "surface.grid=[32, 32]", "surface.spectrum.waves=[2, 8]")
FORCES = {"brake_pad": 8e3, "flange": 120e3 - 9.5e3, "seal_ring": 45.0}


@pytest.mark.long
@pytest.mark.parametrize("body", CASES)
def test_scenes_of_bodies_run(body, meshed):
    small = [*SMALL, f"body.mesh={meshed(body)}", "law.seeds=[1]", "load.steps=1"]
    history = run(Scene.load(BODIES / f"{body}.toml", small))
    assert history.force_N[-1] == pytest.approx(FORCES[body], rel=1e-6)  # Newton's tolerance
    area = CASES[body][3][CASES[body][1]]
    assert history.mean_pressure_MPa[-1] == pytest.approx(FORCES[body] / area, rel=0.02)  # chords
    if body == "seal_ring":  # a quarter is symmetric to the plane x = y; moments about its middle
        assert history.moment_x_N_mm[-1] == pytest.approx(history.moment_y_N_mm[-1], rel=1e-3)


def _volume(corners):
    """Return the volume of a tetrahedron, or of a hexahedron as five of them."""
    if len(corners) == 4:
        return abs(np.linalg.det(corners[1:] - corners[0])) / 6.0
    five = [(0, 1, 2, 4), (3, 1, 2, 7), (5, 1, 4, 7), (6, 2, 4, 7), (1, 2, 4, 7)]
    return sum(_volume(corners[list(part)]) for part in five)
