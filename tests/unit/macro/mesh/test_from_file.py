"""Meshes of a body from the user's files."""

import h5py
import numpy as np
import pytest
from dolfinx import io
from dolfinx import mesh as dmesh
from helpers.mesh_files import SIDES, tagged_box, write_boxes, write_msh2
from mpi4py import MPI

from patchlaw.macro import (
    Material,
    MeshedBody,
    TaggedMesh,
    compat,
    planar_face,
    read_mesh,
    write_mesh,
)
from patchlaw.support import InputError

COMM = MPI.COMM_SELF
CUBE = np.array([(x, y, z) for z in (0, 1) for y in (0, 1) for x in (0, 1)], float)
FIVE = [(0, 1, 2, 4), (1, 3, 2, 7), (1, 5, 4, 7), (2, 6, 7, 4), (1, 2, 4, 7)]
"""A cube of five tetrahedra, some right-handed, some left-handed."""


def middles(tagged):
    """Return the middles of this rank's cells."""
    return tagged.mesh.geometry.x[compat.cell_vertices(tagged.mesh)].mean(axis=1)


def write_xdmf(path, tagged, *tags):
    with io.XDMFFile(COMM, str(path), "w") as file:
        file.write_mesh(tagged.mesh)
        for each, name in tags:
            each.name = name
            try:
                file.write_meshtags(each, tagged.mesh.geometry)
            except TypeError:
                file.write_meshtags(each)
    return path


def halves(tagged):
    """Return tags of the cells: 3 to the left of the middle, 8 to the right."""
    cells = tagged.mesh.topology.index_map(3).size_local
    values = np.where(middles(tagged)[:cells, 0] < 0.5, 3, 8).astype(np.int32)
    return dmesh.meshtags(tagged.mesh, 3, np.arange(cells, dtype=np.int32), values)


def test_names_tags_and_unit_of_a_file_of_gmsh(tmp_path):
    write_boxes(tmp_path / "pad.msh").rename(tmp_path / "PAD.MSH")
    tagged = read_mesh(tmp_path / "PAD.MSH", COMM, unit=25.4)
    assert tagged.facet_names == {"pad face": 5, "back": 6}
    assert tagged.cell_names == {"plate": 10, "lining": 11}
    above = middles(tagged)[:, 2] > 25.4
    assert (tagged.cell_tags.values == np.where(above, 11, 10)).all()
    for name, height in (("pad face", 1.5 * 25.4), ("back", 0.0)):
        face = planar_face(tagged, tagged.facet_tag(name))
        assert face.area == pytest.approx(25.4**2, rel=1e-13)  # sums of products
        assert abs(face.frame.origin[2] - height) < 1e-13


def test_cells_of_either_hand_are_taken(tmp_path):
    elements = [(4, 1, 1, cell) for cell in FIVE] + [(2, 7, 1, (4, 5, 7)), (2, 7, 1, (6, 4, 7))]
    path = write_msh2(tmp_path / "cube.msh", CUBE, elements, [(2, 7, "top")])
    face = planar_face(read_mesh(str(path), COMM), 7)
    assert (face.area, face.lengths) == (1.0, (1.0, 1.0))


def test_compiled_forms_serve_meshes_of_files_and_lattices(tmp_path):
    from patchlaw.geometry import BlockShape
    from patchlaw.macro import block_mesh

    read = read_mesh(write_boxes(tmp_path / "part.msh"), COMM).mesh
    shape = BlockShape(interface=(1.0, 1.0), height=1.0, cells=(1, 1, 1), element="P1")
    lattice = block_mesh(shape, COMM).mesh
    domains = [mesh.ufl_domain().ufl_coordinate_element() for mesh in (read, lattice)]
    assert domains[0] == domains[1]


@pytest.mark.parametrize("kind", ["tetrahedron", "hexahedron"])
def test_xdmf_brings_tags_back(tmp_path, kind):
    box = tagged_box(COMM, kind=kind, cells=(4, 2, 2))
    path = write_xdmf(tmp_path / "box.xdmf", box, (box.facet_tags, "sides"), (halves(box), "parts"))
    tagged = read_mesh(path, COMM, unit=1000.0)
    assert tagged.facet_names == {str(tag): tag for tag in range(1, 7)}
    assert tagged.cell_names == {"3": 3, "8": 8}
    assert (tagged.cell_tags.values == np.where(middles(tagged)[:, 0] < 500.0, 3, 8)).all()
    normals = np.vstack([-np.eye(3), np.eye(3)])[[0, 3, 1, 4, 2, 5]]
    for tag, normal in zip(SIDES.values(), normals, strict=True):
        face = planar_face(tagged, tag)
        assert face.frame.normal.tolist() == normal.tolist()
        assert face.area == pytest.approx(1e6, rel=1e-13)  # sums of products


def test_a_mesh_that_was_written_is_read_again_with_its_names(tmp_path):
    first = read_mesh(write_boxes(tmp_path / "part.msh"), COMM, unit=25.4)
    write_mesh(first, tmp_path / "part.xdmf")
    again = read_mesh(tmp_path / "part.xdmf", COMM)
    assert (again.facet_names, again.cell_names) == (first.facet_names, first.cell_names)
    assert np.array_equal(*(of.bounding_box() for of in (first, again)))
    above = middles(again)[:, 2] > 25.4
    assert (again.cell_tags.values == np.where(above, 11, 10)).all()
    for name in first.facet_names:
        one, other = (planar_face(of, of.facet_tag(name)) for of in (first, again))
        assert one.frame.normal.tolist() == other.frame.normal.tolist()
        assert one.area == pytest.approx(other.area, rel=1e-14)  # of sums


def test_what_cannot_be_written_or_read_back_is_said(tmp_path):
    box = tagged_box(COMM)
    with pytest.raises(InputError, match=r"'\.msh': .* \(allowed: \.xdmf\)"):
        write_mesh(box, tmp_path / "box.msh")
    path = tmp_path / "box.xdmf"
    write_mesh(box, path)
    path.write_text(path.read_text().replace("&quot;cells&quot;", "cells"))
    with pytest.raises(InputError, match="its names of tags cannot be read"):
        read_mesh(path, COMM)


def test_xdmf_may_lack_tags_and_have_some(tmp_path):
    box = tagged_box(COMM)
    plain = read_mesh(write_xdmf(tmp_path / "plain.xdmf", box), COMM)
    assert plain.cell_tags is None and plain.facet_names == {}
    assert len(plain.facet_tags.indices) == 0
    some = dmesh.meshtags(box.mesh, 3, np.arange(2, dtype=np.int32), np.full(2, 6, np.int32))
    tagged = read_mesh(write_xdmf(tmp_path / "some.xdmf", box, (some, "some")), COMM)
    assert tagged.cell_names == {"0": 0, "6": 6}
    assert np.bincount(tagged.cell_tags.values).tolist()[6] == 2


def test_xdmf_that_does_not_fit_is_refused(tmp_path):
    box = tagged_box(COMM)
    tags = [(box.facet_tags, "one"), (box.facet_tags, "two")]
    with pytest.raises(InputError, match=r"\['one', 'two'\]: the file has several sets of tags"):
        write_xdmf(tmp_path / "two.xdmf", box, tags[0])
        text = (tmp_path / "two.xdmf").read_text()
        grid = text[text.index('<Grid Name="one"') : text.index("  </Domain>")]
        text = text.replace("  </Domain>", grid.replace('Name="one"', 'Name="two"') + "</Domain>")
        (tmp_path / "two.xdmf").write_text(text)
        read_mesh(tmp_path / "two.xdmf", COMM)
    path = write_xdmf(tmp_path / "moved.xdmf", box)
    (tmp_path / "moved.h5").unlink()
    with pytest.raises(InputError, match=r"its numbers are in moved\.h5, which is not there"):
        read_mesh(path, COMM)
    (tmp_path / "moved.h5").write_text("no numbers")
    with pytest.raises(InputError, match=r"moved\.h5 cannot be read"):
        read_mesh(path, COMM)
    path.write_text(path.read_text().replace('"Tetrahedron"', '"Tetrahedron_20"'))
    with pytest.raises(InputError, match=r"'tetrahedron_20': .* straight hexahedra"):
        read_mesh(path, COMM)
    square = dmesh.create_unit_square(COMM, 1, 1)
    with io.XDMFFile(COMM, str(tmp_path / "flat.xdmf"), "w") as file:
        file.write_mesh(square)
    with pytest.raises(InputError, match=r"cells that do not fit \(two-dimensional\)"):
        read_mesh(tmp_path / "flat.xdmf", COMM)
    for name, content, match in (
        ("text", "no XML", "this is no XDMF file"),
        ("other", "<Xdmf><Domain/></Xdmf>", r"\[\]: the file has 0 meshes"),
    ):
        (tmp_path / f"{name}.xdmf").write_text(content)
        with pytest.raises(InputError, match=match) as raised:
            read_mesh(tmp_path / f"{name}.xdmf", COMM)
        assert raised.value.file == str(tmp_path / f"{name}.xdmf")


@pytest.mark.parametrize(
    ("faces", "match"),
    [
        (
            [(7, (4, 5, 7)), (8, (7, 4, 5))],
            "1 facets of the mesh are in two groups, as in 'top' and",
        ),
        ([(7, (4, 5, 7)), (7, (4, 5, 6))], "1 of 2 facets of the surface 'top' belong to no cell"),
    ],
    ids=["twice", "beside"],
)
def test_facets_that_do_not_fit_are_refused(tmp_path, faces, match):
    elements = [(4, 1, 1, cell) for cell in FIVE]
    elements += [(2, tag, tag, rows) for tag, rows in faces]
    names = [(2, 7, "top"), (2, 8, "bottom")]
    path = write_msh2(tmp_path / "cube.msh", CUBE, elements, names)
    with pytest.raises(InputError, match=match) as raised:
        read_mesh(path, COMM)
    assert raised.value.file == str(path)


def test_bad_cells_are_refused_with_the_file(tmp_path):
    points = np.vstack([CUBE, CUBE + np.array([2.0, 0.0, 0.0])])
    cells = [*FIVE, *np.add(FIVE, 8)]
    path = write_msh2(tmp_path / "two.msh", points, [(4, 1, 1, cell) for cell in cells])
    with pytest.raises(InputError, match=r"two\.msh: the mesh is in 2 parts .* of 5, 5 cells"):
        read_mesh(path, COMM)
    path = write_msh2(tmp_path / "flat.msh", CUBE * [1, 1, 0], [(4, 1, 1, cell) for cell in FIVE])
    with pytest.raises(InputError, match=r"flat\.msh: 5 of 5 cells .* or have no volume"):
        read_mesh(path, COMM)


def test_paths_and_units_are_checked(tmp_path):
    with pytest.raises(InputError, match=r"'\.stl': .*allowed: \.msh of gmsh, \.xdmf of dolfinx"):
        read_mesh(tmp_path / "part.stl", COMM)
    with pytest.raises(InputError, match="there is no such file"):
        read_mesh(tmp_path / "part.msh", COMM)
    (tmp_path / "folder.msh").mkdir()
    with pytest.raises(InputError, match=r"folder\.msh: is a folder"):
        read_mesh(tmp_path / "folder.msh", COMM)
    with pytest.raises(InputError, match="0: the unit of a mesh is no length"):
        read_mesh(tmp_path / "part.msh", COMM, unit=0)


def test_bodies_are_three_dimensional_and_tags_those_of_facets():
    square = TaggedMesh(mesh=dmesh.create_unit_square(COMM, 1, 1), facet_tags=None)
    with pytest.raises(InputError, match=r"'triangle': .*allowed: tetrahedra or hexahedra"):
        MeshedBody(square, Material(young_modulus=1.0, poisson_ratio=0.3), [])
    with pytest.raises(InputError, match=r"'interval': .*or those of a plane mesh"):
        TaggedMesh(mesh=dmesh.create_unit_interval(COMM, 1), facet_tags=None)
    prisms = dmesh.create_unit_cube(COMM, 1, 1, 1, dmesh.CellType.prism)
    with pytest.raises(InputError, match=r"'prism': .*allowed: tetrahedra or hexahedra"):
        TaggedMesh(mesh=prisms, facet_tags=None)
    box = tagged_box(COMM)
    with pytest.raises(InputError, match="'dimension 3': the facet tags mark something else"):
        TaggedMesh(mesh=box.mesh, facet_tags=halves(box))


MESH, FACETS = "Mesh/mesh", "MeshTags/facets"
DAMAGES = {
    f"{MESH}/topology": (
        (lambda a: changed(a, -5), "cells have the node -5 of 36 nodes"),  # dolfinx waits for ever
        (lambda a: changed(a, 10**6), "cells have the node 1000000 of 36 nodes"),
        (lambda a: np.concatenate([a[:-1], a[:1]]), "1 cells stand in the mesh more than once"),
        (lambda a: a[:-3], "another number of cells is stated"),
        (lambda a: a[:, :3], r"\(.*3\): cells of the kind tetrahedron have other nodes"),
        (lambda a: a[:0], "another number of cells is stated"),
        (lambda a: a.astype(float), "'float64': /Mesh/mesh/topology has numbers of another kind"),
    ),
    f"{MESH}/geometry": (
        (lambda a: a[:, :2], r"\(36, 2\): the nodes have no three coordinates"),
        (lambda a: a[:30], r"cells have the node \d+ of 30 nodes"),
        (lambda a: a.astype("S9"), "has numbers of another kind"),
    ),
    f"{FACETS}/topology": (
        (lambda a: changed(a, -7), "cells have the node -7 of 36 nodes"),
        (lambda a: changed(a, 10**9), "cells have the node 1000000000 of 36 nodes"),
        (lambda a: changed(a, a[0, 2]), r"1 of \d+ tags of facets .* mark none of the mesh"),
        (lambda a: np.concatenate([a[:-1], a[:1]]), r"1 of \d+ tags of facets stand there twice"),
    ),
    f"{FACETS}/Values": (
        (lambda a: a[:-3], r"there are \d+ tags of \d+ facets or cells"),
        (lambda a: a.astype("i8") + 2**40, "tags are no numbers of 32 bits"),
        (lambda a: a + 0.5, "'float64': /MeshTags/facets/Values has numbers of another kind"),
    ),
}
"""Changes of arrays, of which the text of the file tells the shape, and what is said of them."""


def changed(array, value):
    array[0, 1] = value
    return array


@pytest.mark.parametrize("stated", [True, False], ids=["stated", "unstated"])
@pytest.mark.parametrize(
    ("name", "damage", "match"),
    [(name, *each) for name, several in DAMAGES.items() for each in several],
)
def test_damaged_arrays_are_refused_before_dolfinx_reads_them(
    tmp_path, name, damage, match, stated
):
    write_mesh(tagged_box(COMM), path := tmp_path / "part.xdmf")
    with h5py.File(tmp_path / "part.h5", "r+") as file:
        array = damage(before := file[name][()])
        del file[name]
        file[name] = array
    lines = path.read_text().splitlines()
    (line,) = (place for place, text in enumerate(lines) if f":/{name}<" in text)
    shapes = [" ".join(map(str, each.shape)) for each in (before, array)]
    if stated:
        lines[line] = lines[line].replace(f'"{shapes[0]}"', f'"{shapes[1]}"')
    elif shapes[0] != shapes[1]:
        match = f"/{name} has another shape than stated"
    path.write_text("\n".join(lines))
    with pytest.raises(InputError, match=match) as raised:
        read_mesh(path, COMM)
    assert raised.value.file == str(path)


def test_arrays_are_those_that_dolfinx_reads(tmp_path):
    """It reads the HDF5 file of the mesh's own name, whatever file the mesh says."""
    write_mesh(tagged_box(COMM), path := tmp_path / "a part & more.xdmf")
    assert read_mesh(path, COMM).facet_names
    other = tmp_path / "copy.xdmf"
    other.write_text(path.read_text())
    with pytest.raises(InputError, match=r"in a part & more\.h5, but dolfinx reads copy\.h5"):
        read_mesh(other, COMM)
    (tmp_path / "copy.h5").write_bytes((tmp_path / "a part & more.h5").read_bytes())
    with pytest.raises(InputError, match=r"but dolfinx reads copy\.h5"):
        read_mesh(other, COMM)
    other.write_text(path.read_text().replace("a part &amp; more.h5", "copy.h5"))
    assert read_mesh(other, COMM).facet_names
    path.write_text(path.read_text().replace("/Mesh/mesh/topology", "/Mesh/mesh"))
    with pytest.raises(InputError, match="numbers are missing: /Mesh/mesh"):
        read_mesh(path, COMM)
    path.write_text(path.read_text().replace('Format="HDF"', 'Format="XML"'))
    with pytest.raises(InputError, match="its numbers are in no HDF5 file"):
        read_mesh(path, COMM)
