"""Meshes of scenes whose sections contradict them: refused with file and key before any work."""

import numpy as np
import pytest
from helpers.box_msh import write_box

from multiscale.bodies.mesh import MeshTerms
from multiscale.bodies.reader import read_bodies
from multiscale.scene.scene import Scene
from support.checked_store import fingerprint
from support.errors import InputError

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


def test_what_fits_is_read(read):
    law = {"regions": [{"surface": "upper half", **SAMPLE}]}
    loads = [{"surface": "right", "stress": UP}]
    found = read(law=law, tractions=loads)[0]
    assert len(found.facets) == 2
    assert found.facts.area == pytest.approx(100.0, rel=1e-12)


def test_what_a_compliance_in_the_cache_depends_on(read):
    def key(**body):
        first, _ = read(**body)
        terms = MeshTerms.of(first, (1.0, 1.0), side_term=False)
        return fingerprint(terms._key(2))

    usual = key()
    assert key() == usual
    sliding = [{"surface": "bottom"}, {"surface": "left", "displacement": [0.0, "free", "free"]}]
    others = {"poisson_ratio": 0.31}, {"size": 9.0}, {"mesh_unit": "inch"}, {"supports": sliding}
    assert len({usual, *(key(**other) for other in others)}) == 1 + len(others)
