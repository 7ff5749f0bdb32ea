"""Meshes of scenes whose sections contradict them: refused with file and key before any work."""

import numpy as np
import pytest
from dolfinx import mesh as dmesh
from helpers.box_msh import write_box
from helpers.faces import tagged
from mpi4py import MPI

from patchlaw.geometry import Control, Material, PatchGrid
from patchlaw.geometry.face_frame import FaceFrame
from patchlaw.macro import (
    LawContactProblem,
    LoadedFace,
    Loads,
    MeshedBody,
    Support,
    TaggedMesh,
    Traction,
    contact_facets,
    write_mesh,
)
from patchlaw.macro.compliance.surroundings import surroundings
from patchlaw.multiscale import Scene, run
from patchlaw.multiscale.bodies.face_terms import mesh_key
from patchlaw.multiscale.bodies.reader import read_bodies
from patchlaw.support import InputError
from patchlaw.support.files import fingerprint

SAMPLE = {"spectrum": {"hurst": 0.8, "waves": [2, 4], "rms_slope": 0.1}, "grid": [16, 16]}
SAMPLE |= {"lengths": ["1 mm", "1 mm"]}
STEEL = {"young_modulus": "210 GPa", "poisson_ratio": 0.3}
UP = [0, 0, "1 MPa"]


@pytest.fixture
def read(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def read(size=10.0, law=None, stage=None, **body):
        ticks = [np.linspace(0.0, size, count) for count in (4, 4, 3)]
        write_box("part.msh", ticks, halves=True)
        whole = {"mesh": "part.msh", "contact": "top", "supports": [{"surface": "bottom"}]}
        laws = {"kind": "representative", **(law or {})}
        load = {"force": "1 N"} if stage is None else {"stage": [{"force": "1 N", "body": stage}]}
        data = {"surface": SAMPLE, "load": load, "law": laws}
        return read_bodies(Scene.from_dict(data | {"body": whole | STEEL | body}), None)

    return read


@pytest.mark.parametrize(
    ("body", "match"),
    [
        ({"size": 1e9}, r"body\.mesh_unit: the body's mesh would be 1\.73e\+09 mm large"),
        ({"size": 1e-6}, r"body\.mesh_unit: the body's mesh would be 1\.73e-06 mm large"),
        ({"size": 2e5, "mesh_unit": "m"}, r"body\.mesh_unit: .* 3\.46e\+08 mm large"),
        (
            {"tractions": [{"surface": "top", "stress": UP}]},
            r"body\.tractions: the surface 'top' is the contact face and cannot be loaded",
        ),
        (
            {"tractions": [{"surface": "bottom", "stress": UP}]},
            r"body\.tractions: the surface 'bottom' is held along z, where a traction of 1 MPa",
        ),
        (
            {
                "supports": [
                    {"surface": "bottom"},
                    {"surface": "left", "displacement": ["free", "free", "1 um"]},
                ]
            },
            r"body\.supports: the surfaces 'bottom' and 'left' share nodes",
        ),
        (
            {"first_axis": [0, 0, 2]},
            r"body\.first_axis.* the first axis of a face is along its normal, or no direction",
        ),
        (
            {"first_axis": [0, 0, 0]},
            r"body\.first_axis = \[0\.0, 0\.0, 0\.0\]: .* \(allowed: a direction across \[0",
        ),
        (
            {"tractions": [{"surface": "lid", "pressure": 1}]},
            r"body\.tractions = 'lid': the mesh has no surface of this name",
        ),
        (
            {"pretension": [{"surface": "bottom", "pull": "1 N"}]},
            r"body\.pretension: the surface 'bottom' is held along z, where a traction of 0\.01",
        ),
        (
            {"stage": {"tractions": [{"surface": "top", "pressure": 1}]}},
            r"load\.stage\.0\.body\.tractions: the surface 'top' is the contact face",
        ),
        (
            {"law": {"regions": [{"surface": "top", **SAMPLE}]}},
            r"law\.regions = 'top': the surface is the contact face or another region",
        ),
    ],
    ids=[
        *("large", "small", "unit", "traction", "held", "supports", "axis along the normal"),
        *("no axis", "no such face", "held bolts", "stage", "region"),
    ],
)
def test_contradictions_are_refused(read, body, match):
    with pytest.raises(InputError, match=match):
        read(**body)


@pytest.fixture
def joined(tmp_path):
    """A column of two volumes with names of facets that are between cells, all or some."""
    corners = [[0.0, 0.0, 0.0], [1.3, 1.1, 2.0]]
    mesh = dmesh.create_box(MPI.COMM_SELF, corners, [3, 3, 4], dmesh.CellType.hexahedron)
    mesh.topology.create_connectivity(2, 3)

    def at(axis, place):
        return dmesh.locate_entities(mesh, 2, lambda x: np.isclose(x[axis], place))

    partly = np.concatenate([at(2, 1.5)[:4], at(0, 0.0)])
    tags = tagged(mesh, {1: at(2, 2.0), 2: at(2, 0.0), 3: at(2, 1.0), 4: partly})
    names = {"top": 1, "bottom": 2, "between": 3, "partly": 4}
    whole_mesh = TaggedMesh(mesh=mesh, facet_tags=tags, facet_names=names)
    write_mesh(whole_mesh, tmp_path / "joined.xdmf")
    whole = {"mesh": str(tmp_path / "joined.xdmf"), "contact": "top"}
    return whole_mesh, whole | {"supports": [{"surface": "bottom"}]} | STEEL


@pytest.mark.parametrize("face", ["between", "partly"])
@pytest.mark.parametrize(
    "loads",
    [
        {"tractions": [{"surface": "?", "stress": UP}]},
        {"tractions": [{"surface": "?", "pressure": "3 MPa"}]},
        {"pretension": [{"surface": "?", "pull": "20 N"}]},
    ],
    ids=["traction", "pressure", "pretension"],
)
@pytest.mark.parametrize("stage", [False, True])
def test_loads_between_two_cells_are_refused(joined, face, loads, stage, tmp_path):
    """They act on neither side with dolfinx, or on one of two."""
    (what, (load,)), (_, body) = *loads.items(), joined
    loads = {what: [load | {"surface": face}]}
    data = {"surface": SAMPLE, "law": {"kind": "representative"}, "body": body}
    if stage:
        data["load"] = {"stage": [{"force": "1 N"}, {"force": "2 N", "body": loads}]}
    else:
        data |= {"load": {"force": "1 N"}, "body": body | loads}
    where = rf"load\.stage\.1\.body\.{what}" if stage else rf"body\.{what}"
    match = rf"{where}: the surface '{face}' has \d+ of \d+ facets inside the body, .* be loaded"
    with pytest.raises(InputError, match=match):
        read_bodies(Scene.from_dict(data), None)


def test_loads_between_two_cells_are_refused_in_python(joined):
    load = Loads(tractions=(Traction(tag=3, stress=(0.0, 0.0, 50.0)),))
    material = Material(young_modulus=2e5, poisson_ratio=0.3)
    with pytest.raises(InputError, match="'between' has 9 of 9 facets inside the body"):
        MeshedBody(joined[0], material, [Support(tag=2)], [load])


@pytest.mark.long
def test_a_body_may_be_held_inside(joined):
    """All that lies beyond is as if it were cut off; a reference knows no such support."""
    tagged, body = joined
    place = FaceFrame(origin=np.array([0.0, 0.0, 2.0]), axes=np.eye(3))

    class Stiff:
        pressure, stiffness = staticmethod(lambda c: 1e9 * c), staticmethod(lambda c: 0 * c + 1e9)

    def force(*supports):
        held = [Support(tag=tag, displacement=(None, None, 0.0)) for tag in supports]
        material = Material(young_modulus=2e5, poisson_ratio=0.0)
        side = Support(tag=2, displacement=(0.0, 0.0, None))
        body = MeshedBody(tagged, material, [side, *held])
        facets = contact_facets(tagged.mesh, tagged.facet_tags.find(1), place)
        face = LoadedFace(body, facets, PatchGrid(grid=(1, 1), lengths=(1.3, 1.1)))
        return LawContactProblem(face, [Stiff()], "pointwise").solve(Control(approach=1e-3)).force

    assert force(3) == pytest.approx(2.0 * force(2), rel=1e-3)  # half of the height
    held = {"supports": [{"surface": "between"}]}
    surface = SAMPLE | {"lengths": ["1.3 mm", "1.1 mm"]}
    data = {"surface": surface, "load": {"approach": "1 um"}, "coupling": {"kind": "reference"}}
    match = "'between' has 9 of 9 facets inside the body, .* a reference does not hold"
    with pytest.raises(InputError, match=match):
        run(Scene.from_dict(data | {"body": body | held}))


def test_what_fits_is_read(read):
    law = {"regions": [{"surface": "upper half", **SAMPLE}]}
    loads = [{"surface": "right", "stress": UP}]
    found = read(law=law, tractions=loads)[0]
    assert len(found.facets) == 2
    assert found.facts.area == pytest.approx(100.0, rel=1e-12)


def test_what_a_compliance_in_the_cache_depends_on(read):
    def key(**body):
        first, _ = read(**body)
        rectangle, facets = PatchGrid(grid=(1, 1), lengths=(1.0, 1.0)), first.facets[0]
        around = surroundings(first.body, facets, rectangle)
        return fingerprint(mesh_key(first, facets, around, rectangle.lengths, 2))

    usual = key()
    assert key() == usual
    sliding = [{"surface": "bottom"}, {"surface": "left", "displacement": [0.0, "free", "free"]}]
    others = {"poisson_ratio": 0.31}, {"size": 9.0}, {"mesh_unit": "inch"}, {"supports": sliding}
    assert len({usual, *(key(**other) for other in others)}) == 1 + len(others)
