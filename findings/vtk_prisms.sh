#!/usr/bin/env bash
# VTK 9.7.2, PyVista 0.49.1: prisms (vtkWedge) and their outer faces, as a pressure on them is integrated; PyMFEM 4.10 writes some.
#
# Guess: a prism whose volume is positive has normals that point out of it, of either order; cut into tetrahedra it has the same volume.
# Seen: of linear prisms in the order of gmsh, Abaqus and finite element books the volume is 0.5, all normals point inward, and the tetrahedra have -0.5.
# VTK's own order, whose first triangle looks outward, has normals outward, 0.5 in tetrahedra and -0.5 as a prism: PyMFEM writes linear prisms
# so, and second-order ones the other way. Of 15 nodes in the order of books normals point outward and the volume is 0.5, in tetrahedra -0.5.
# Beside hexahedra the force of a pressure gets the wrong sign on prisms. Turn normals by the body's side before you integrate.
set -euo pipefail
source "$(dirname "$0")/packages.sh" pyvista==0.49.1 vtk==9.7.2 mfem==4.10.0.1 scipy==1.17.1
python - <<'END'
import mfem.ser as mfem
import numpy as np
import pyvista

corners = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (0, 1, 1)], float)
edges = np.array([(0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)])
kinds = pyvista.CellType
books = {kinds.WEDGE: corners, kinds.QUADRATIC_WEDGE: np.vstack([corners, corners[edges].mean(axis=1)])}


def seen(grid, inside):
    """Return volume, volume of the tetrahedra, and shares of the normals that point outward."""
    faces = grid.extract_surface(nonlinear_subdivision=0).triangulate()
    faces = faces.compute_normals(auto_orient_normals=False, consistent_normals=False)
    outward = np.einsum("ij,ij->i", faces["Normals"], faces.cell_centers().points - inside) > 0
    return grid.volume, grid.triangulate().volume, outward.mean()


def one(kind, points):
    return pyvista.UnstructuredGrid(np.append(len(points), np.arange(len(points))), [int(kind)], points)


middle = corners.mean(axis=0)
hexahedron = np.array([(x, y, z) for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))], float)
for name, grid, expected in (
    ("hexahedron", one(kinds.HEXAHEDRON, hexahedron), (1.0, 1.0, 1.0)),
    ("6 nodes", one(kinds.WEDGE, corners), (0.5, -0.5, 0.0)),
    ("6 nodes, VTK's order", one(kinds.WEDGE, corners[[0, 2, 1, 3, 5, 4]]), (-0.5, 0.5, 1.0)),
    ("15 nodes", one(kinds.QUADRATIC_WEDGE, books[kinds.QUADRATIC_WEDGE]), (0.5, -0.5, 1.0)),
):
    found = seen(grid, hexahedron.mean(axis=0) if name == "hexahedron" else middle)
    print(f"{name}: volume {found[0]:.3f}, in tetrahedra {found[1]:.3f}, normals outward {found[2]:.0%}")
    np.testing.assert_allclose(found, expected, atol=1e-9)
mesh = mfem.Mesh(3, 6, 1)
for point in corners:
    mesh.AddVertex(*point)
mesh.AddWedge([0, 1, 2, 3, 4, 5])
mesh.FinalizeMesh()
mesh.PrintVTU("linear")
mesh.SetCurvature(2)
mesh.PrintVTU("curved", mfem.VTKFormat_ASCII, True)
for name, expected in (("linear", -0.5), ("curved", 0.5)):
    grid = pyvista.read(f"{name}.vtu")
    print(f"PyMFEM, {name}: volume {mesh.GetElementVolume(0):.3f}, in PyVista {grid.volume:.3f}")
    np.testing.assert_allclose([mesh.GetElementVolume(0), grid.volume], [0.5, expected], atol=1e-9)
END
