#!/usr/bin/env bash
# meshio: cells of .med files (Code_Aster, Salome), written and read.
#
# Guess: a cell of volume 1 has the volume 1 in gmsh, and the other way round.
# Seen: -1. The format counts the nodes of a cell round the other way, which meshio does not know: what it writes is inside out to
# gmsh, what gmsh writes inside out to meshio, tetrahedra, hexahedra, prisms and pyramids of both orders, and so are normals that are
# taken from the cells. Through meshio alone, there and back, nothing is seen of it. Turn the cells over.
set -euo pipefail
source "$(dirname "$0")/packages.sh" gmsh==4.15.2 meshio==5.3.5 h5py==3.16.0
python - <<'END'
import gmsh
import meshio
import numpy as np

low = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
high = [(x, y, 1) for x, y, _ in low]
triangle = [low[0], low[1], low[3]]
cells = {"hexahedron": low + high, "tetra": [*triangle, high[0]], "wedge": [*triangle, high[0], high[1], high[3]]}
cells["pyramid"] = [*low, (0.5, 0.5, 1)]
volumes = {"hexahedron": 1, "tetra": 1 / 6, "wedge": 1 / 2, "pyramid": 1 / 3}
corners = np.array(cells["tetra"], float)
edges = np.array([(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)])
cells["tetra10"], volumes["tetra10"] = np.vstack([corners, corners[edges].mean(axis=1)]), 1 / 6
gmsh.initialize()
gmsh.option.setNumber("General.Verbosity", 1)
for kind, points in cells.items():
    meshio.Mesh(np.array(points, float), [(kind, [list(range(len(points)))])]).write("one.med")
    gmsh.clear()
    gmsh.open("one.med")
    element = gmsh.model.mesh.getElementTypes(3)[0]
    at, weights = gmsh.model.mesh.getIntegrationPoints(element, "Gauss4")
    found = weights @ gmsh.model.mesh.getJacobians(element, at)[1]
    print(f"{kind} of meshio in gmsh: {found:.4f} in place of {volumes[kind]:.4f}")
    assert abs(found + volumes[kind]) < 1e-9

gmsh.clear()
gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1)
gmsh.model.occ.synchronize()
gmsh.model.addPhysicalGroup(3, [1])
gmsh.model.mesh.generate(3)
found = {}
for suffix in ("med", "msh"):
    gmsh.write(f"box.{suffix}")
    mesh = meshio.read(f"box.{suffix}")
    at = mesh.points[np.vstack([block.data for block in mesh.cells if block.type == "tetra"])]
    found[suffix] = np.linalg.det(at[:, 1:] - at[:, :1]).sum() / 6
    print(f"box of gmsh in meshio, .{suffix}: {found[suffix]:.4f}")
assert np.allclose([found["med"], found["msh"]], [-1, 1])
END
