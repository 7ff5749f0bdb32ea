#!/usr/bin/env bash
# Netgen 6.2.2608, netgen.read_gmsh: named faces and cells of second order of gmsh 4.15 (.msh 2.2) in NGSolve.
#
# Guess: names come as they are, and NGSolve's volume is gmsh's.
# Seen: a name ends before its first blank, and its last letter goes too: "side face" becomes sid, "top face" to, and two faces that differ behind
# the blank become one name. Prisms of 15 nodes have others on their edges: a cylinder of 3.1415 has 3.1105; tetrahedra of 10 and
# hexahedra of 20 nodes are right, of 27 and prisms of 18 refused. Give names without blanks, and prisms of first order.
set -euo pipefail
source "$(dirname "$0")/packages.sh" gmsh==4.15.2 ngsolve==6.2.2608
python - <<'END'
import gmsh
import ngsolve
from netgen.read_gmsh import ReadGmsh

gmsh.initialize()
option = gmsh.option.setNumber
for name, value in (("General.Verbosity", 1), ("Mesh.MshFileVersion", 2.2), ("Mesh.MeshSizeMax", 0.7), ("Mesh.SecondOrderIncomplete", 1)):
    option(name, value)


def cylinder(kind, order):
    """Write a cylinder of radius and height 1 with names and return its volume."""
    gmsh.clear()
    option("Mesh.ElementOrder", order)
    option("Mesh.RecombineAll", kind == "hexahedra")
    option("Mesh.SubdivisionAlgorithm", kind == "hexahedra")
    disc = (2, gmsh.model.occ.addDisk(0, 0, 0, 1, 1))
    gmsh.model.occ.extrude([disc], 0, 0, 1, [] if kind == "tetrahedra" else [2], recombine=kind != "tetrahedra")
    gmsh.model.occ.synchronize()
    gmsh.model.addPhysicalGroup(3, [1], 1, "pad")
    for face, name in ((1, "rough face one"), (2, "side face"), (3, "rough face two")):
        gmsh.model.addPhysicalGroup(2, [face], face, name)
    gmsh.model.mesh.generate(3)
    gmsh.write("cylinder.msh")
    element = gmsh.model.mesh.getElementTypes(3)[0]
    points, weights = gmsh.model.mesh.getIntegrationPoints(element, "Gauss6")
    return gmsh.model.mesh.getJacobians(element, points)[1].reshape(-1, len(weights)).sum(axis=0) @ weights


for kind, order, right in (
    ("tetrahedra", 1, True),
    ("tetrahedra", 2, True),
    ("hexahedra", 1, True),
    ("hexahedra", 2, True),
    ("prisms", 1, True),
    ("prisms", 2, False),
):
    own = cylinder(kind, order)
    mesh = ngsolve.Mesh(ReadGmsh("cylinder.msh"))
    found, names = ngsolve.Integrate(1, mesh), set(mesh.GetBoundaries())
    print(f"{kind} of order {order}: volume {own:.5f} in gmsh, {found:.5f} in NGSolve, faces {sorted(names)}, {mesh.GetMaterials()}")
    assert names - {"default"} == {"roug", "sid"} and mesh.GetMaterials() == ("pad",)
    assert (abs(found / own - 1) < 1e-9) == right
assert 0.005 < 1 - found / own < 0.02
END
