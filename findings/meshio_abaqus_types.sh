#!/usr/bin/env bash
# meshio: a mesh of gmsh converted to an input deck (.inp) for Abaqus or CalculiX.
#
# Guess: elements become C3D8, C3D20, C3D10, and faces nothing or a set.
# Seen: of all names that it knows for a shape meshio writes the last: C3D8RH, C3D20RH, C3D10MH (reduced, hybrid,
# modified) and, in the same deck, triangles as R3D3 and quadrilaterals as CAX4P (rigid, axisymmetric). Numbers have
# 22 characters (see calculix_number_of_21_characters.sh). gmsh's own .inp has the right types.
set -euo pipefail
source "$(dirname "$0")/packages.sh" meshio==5.3.5
python - <<'END'
import re

import meshio
import numpy as np

corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1.0]])
edges = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)]
brick = np.vstack([corners, [corners[list(one)].mean(axis=0) for one in edges]]) / 3
tetrahedron = brick[[0, 1, 3, 4, 8, 9, 11, 16, 12, 15]]
seen = {"hexahedron": "C3D8RH", "hexahedron20": "C3D20RH", "tetra10": "C3D10MH", "triangle": "R3D3", "quad": "CAX4P"}
for shape, name in seen.items():
    nodes = {"hexahedron": 8, "hexahedron20": 20, "tetra10": 10, "triangle": 3, "quad": 4}[shape]
    points = tetrahedron if shape == "tetra10" else brick[:nodes]
    meshio.write("mesh.inp", meshio.Mesh(points, [(shape, [list(range(nodes))])]))
    text = open("mesh.inp").read()
    written = re.search(r"\*ELEMENT, *TYPE=(\w+)", text)[1]
    longest = max(len(number.strip()) for line in text.splitlines()[3:6] for number in line.split(",")[1:])
    print(shape, "becomes", written, "numbers of", longest, "characters")
    assert written == name and longest == 22
END
