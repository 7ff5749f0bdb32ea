"""Meshes in gmsh's own files."""

from pathlib import Path

import numpy as np
import pytest
from helpers.mesh_files import gmsh_boxes, gmsh_session, write_boxes, write_msh2

from patchlaw.geometry.meshes.gmsh_file import read_gmsh_file
from patchlaw.support import InputError

CUBE = np.array([(x, y, z) for z in (0, 1) for y in (0, 1) for x in (0, 1)], float)
SQUARES = [0, 1, 3, 2, 4, 5, 7, 6]  # around the lower, then the upper square, as gmsh counts
TWO = [(0, 1, 2, 4), (1, 3, 2, 7)]  # two tetrahedra of the cube's corners
NAMES = [(3, 4, "body"), (2, 9, "pad face")]


def write(path, elements, points=CUBE, names=NAMES, **options):
    return write_msh2(path / "part.msh", points, elements, names, **options)


def test_nodes_may_have_gaps_and_no_cells(tmp_path):
    points = np.vstack([[[9.0, 9.0, 9.0]], CUBE])
    elements = [(4, 4, 1, np.add(cell, 1)) for cell in TWO] + [(2, 9, 1, [1, 2, 3])]
    elements += [(2, 9, 1, [0, 1, 2])]  # has the node that no cell has
    mesh = read_gmsh_file(write(tmp_path, elements, points, first=77))
    used = sorted({row for cell in TWO for row in cell})
    assert mesh.points.tolist() == CUBE[used].tolist()
    assert mesh.points[mesh.cells].tolist() == CUBE[np.array(TWO)].tolist()
    assert mesh.facets.tolist() == [[0, 1, 2], [-1, 0, 1]]
    assert mesh.facet_tags.tolist() == [9, 9] and mesh.cell_tags.tolist() == [4, 4]
    assert (mesh.cell_names, mesh.facet_names) == ({"body": 4}, {"pad face": 9})


def test_hexahedra_become_tensor_products(tmp_path):
    elements = [(5, 4, 1, SQUARES), (3, 9, 1, [4, 5, 7, 6])]
    mesh = read_gmsh_file(write(tmp_path, elements))
    assert mesh.points[mesh.cells[0]].tolist() == CUBE.tolist()
    assert sorted(mesh.points[mesh.facets[0]].tolist()) == sorted(CUBE[4:].tolist())


def test_groups_without_name_have_their_number(tmp_path):
    mesh = read_gmsh_file(write(tmp_path, [(4, 4, 1, TWO[0]), (2, 9, 3, [0, 1, 2])], names=[]))
    assert (mesh.cell_names, mesh.facet_names) == ({"4": 4}, {"9": 9})


def test_without_groups_entities_give_the_numbers(tmp_path):
    with gmsh_boxes() as gmsh:
        gmsh.model.removePhysicalGroups()
        gmsh.write(str(tmp_path / "plain.msh"))
        centres = {
            tag: gmsh.model.occ.getCenterOfMass(2, tag) for _, tag in gmsh.model.getEntities(2)
        }
    mesh = read_gmsh_file(tmp_path / "plain.msh")
    assert mesh.cell_names == {"1": 1, "2": 2} and set(mesh.cell_tags) == {1, 2}
    assert set(mesh.facet_names.values()) == set(centres)
    for tag, centre in centres.items():
        x = mesh.points[mesh.facets[mesh.facet_tags == tag]]
        across = int(np.argmin(np.ptp(x.reshape(-1, 3), axis=0)))
        np.testing.assert_allclose(x[..., across], centre[across], atol=1e-12)  # on its plane


def test_volume_without_a_group_is_part_of_the_body(tmp_path):
    with gmsh_boxes() as gmsh:
        gmsh.model.removePhysicalGroups([(3, 11)])
        gmsh.option.setNumber("Mesh.SaveAll", 1)
        gmsh.write(str(tmp_path / "part.msh"))
    mesh = read_gmsh_file(tmp_path / "part.msh")
    assert mesh.cell_names == {"plate": 10, "0": 0}
    heights = mesh.points[mesh.cells].mean(axis=1)[:, 2]
    assert (mesh.cell_tags == np.where(heights > 1.0, 0, 10)).all()


def test_things_are_in_one_group(tmp_path):
    for dimension, entity, match in (
        (3, 2, "volume 2 of the mesh is in several physical groups: 'lining' and 'all'"),
        (2, None, "surface .* 'pad face' and 'all'|surface .* 'back' and 'all'"),
    ):
        with gmsh_boxes() as gmsh:
            entities = [tag for _, tag in gmsh.model.getEntities(dimension)]
            gmsh.model.addPhysicalGroup(dimension, [entity] if entity else entities, 40)
            gmsh.model.setPhysicalName(dimension, 40, "all")
            gmsh.write(str(tmp_path / "two.msh"))
        with pytest.raises(InputError, match=match):
            read_gmsh_file(tmp_path / "two.msh")
    cells = [(4, 4, 1, TWO[0]), (4, 4, 1, TWO[1]), (4, 5, 2, [4, 2, 0, 1])]
    with pytest.raises(InputError, match="1 cells stand in the mesh more than once"):
        read_gmsh_file(write(tmp_path, cells))


def test_names_end_before_the_blanks_that_gmsh_fills_them_up_with(tmp_path):
    names = [(3, 4, "pad".ljust(80)), (2, 9, "rough face".ljust(80))]
    cells = [(4, 4, 1, TWO[0]), (2, 9, 3, [0, 1, 2])]
    mesh = read_gmsh_file(write(tmp_path, cells, names=names))
    assert (mesh.cell_names, mesh.facet_names) == ({"pad": 4}, {"rough face": 9})


def test_groups_have_names_of_their_own(tmp_path):
    names = [(3, 4, "body"), (3, 5, "body"), (2, 4, "body")]
    with pytest.raises(InputError, match="'body': physical groups 4 and 5 have the same name"):
        read_gmsh_file(write(tmp_path, [(4, 4, 1, TWO[0]), (4, 5, 2, TWO[1])], names=names))


@pytest.mark.parametrize("kind", ["tetrahedra", "hexahedra"])
def test_cells_of_second_order_with_straight_edges_lose_their_middles(tmp_path, kind):
    with gmsh_session("second order") as gmsh:
        if kind == "hexahedra":
            square = gmsh.model.occ.addRectangle(0, 0, 0, 1, 2)
            gmsh.model.occ.extrude([(2, square)], 0, 0, 0.5, [2], recombine=True)
            gmsh.model.occ.synchronize()
            gmsh.model.mesh.setTransfiniteSurface(square)
            gmsh.model.mesh.setRecombine(2, square)
        else:
            gmsh.model.occ.addBox(0, 0, 0, 1, 2, 0.5)
            gmsh.model.occ.synchronize()
        gmsh.option.setNumber("Mesh.MeshSizeMax", 1.0)
        gmsh.model.mesh.generate(3)
        corners = len(gmsh.model.mesh.getNodes()[0])
        gmsh.model.mesh.setOrder(2)
        gmsh.write(str(tmp_path / "second.msh"))
    mesh = read_gmsh_file(tmp_path / "second.msh")
    assert mesh.cells.shape[1] == {"tetrahedra": 4, "hexahedra": 8}[kind]
    assert len(mesh.points) == corners
    x = mesh.points[mesh.facets]
    assert x.shape[1] == {"tetrahedra": 3, "hexahedra": 4}[kind]


def test_curved_cells_keep_the_nodes_between_their_corners(tmp_path):
    with gmsh_session("ball") as gmsh:
        gmsh.model.occ.addSphere(0, 0, 0, 1)
        gmsh.model.occ.synchronize()
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.8)
        gmsh.option.setNumber("Mesh.ElementOrder", 2)
        gmsh.model.mesh.generate(3)
        gmsh.write(str(tmp_path / "ball.msh"))
    mesh = read_gmsh_file(tmp_path / "ball.msh")
    assert mesh.cells.shape[1] == 10
    # dolfinx: nodes 4 … 9 lie between these corners
    ends = mesh.cells[:, [(2, 3), (1, 3), (1, 2), (0, 3), (0, 2), (0, 1)]]
    straight, place = mesh.points[ends].mean(axis=2), mesh.points[mesh.cells[:, 4:]]
    on_ball = np.all(np.abs(np.linalg.norm(mesh.points[ends], axis=-1) - 1.0) < 1e-9, axis=2)
    assert np.abs(np.linalg.norm(place, axis=2)[on_ball] - 1.0).max() < 1e-6
    chord = np.linalg.norm(mesh.points[ends[..., 0]] - mesh.points[ends[..., 1]], axis=2)
    assert np.all(np.linalg.norm(place - straight, axis=2) < 0.3 * chord)
    assert mesh.facets.shape[1] == 3


@pytest.mark.parametrize(
    ("elements", "match"),
    [
        ([(2, 9, 1, [0, 1, 2])], "is two-dimensional, it has surfaces only"),
        ([(6, 4, 1, [0, 1, 2, 4, 5, 6])], "cells of another kind: 1 × prism"),
        (
            [(4, 4, 1, TWO[0]), (5, 4, 2, SQUARES)],
            r"several kinds: 1 × (tetra|hexa)hedron, 1 × .*allowed: tetrahedra alone",
        ),
        ([], "the mesh has no cells"),
    ],
    ids=["flat", "prism", "mixed", "none"],
)
def test_other_meshes_are_refused(tmp_path, elements, match):
    path = write(tmp_path, elements)
    with pytest.raises(InputError, match=match) as raised:
        read_gmsh_file(path)
    assert raised.value.file == str(path)


@pytest.mark.parametrize(
    ("content", "match"),
    [
        (b"", "the file is empty"),
        (b'Point(1) = {0, 0, 0};\nSystemCall "touch ran";\n', "this is no mesh of gmsh"),
        (b"// $MeshFormat\nx\n", "this is no mesh of gmsh"),
        (b"$NOD\n1\n1 0 0 0\n$ENDNOD\n", "this is no mesh of gmsh"),
        (b"$MeshFormat\n3.0 0 8\n$EndMeshFormat\n", "'3.0': unknown format"),
        (b"$MeshFormat", "this is no mesh of gmsh"),
        (b"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n5\n1 0 0", r"section \$Nodes has no end"),
        (bytes(range(256)) * 20, "this is no mesh of gmsh"),
    ],
    ids=["empty", "script", "comment", "old", "version", "cut", "truncated", "binary"],
)
def test_what_is_no_mesh_is_refused(tmp_path, monkeypatch, content, match):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "part.msh"
    path.write_bytes(content)
    with pytest.raises(InputError, match=match) as raised:
        read_gmsh_file(path)
    assert raised.value.file == str(path)
    assert not Path("ran").exists()


@pytest.mark.parametrize("version", ["2", "2.0", "2.000000", "2.200"])
def test_versions_are_numbers(tmp_path, version):
    path = write(tmp_path, [(4, 4, 1, TWO[0])])
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace("2.2 0 8", f"{version} 0 8"), encoding="utf-8")
    assert read_gmsh_file(path).cell_names == {"body": 4}


FORMS = [(2.2, False), (2.2, True), (4.0, False), (4.1, False), (4.1, True)]


def as_gmsh_reads(path):
    """Return gmsh's own nodes, and cells and facets as rows of places, by physical group."""
    with gmsh_session("oracle") as gmsh:
        gmsh.merge(str(path))
        numbers, places, _ = gmsh.model.mesh.getNodes()
        place = dict(zip(numbers.tolist(), np.reshape(places, (-1, 3)).tolist(), strict=True))
        found = {}
        for dimension, group in gmsh.model.getPhysicalGroups():
            name = gmsh.model.getPhysicalName(dimension, group) or str(group)
            rows = []
            for entity in gmsh.model.getEntitiesForPhysicalGroup(dimension, group):
                for kind, _, nodes in zip(
                    *gmsh.model.mesh.getElements(dimension, entity), strict=True
                ):
                    count = gmsh.model.mesh.getElementProperties(kind)[3]
                    for row in np.reshape(nodes, (-1, count)).tolist():
                        rows.append(sorted(tuple(place[node]) for node in row))
            found[dimension, name] = sorted(rows)
        return found


@pytest.mark.parametrize(("version", "binary"), FORMS)
@pytest.mark.parametrize("partitioned", [False, True])
def test_files_hold_what_gmsh_reads_in_them(tmp_path, version, binary, partitioned):
    """The very numbers, to the last digit: both read 16 digits, or the bytes."""
    path = tmp_path / "box.msh"
    with gmsh_boxes(0.4) as gmsh:
        if partitioned:
            gmsh.model.mesh.partition(3)
        gmsh.option.setNumber("Mesh.MshFileVersion", version)
        gmsh.option.setNumber("Mesh.Binary", binary)
        gmsh.write(str(path))
    mesh, expected = read_gmsh_file(path), as_gmsh_reads(path)
    for dimension, nodes, tags, names in (
        (3, mesh.cells, mesh.cell_tags, mesh.cell_names),
        (2, mesh.facets, mesh.facet_tags, mesh.facet_names),
    ):
        for name, tag in names.items():
            rows = mesh.points[nodes[tags == tag]].tolist()
            found = sorted(sorted(map(tuple, row)) for row in rows)
            assert found == expected[dimension, name]


@pytest.mark.parametrize("binary", [False, True])
def test_parametric_nodes_are_read_in_format_4_and_named_in_format_2(tmp_path, binary):
    path = tmp_path / "box.msh"
    for version in (4.1, 2.2):
        with gmsh_boxes(0.6) as gmsh:
            gmsh.option.setNumber("Mesh.MshFileVersion", version)
            gmsh.option.setNumber("Mesh.Binary", binary)
            gmsh.option.setNumber("Mesh.SaveParametric", 1)
            gmsh.write(str(path))
        if version > 4.0:
            assert np.ptp(read_gmsh_file(path).points, axis=0).tolist() == [1.0, 1.0, 1.5]
        else:
            with pytest.raises(InputError, match=r"in \$ParametricNodes.*Mesh\.SaveParametric = 0"):
                read_gmsh_file(path)


@pytest.mark.parametrize(("version", "binary"), FORMS)
@pytest.mark.parametrize("grouped", [True, False], ids=["groups", "numbers"])
def test_borders_of_a_partition_are_on_no_surface(tmp_path, version, binary, grouped):
    """gmsh gives them the physical group of their volume, whose number a surface may have."""
    path, faces = tmp_path / "box.msh", []
    for parts in (1, 3):
        with gmsh_session("parts") as gmsh:
            gmsh.model.occ.addBox(0.0, 0.0, 0.0, 1.0, 1.0, 1.0)
            gmsh.model.occ.synchronize()
            gmsh.option.setNumber("Mesh.MeshSizeMax", 0.4)
            if grouped:
                for dimension, entity, name in ((3, 1, "body"), (2, 5, "bottom")):
                    gmsh.model.addPhysicalGroup(dimension, [entity], 1)
                    gmsh.model.setPhysicalName(dimension, 1, name)
            gmsh.model.mesh.generate(3)
            if parts > 1:
                gmsh.model.mesh.partition(parts)
            gmsh.option.setNumber("Mesh.MshFileVersion", version)
            gmsh.option.setNumber("Mesh.Binary", binary)
            gmsh.write(str(path))
        mesh = read_gmsh_file(path)
        corners = mesh.points[mesh.facets]
        bottom = corners[mesh.facet_tags == mesh.facet_names["bottom" if grouped else "5"]]
        assert np.ptp(corners, axis=1).min(axis=1).max() == 0.0  # all on sides of the box
        assert np.all(bottom[:, :, 2] == 0.0)
        assert len(mesh.cell_names) == 1
        faces.append((len(bottom), mesh.facet_names, mesh.cell_names, len(mesh.facets)))
    assert faces[0] == faces[1]


def test_files_beside_a_mesh_are_not_run(tmp_path):
    """gmsh's merge runs ``box.msh.opt``."""
    path = write_boxes(tmp_path / "box.msh")
    (tmp_path / "box.msh.opt").write_text(f'SystemCall "touch {tmp_path}/ran";\n')
    read_gmsh_file(path)
    assert not (tmp_path / "ran").exists()


@pytest.mark.long
@pytest.mark.parametrize(("version", "binary"), FORMS)
def test_damaged_files_are_refused_or_read(tmp_path, version, binary):
    """Flipped bits, cuts and swapped words: an `InputError` that names the file, or a mesh."""
    whole = write_boxes(tmp_path / "box.msh", version, binary).read_bytes()
    random, path, refused = np.random.default_rng(28), tmp_path / "damaged.msh", 0
    for trial in range(150):
        damaged = bytearray(whole)
        at = random.integers(len(whole), size=2)
        if trial % 5 == 0:
            damaged = damaged[: at[0]]
        elif trial % 5 == 1:
            damaged[at[0] : at[0] + 8] = damaged[at[1] : at[1] + 8]
        else:
            for place in random.integers(len(whole), size=1 + trial % 7):
                damaged[place] ^= 1 << int(random.integers(8))
        path.write_bytes(damaged)
        try:
            mesh = read_gmsh_file(path)
        except InputError as error:
            refused += 1
            assert error.file == str(path)
        else:
            assert 0 <= mesh.cells.min() <= mesh.cells.max() < len(mesh.points)
    assert refused > 30  # every cut


def test_nodes_that_are_not_there_are_named(tmp_path):
    elements = [(4, 4, 1, TWO[0]), (4, 4, 1, (1, 3, 2, 40))]
    with pytest.raises(InputError, match="elements of the mesh have the node 41, which the file"):
        read_gmsh_file(write(tmp_path, elements))
    twice = write(tmp_path, elements[:1]).read_text(encoding="utf-8")
    (tmp_path / "part.msh").write_text(twice.replace("\n8 1.0 1.0 1.0", "\n7 1.0 1.0 1.0"))
    with pytest.raises(InputError, match="several nodes of the mesh have the number 7"):
        read_gmsh_file(tmp_path / "part.msh")
