#!/usr/bin/env bash
# dolfinx from PyPI (dolfinx-solver-real): meshes in XDMF that meshio writes.
#
# Guess: dolfinx reads what meshio writes, as with other builds and in many tutorials.
# Seen: "Failed to read HDF5 data": meshio compresses by default, and the HDF5 of this wheel has no filter for it
# ("required filter 'deflate' is not registered"). meshio.write(..., compression=None) makes a file that it reads.
set -euo pipefail
for PYTHON in python3 python3.12 python3.13 python3.14 ""; do # dolfinx 0.11 needs Python 3.12
    [ "$PYTHON" ] || { echo "no Python 3.12 or newer"; exit 2; }
    "$PYTHON" -c 'import sys; sys.exit(sys.version_info < (3, 12))' 2>/dev/null && break
done
source "$(dirname "$0")/packages.sh" dolfinx-solver-real==0.11.0.post0 meshio==5.3.5 h5py==3.16.0
python - <<'END' 2>errors.log
import meshio
import numpy as np

points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
mesh = meshio.Mesh(points, [("tetra", [[0, 1, 2, 3]])])
meshio.write("default.xdmf", mesh)
meshio.write("plain.xdmf", mesh, compression=None)
END
for name in plain default; do
    NAME=$name python - <<'END' 2>"$name.log"
import os

from mpi4py import MPI
from dolfinx import io

name = os.environ["NAME"]
try:
    with io.XDMFFile(MPI.COMM_SELF, f"{name}.xdmf", "r") as file:
        print(name, "cells", file.read_mesh(name="Grid").topology.index_map(3).size_local)
    assert name == "plain"
except RuntimeError as error:
    print(name, "RuntimeError:", error)
    assert name == "default" and "Failed to read HDF5 data" in str(error)
END
done
grep -m 1 -o "required filter 'deflate' is not registered" default.log
