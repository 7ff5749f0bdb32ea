#!/usr/bin/env bash
# Netgen 6.2.2608: tetrahedra of both orders that it writes as "Gmsh2 Format" and "Abaqus Format", read by gmsh 4.15 and as text.
#
# Guess: gmsh finds Netgen's volume and the names of its faces and materials.
# Seen: minus the volume, of both orders: all tetrahedra are inside out, faces are not. Names are gone, their numbers are 1, 2, ... in
# the order of faces and 100001 of the first material, also where two faces share a name. The Abaqus file keeps names, but faces are elements of
# plane stress there (CPS3, CPS6), which bear. Take the numbers and turn the cells over; take faces out of an Abaqus file.
set -euo pipefail
source "$(dirname "$0")/packages.sh" gmsh==4.15.2 ngsolve==6.2.2608
python - <<'END'
import gmsh
import ngsolve
import numpy as np
from netgen.occ import Cylinder, OCCGeometry, Z

gmsh.initialize()
gmsh.option.setNumber("General.Verbosity", 1)


def volumes(dim):
    """Return the sum over all elements and the share of positive ones."""
    element = gmsh.model.mesh.getElementTypes(dim)[0]
    points, weights = gmsh.model.mesh.getIntegrationPoints(element, "Gauss4")
    each = gmsh.model.mesh.getJacobians(element, points)[1].reshape(-1, len(weights)) @ weights
    return each.sum(), (each > 0).mean()


part = Cylinder((0, 0, 0), Z, r=1, h=1)
part.faces.name = "back"
part.faces.Max(Z).name = "rough"
part.mat("steel")
for order, faces in ((1, "CPS3"), (2, "CPS6")):
    mesh = OCCGeometry(part).GenerateMesh(maxh=0.7)
    if order == 2:
        mesh.SecondOrder()
    own = ngsolve.Mesh(mesh)
    mesh.Export("part.msh", "Gmsh2 Format")
    mesh.Export("part.inp", "Abaqus Format")
    gmsh.clear()
    gmsh.open("part.msh")
    volume, share = volumes(3)
    groups = gmsh.model.getPhysicalGroups()
    print(f"order {order}: volume {ngsolve.Integrate(1, own):.5f} in Netgen, {volume:.5f} in gmsh; faces {own.GetBoundaries()} are {groups}")
    np.testing.assert_allclose([volume, share, volumes(2)[1]], [-ngsolve.Integrate(1, own), 0, 1], rtol=1e-5)
    assert own.GetBoundaries() == ("back", "rough", "back") and own.GetMaterials() == ("steel",)
    assert groups == [(2, 1), (2, 2), (2, 3), (3, 100001)] and not any(gmsh.model.getPhysicalName(*group) for group in groups)
    cards = [line.strip() for line in open("part.inp") if line.startswith("*Element")]
    print("in Abaqus' format:", cards)
    assert cards[0] == f"*Element, type={faces}, ELSET=back" and cards[-1].endswith("ELSET=steel")
END
