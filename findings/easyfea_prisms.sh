#!/usr/bin/env bash
# EasyFEA: prisms of second order (18 nodes) in a file that gmsh 4.15 wrote, read by EasyFEA.IO.Gmsh.
#
# Guess: the same mesh as by its own mesher, which is gmsh too; a file that cannot be read says so, as one of prisms of 15 nodes does.
# Seen: midside nodes stand on other edges: a cube has the volume 0.773 in place of 1, by which it also has 0.773 of its mass. What its own
# mesher makes has 1, also when it is saved and read again: the file that it saves has another order than that of gmsh, to whom that cube
# has another volume. No warning. Tetrahedra of 10 and hexahedra of 20 and 27 nodes are right.
set -euo pipefail
source "$(dirname "$0")/packages.sh" easyfea==7.1.0 gmsh==4.15.2 meshio==5.3.5
python - >log 2>&1 <<'END' || { cat log; exit 1; }
import gmsh
import numpy as np
from EasyFEA import ElemType
from EasyFEA.Geoms import Domain, Point
from EasyFEA.IO import Gmsh


def written():
    """Write a cube of prisms of second order."""
    gmsh.initialize()
    face = gmsh.model.occ.addRectangle(0, 0, 0, 1, 1)
    gmsh.model.occ.extrude([(2, face)], 0, 0, 1, [2], recombine=True)
    gmsh.model.occ.synchronize()
    gmsh.option.setNumber("Mesh.MeshSizeMin", 0.5)
    gmsh.model.addPhysicalGroup(3, [tag for _, tag in gmsh.model.getEntities(3)], name="body")
    gmsh.model.mesh.generate(3)
    gmsh.model.mesh.setOrder(2)
    gmsh.option.setNumber("Mesh.MshFileVersion", 2.2)
    gmsh.write("cube.msh")
    gmsh.finalize()


def volume(name):
    """Return the volume of the prisms of a file to gmsh."""
    gmsh.initialize()
    gmsh.open(name)
    (kind,), _, _ = gmsh.model.mesh.getElements(3)
    points, weights = gmsh.model.mesh.getIntegrationPoints(kind, "Gauss6")
    found = (gmsh.model.mesh.getJacobians(kind, points)[1].reshape(-1, len(weights)) * weights).sum()
    gmsh.finalize()
    return found


written()
own = Domain(Point(0, 0), Point(1, 1), 0.5).Mesh_Extrude([], [0, 0, 1], [2], ElemType.PRISM18)
saved = Gmsh.Save_mesh(own, "saved", "own")
found = {
    "gmsh's file to gmsh": volume("cube.msh"),
    "gmsh's file to EasyFEA": Gmsh.Load_mesh("cube.msh").volume,
    "its own mesh": own.volume,
    "its own file to EasyFEA": Gmsh.Load_mesh(saved).volume,
    "its own file to gmsh": volume(saved),
}
for name, one in found.items():
    print("RESULT", name, round(float(one), 4))
np.testing.assert_allclose(list(found.values())[:4], [1, 0.77296, 1, 1], rtol=1e-4)
END
grep RESULT log
