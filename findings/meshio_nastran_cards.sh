#!/usr/bin/env bash
# meshio: hexahedra of 20 and tetrahedra of 10 nodes as Nastran bulk data (.bdf, .nas).
#
# Guess: cards CHEXA and CTETRA, which any reader of the format has the volume 1 and 1/6 of.
# Seen: the cards are called CHEXA_ and CTETRA_, names that the format does not have; meshio alone takes them. The field of the
# property is empty, also at first order: there gmsh refuses the cells, but of the 20 nodes it makes other 20, one of them
# the mark +11 of a continuation, and the cube's volume 1.1528 without a word. With a property number it is 1.
set -euo pipefail
source "$(dirname "$0")/packages.sh" gmsh==4.15.2 meshio==5.3.5
python - <<'END'
import gmsh
import meshio
import numpy as np

ring = [(0, 0), (1, 0), (1, 1), (0, 1)]
cube = np.array([(x, y, z) for z in (0, 1) for x, y in ring], float)
around = [(0, 1), (1, 2), (2, 3), (3, 0)]
edges = around + [(a + 4, b + 4) for a, b in around] + [(n, n + 4) for n in range(4)]
gmsh.initialize()
gmsh.option.setNumber("General.Verbosity", 0)


def volume(file):
    gmsh.clear()
    gmsh.open(file)
    kind = gmsh.model.mesh.getElementTypes(3)[0]
    points, weights = gmsh.model.mesh.getIntegrationPoints(kind, "Gauss4")
    return weights @ gmsh.model.mesh.getJacobians(kind, points)[1]


half = cube[[0, 1, 3, 4]]
sides = [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)]
for kind, points, card in (
    ("hexahedron", cube, "CHEXA   "),
    ("hexahedron20", np.vstack([cube, cube[np.array(edges)].mean(axis=1)]), "CHEXA_  "),
    ("tetra10", np.vstack([half, half[np.array(sides)].mean(axis=1)]), "CTETRA_ "),
):
    meshio.Mesh(points, [(kind, [list(range(len(points)))])]).write("one.bdf")
    text = open("one.bdf").read()
    line = next(row for row in text.splitlines() if row.startswith("C"))
    print(f"{kind}: {line!r}")
    assert line.startswith(card + "1       " + 8 * " ")
    if kind == "hexahedron20":
        open("named.bdf", "w").write(text.replace("CHEXA_  1               ", "CHEXA   1       1       "))
        print("volume in gmsh", volume("one.bdf"), "with name and property", volume("named.bdf"))
        assert abs(volume("one.bdf") - 1.152778) < 1e-5 and abs(volume("named.bdf") - 1) < 1e-9
END
