#!/usr/bin/env bash
# meshio 5.3.5: prisms of second order that gmsh 4.15 makes, 18 nodes (its default) and 15 (SecondOrderIncomplete), into .vtu.
#
# Guess: a cube of prisms with straight edges has the volume 1 in VTK, as hexahedra of 27 and 20 and tetrahedra of 10 nodes have.
# Seen: 0.125 of 18 nodes, without a word: the nodes on edges and faces stay in gmsh's order, which VTK's is not. From .msh to .msh nothing is
# seen of it. Prisms of 15 nodes, of which meshio knows the order, end with KeyError. Put the nodes into VTK's order; then the volume is 1.
set -euo pipefail
source "$(dirname "$0")/packages.sh" gmsh==4.15.2 meshio==5.3.5 pyvista==0.49.1 vtk==9.7.2
python - <<'END'
import gmsh
import meshio
import numpy as np
import pyvista

gmsh.initialize()
gmsh.option.setNumber("General.Verbosity", 1)
gmsh.option.setNumber("Mesh.MshFileVersion", 2.2)
gmsh.option.setNumber("Mesh.ElementOrder", 2)


def cube(kind, incomplete):
    """Write a cube of a few such elements and return its volume."""
    gmsh.clear()
    gmsh.option.setNumber("Mesh.SecondOrderIncomplete", incomplete)
    entity, quads, bricks = (0, gmsh.model.geo.addPoint(0, 0, 0)), kind == "hexahedron", kind != "tetrahedron"
    for step, layers in (((1, 0, 0), False), ((0, 1, 0), quads), ((0, 0, 1), bricks)):
        entity = gmsh.model.geo.extrude([entity], *step, [1], recombine=layers)[1]
    gmsh.model.geo.synchronize()
    gmsh.model.mesh.generate(3)
    gmsh.write("cube.msh")
    element = gmsh.model.mesh.getElementTypes(3)[0]
    points, weights = gmsh.model.mesh.getIntegrationPoints(element, "Gauss4")
    return gmsh.model.mesh.getJacobians(element, points)[1].reshape(-1, len(weights)).sum(axis=0) @ weights


def volume(points, cells):
    meshio.Mesh(points, cells).write("cube.vtu")
    return pyvista.read("cube.vtu").volume


order = [0, 1, 2, 3, 4, 5, 6, 9, 7, 12, 14, 13, 8, 10, 11, 15, 17, 16]  # of VTK's nodes in gmsh
for kind, incomplete, expected in (("tetrahedron", 0, 1), ("hexahedron", 0, 1), ("hexahedron", 1, 1), ("prism", 0, 0.125), ("prism", 1, None)):
    own = cube(kind, incomplete)
    assert abs(own - 1) < 1e-9
    try:
        mesh = meshio.read("cube.msh")
    except KeyError as error:
        print(f"{kind}: KeyError {error}")
        assert expected is None
        continue
    cells = [(block.type, block.data) for block in mesh.cells if block.dim == 3]
    found = volume(mesh.points, cells)
    print(f"{cells[0][0]}: volume {own:.4f} in gmsh, {found:.4f} in VTK")
    assert abs(found - expected) < 1e-6
    if kind == "prism":
        assert abs(volume(mesh.points, [(cells[0][0], cells[0][1][:, order])]) - 1) < 1e-9
END
