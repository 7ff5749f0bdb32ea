#!/usr/bin/env bash
# meshio 5.3.5: Lagrange hexahedra, as of FElupe 11.3.0 and dolfinx, into .vtu, read by VTK 9.7.2.
#
# Guess: a cube has the volume 1 as VTK reads it, for the nodes are written in VTK's order.
# Seen: 0.75 at order 2, 0.7778 at 3, 0.8125 at 4, without a word. VTK 9.1 changed the order of nodes on edges along z, and takes
# files of an earlier version of the format for the old one: meshio writes version 0.1. Through .vtk it is 1, as with version 2.2 in the
# first line.
set -euo pipefail
source "$(dirname "$0")/packages.sh" felupe==11.3.0 meshio==5.3.5 pyvista==0.49.1 vtk==9.7.2 scipy==1.17.1
python - <<'END'
import felupe
import meshio
import numpy as np
import pyvista
import vtk

for order, expected in ((1, 1.0), (2, 0.75), (3, 7 / 9), (4, 0.8125)):
    cell = vtk.vtkLagrangeHexahedron()
    cell.SetOrder(order, order, order)
    steps = range(order + 1)
    points = np.empty(((order + 1) ** 3, 3))
    for at in ((i, j, k) for i in steps for j in steps for k in steps):
        points[cell.PointIndexFromIJK(*at)] = np.array(at) / order
    rows = np.arange(len(points))
    own = pyvista.UnstructuredGrid(np.append(len(points), rows), [72], points).volume
    mesh = meshio.Mesh(points, [("VTK_LAGRANGE_HEXAHEDRON", [rows])])
    mesh.write("cube.vtu")
    mesh.write("cube.vtk")
    text = open("cube.vtu", "rb").read()
    assert b'version="0.1"' in text
    open("newer.vtu", "wb").write(text.replace(b'version="0.1"', b'version="2.2"', 1))
    volumes = [pyvista.read(name).volume for name in ("cube.vtu", "cube.vtk", "newer.vtu")]
    print(f"order {order}: volume {own:.4f} in VTK, {volumes[0]:.4f} by .vtu, {volumes[1]:.4f} by .vtk, {volumes[2]:.4f} with version 2.2")
    np.testing.assert_allclose([own, *volumes], [1, expected, 1, 1], rtol=1e-9)
cube = felupe.mesh.CubeArbitraryOrderHexahedron(order=3)
cube.save("felupe.vtu")
found = pyvista.read("felupe.vtu").volume
print(f"FElupe, order 3: volume {felupe.RegionLagrange(cube, order=3, dim=3).dV.sum():.4f}, {found:.4f} by .vtu")
assert abs(found - 7 / 9) < 1e-9
END
