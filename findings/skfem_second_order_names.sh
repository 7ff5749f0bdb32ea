#!/usr/bin/env bash
# scikit-fem: names of faces in meshes of gmsh.
#
# Guess: physical groups of faces become mesh.boundaries for elements of first and of second order.
# Seen: for first order they do. For second order (MeshTet2) they are None; the only word is a line of the log,
# "Failure to parse tags from meshio". Select such faces by place.
set -euo pipefail
source "$(dirname "$0")/packages.sh" gmsh==4.15.2 scikit-fem==12.0.2 meshio==5.3.5
python - <<'END'
import gmsh
import skfem

gmsh.initialize()
gmsh.option.setNumber("General.Verbosity", 0)
box = gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1)
gmsh.model.occ.synchronize()
gmsh.model.addPhysicalGroup(3, [box], 1, "solid")
gmsh.model.addPhysicalGroup(2, [gmsh.model.getEntities(2)[0][1]], 2, "rough")
gmsh.option.setNumber("Mesh.MeshSizeMin", 0.5)
gmsh.model.mesh.generate(3)
for order, kind in ((1, "MeshTet1"), (2, "MeshTet2")):
    gmsh.model.mesh.setOrder(order)
    gmsh.write("part.msh")
    mesh = skfem.Mesh.load("part.msh")
    print(type(mesh).__name__, "boundaries", mesh.boundaries and list(mesh.boundaries), "subdomains", list(mesh.subdomains or ()))
    assert type(mesh).__name__ == kind
    assert (mesh.boundaries is None) == (order == 2)
    assert order == 2 or "rough" in mesh.boundaries
END
