"""Meshes of files are the same bodies, and bad ones the same errors, on any number of ranks."""

import numpy as np
import pytest

CASES = ("2.2", "4.1", "written", "xdmf")
MORE = [2, pytest.param(3, marks=pytest.mark.slow)]
EXPECTED = {
    "apart.msh": "the mesh is in 2 parts that share no facets, of 5, 5 cells",
    "folded.msh": "2 of 5 cells of the mesh are inside out",
    "beside.msh": "1 of 2 facets of the surface '7' belong to no cell",
    "flat.msh": "the mesh is two-dimensional",
    "text.msh": "this is no mesh of gmsh",
    "text.xdmf": "this is no XDMF file",
}


@pytest.mark.parametrize("ranks", [1, *MORE])
@pytest.mark.parametrize("case", CASES)
def test_bodies_are_whole(on_ranks, case, ranks):
    body = on_ranks[ranks][case]
    if case == "xdmf":
        assert body["volumes"] == pytest.approx({"3": 24.0, "8": 24.0}, rel=1e-13)  # round-off
        areas = {
            str(tag): area for tag, area in zip(range(1, 7), [24, 24, 12, 12, 8, 8], strict=True)
        }
    else:
        assert body["volumes"] == pytest.approx({"plate": 1.0, "lining": 0.5}, rel=1e-13)
        areas = {"pad face": 1.0, "back": 1.0}
    assert {name: face[-2] for name, face in body["faces"].items()} == pytest.approx(areas)
    assert len(body["parts"]) == 1


@pytest.mark.parametrize("ranks", MORE)
@pytest.mark.parametrize("case", CASES)
def test_ranks_agree(on_ranks, case, ranks):
    one, more = on_ranks[1][case], on_ranks[ranks][case]
    assert one["motions"] == more["motions"] == ["translation along y"]
    assert one["parts"] == more["parts"]
    for name, face in one["faces"].items():
        np.testing.assert_allclose(more["faces"][name], face, rtol=1e-13, atol=1e-14)  # round-off


@pytest.mark.parametrize("ranks", [1, *MORE])
@pytest.mark.parametrize("name", EXPECTED)
def test_all_ranks_raise_one_error(on_ranks, name, ranks):
    (message,) = on_ranks[ranks]["errors"][name]
    assert EXPECTED[name] in message and message.startswith(f"/{name}: ")


@pytest.mark.parametrize("ranks", [1, *MORE])
def test_folded_cells_are_found_across_ranks(on_ranks, ranks):
    assert on_ranks[ranks]["pushed"] == on_ranks[1]["pushed"] != "0"


@pytest.mark.slow
def test_ranks_may_have_no_facet_of_a_face(on_ranks):
    found = [on_ranks[ranks][case] for ranks in (2, 3) for case in CASES]
    assert any(0 in each["first_face_of_ranks"] for each in found)
