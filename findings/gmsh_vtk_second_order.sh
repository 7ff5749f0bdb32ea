#!/usr/bin/env bash
# gmsh: its .vtk files of second order, read by itself and by VTK.
#
# Guess: a cube that gmsh writes has the volume 1 when gmsh reads it again.
# Seen: hexahedra of 20 nodes come back with -0.3, prisms of 15 with 0.678, tetrahedra of 10 with 1: the file is right, and right to
# VTK and meshio, but gmsh takes its midside nodes for those of its own order. No warning. Through .msh, .med, .unv and .bdf all have 1.
set -euo pipefail
source "$(dirname "$0")/packages.sh" gmsh==4.15.2 pyvista==0.49.1 vtk==9.7.2
python - <<'END'
import gmsh
import numpy as np
import pyvista


def volume():
    total = 0.0
    for kind, cells in zip(*gmsh.model.mesh.getElements(3)[:2]):
        points, weights = gmsh.model.mesh.getIntegrationPoints(kind, "Gauss4")
        total += np.tile(weights, len(cells)) @ gmsh.model.mesh.getJacobians(kind, points)[1]
    return total


gmsh.initialize()
gmsh.option.setNumber("General.Verbosity", 1)
seen = {"Hexahedron 20": -0.3, "Prism 15": 0.677778, "Tetrahedron 10": 1.0}
for name, there in seen.items():
    gmsh.clear()
    gmsh.option.setNumber("Mesh.SecondOrderIncomplete", 1)
    if name == "Tetrahedron 10":
        gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1)
    else:
        flat = name == "Hexahedron 20"
        face = gmsh.model.occ.addRectangle(0, 0, 0, 1, 1)
        gmsh.model.occ.extrude([(2, face)], 0, 0, 1, numElements=[1], recombine=True)
    gmsh.model.occ.synchronize()
    for _, curve in gmsh.model.getEntities(1):
        gmsh.model.mesh.setTransfiniteCurve(curve, 2)
    if name == "Hexahedron 20":
        for _, face in gmsh.model.getEntities(2):
            gmsh.model.mesh.setTransfiniteSurface(face)
            gmsh.model.mesh.setRecombine(2, face)
    gmsh.model.mesh.generate(3)
    gmsh.model.mesh.setOrder(2)
    kind = gmsh.model.mesh.getElementTypes(3)[0]
    assert gmsh.model.mesh.getElementProperties(kind)[0] == name
    for suffix, expected in (("vtk", there), ("msh", 1.0), ("med", 1.0), ("unv", 1.0), ("bdf", 1.0)):
        gmsh.write(f"{name}.{suffix}")
    for suffix, expected in (("vtk", there), ("msh", 1.0), ("med", 1.0), ("unv", 1.0), ("bdf", 1.0)):
        gmsh.clear()
        gmsh.open(f"{name}.{suffix}")
        print(name, suffix, round(volume(), 6), end="; ")
        assert abs(volume() - expected) < 1e-5
    cell = next(one for one in pyvista.read(f"{name}.vtk").cell if one.dimension == 3)
    ends = {20: 8, 15: 6, 10: 4}[len(cell.points)]
    edges = [edge.points for edge in cell.edges]
    print("VTK: a midside node is off its edge by", max(np.abs(e[2] - (e[0] + e[1]) / 2).max() for e in edges))
    assert max(np.abs(edge[2] - (edge[0] + edge[1]) / 2).max() for edge in edges) < 1e-12
END
