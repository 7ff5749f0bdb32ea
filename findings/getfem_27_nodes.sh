#!/usr/bin/env bash
# GetFEM 5.4.2 of Debian 12: meshes and fields of hexahedra of second order with 27 nodes, in .vtk and .vtu.
#
# Guess: cells of VTK's type 29, triquadratic hexahedra, with their 27 nodes, and values at each of them.
# Seen: the type is 29, but the cell has 26 nodes: the one in the middle and its value are left out, without a word, of meshes and of
# fields alike. A reader that takes the type at its word counts on one more. The cell of 20 nodes has all of them. Coordinates
# are written in single precision with six digits: 1.2345678 is 1.23457.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
apt-get download -q python3-getfem=5.4.2+dfsg1-3+b1 libgetfem5=5.4.2+dfsg1-3+b1 libmumps-seq-5.5 libqhull-r8.0 >apt.log 2>&1 || { cat apt.log; exit 2; }
for package in *.deb; do dpkg-deb -x "$package" tree; done
libraries=$(find "$folder/tree/usr/lib" -name '*.so*' -printf '%h\n' | sort -u | paste -sd :)
LD_LIBRARY_PATH=$libraries PYTHONPATH=$folder/tree/usr/lib/python3/dist-packages OMP_NUM_THREADS=1 /usr/bin/python3 - <<'END'
import re
import xml.etree.ElementTree as tree

import getfem
import numpy as np


def written(name, source, *values):
    """Return type and number of nodes of the one cell of a .vtk and of a .vtu file, and how many values stand there."""
    source.export_to_vtk(f"{name}.vtk", "ascii", *values)
    source.export_to_vtu(f"{name}.vtu", "ascii", *values)
    text = open(f"{name}.vtk").read()
    kind = int(re.search(r"CELL_TYPES 1\s+(\d+)", text)[1])
    nodes = int(re.search(r"CELLS 1 \d+\s+(\d+)", text)[1])
    arrays = {one.get("Name"): one.text.split() for one in tree.parse(f"{name}.vtu").iter("DataArray")}
    assert (int(arrays["types"][0]), len(arrays["connectivity"])) == (kind, nodes)
    print(f"{name}: type {kind} with {nodes} nodes", *(f"and {len(arrays['field'])} values" for _ in values[:1]))
    assert not values or len(arrays["field"]) == nodes
    return kind, nodes


for transformation, seen in (("GT_Q2_INCOMPLETE(3)", (25, 20)), ("GT_QK(3,2)", (29, 26))):
    mesh = getfem.Mesh("empty", 3)
    shape = getfem.GeoTrans(transformation)
    mesh.add_convex(shape, shape.pts() * 1.2345678)
    assert mesh.nbpts() == {25: 20, 29: 27}[seen[0]]
    assert written(f"mesh_{seen[0]}", mesh) == seen
cube = getfem.Mesh("cartesian", *([np.array([0.0, 1.2345678])] * 3))
space = getfem.MeshFem(cube, 1)
space.set_fem(getfem.Fem("FEM_QK(3,2)"))
assert space.nbdof() == 27
assert written("field", space, np.arange(27.0), "field") == (29, 26)
coordinates = set(re.search(r"POINTS \d+ (\w+)(.*?)CELLS", open("field.vtk").read(), re.S)[2].split())
print("coordinates", sorted(coordinates))
assert "1.23457" in coordinates and "1.2345678" not in coordinates
END
