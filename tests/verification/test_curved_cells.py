"""Bodies of curved cells of second order, from gmsh's files, against closed forms and flat ones."""

import numpy as np
import pytest
from dolfinx import fem
from dolfinx import mesh as dmesh
from helpers.contact_laws import PowerLaw
from helpers.mesh_files import gmsh_session
from helpers.user_problems import BOTTOM, TOP, box, clamped, elastic, marked
from mpi4py import MPI

from patchlaw.geometry import Control
from patchlaw.macro import ContactProblem, Interface, compat, planar_face, read_mesh, write_mesh
from patchlaw.macro.mesh.tagged import surface_area

COMM = MPI.COMM_SELF
RADIUS, HEIGHT = 5.0, 4.0
LAW = PowerLaw(50.0, power=1.0)


def cylinder(path, order, cells):
    """Write a cylinder of cells of about 3 mm, its top and bottom named."""
    with gmsh_session("cylinder") as gmsh:
        if cells == "tetrahedra":
            gmsh.model.occ.addCylinder(0, 0, 0, 0, 0, HEIGHT, RADIUS)
        else:
            disc = gmsh.model.occ.addDisk(0, 0, 0, RADIUS, RADIUS)
            gmsh.model.occ.extrude([(2, disc)], 0, 0, HEIGHT, [3], recombine=True)
            gmsh.option.setNumber("Mesh.RecombineAll", 1)
            gmsh.option.setNumber("Mesh.SubdivisionAlgorithm", 1)
            gmsh.option.setNumber("Mesh.SecondOrderIncomplete", cells.endswith("20 nodes"))
        gmsh.model.occ.synchronize()
        for _, face in gmsh.model.getEntities(2):
            _, _, low, _, _, high = gmsh.model.getBoundingBox(2, face)
            name = "top" if low > HEIGHT - 1e-3 else "bottom" if high < 1e-3 else "side"
            tag = gmsh.model.addPhysicalGroup(2, [face])
            gmsh.model.setPhysicalName(2, tag, name)
        gmsh.model.addPhysicalGroup(3, [volume for _, volume in gmsh.model.getEntities(3)])
        gmsh.option.setNumber("Mesh.MeshSizeMin", 3.0)
        gmsh.option.setNumber("Mesh.MeshSizeMax", 3.0)
        gmsh.model.mesh.generate(3)
        gmsh.model.mesh.setOrder(order)
        gmsh.write(str(path))
    return read_mesh(path, COMM)


def pressed(space, tags, top, bottom, poisson):
    """Return the force of a plane that presses a body by 0.1 mm, clamped at its bottom."""
    displacement = fem.Function(space)
    held = clamped(space, tags, tag=bottom)
    face = Interface(space, tags, top, laws=LAW, indenter=Control(approach=0.1))
    form = elastic(displacement, 4000.0, poisson, degree=4)
    ContactProblem(form, displacement, [held], face).solve()
    return face.force


@pytest.mark.long
@pytest.mark.parametrize("cells", ["tetrahedra", "hexahedra", "hexahedra of 20 nodes"])
def test_a_column_of_few_curved_cells_bears_what_a_round_one_does(tmp_path, cells):
    """Without lateral contraction the state is uniform: p = k δ / (1 + k H / E)."""
    mesh = cylinder(tmp_path / "curved.msh", 2, cells)
    assert compat.geometry_degree(mesh.mesh) == 2
    area = np.pi * RADIUS**2
    expected = area * LAW.k * 0.1 / (1.0 + LAW.k * HEIGHT / 4000.0)
    # twelve quadratic arcs enclose the disc to 2e-4; chords are 4 to 5 % short of it
    top, bottom = (mesh.facet_tag(name) for name in ("top", "bottom"))
    assert planar_face(mesh, top).area == pytest.approx(area, rel=4e-4)
    assert surface_area(mesh, mesh.facet_tag("side")) == pytest.approx(
        2.0 * np.pi * RADIUS * HEIGHT, rel=4e-4
    )
    if cells == "tetrahedra":
        write_mesh(mesh, tmp_path / "curved.xdmf")
        again = read_mesh(tmp_path / "curved.xdmf", COMM)
        assert planar_face(again, top).area == pytest.approx(planar_face(mesh, top).area, rel=1e-14)
    found = pressed(compat.vector_space(mesh.mesh, 2), mesh.facet_tags, top, bottom, 0.0)
    assert found == pytest.approx(expected, rel=5e-4)
    # linear displacements cannot be uniform strains in curved cells: measured 0.3 and 0.4 %
    linear = pressed(compat.vector_space(mesh.mesh, 1), mesh.facet_tags, top, bottom, 0.0)
    assert linear == pytest.approx(expected, rel=6e-3)
    straight = cylinder(tmp_path / "straight.msh", 1, cells)
    space = compat.vector_space(straight.mesh, 1)
    tags = [straight.facet_tag(name) for name in ("top", "bottom")]
    assert pressed(space, straight.facet_tags, *tags, 0.0) < 0.97 * expected


@pytest.mark.parametrize(
    ("kind", "degree"), [(dmesh.CellType.tetrahedron, 2), (dmesh.CellType.hexahedron, 1)]
)
def test_straight_cells_of_second_order_are_those_of_first(kind, degree):
    """The maps are the same polynomials; what is left is rounding."""
    first = box((3, 2, 2), kind)
    nodes = compat.vector_space(first, 2)
    cells = compat.cell_nodes(nodes).astype(np.int64)
    second = compat.mesh_from_cells(cells, nodes.tabulate_dof_coordinates(), None, COMM)
    assert compat.geometry_degree(second) == 2
    forces = [
        pressed(compat.vector_space(mesh, degree), marked(mesh), TOP, BOTTOM, 0.3)
        for mesh in (first, second)
    ]
    assert forces[1] == pytest.approx(forces[0], rel=1e-10)
