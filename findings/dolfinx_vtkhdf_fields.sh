#!/usr/bin/env bash
# dolfinx 0.11, dolfinx.io.vtkhdf: pressures and gaps of one mesh in one file.
#
# Guess: fields of the same time stand beside each other, values at points beside values of cells.
# Seen: every field is called u, and the second one of the same time becomes another step of the first: a reader shows gaps as
# pressures later on. Values of cells after values at points (or before) end with "Failed to open HDF5 dataset by name".
# Write a file for each field.
set -euo pipefail
for PYTHON in python3 python3.12 python3.13 python3.14 ""; do # dolfinx 0.11 needs Python 3.12
    [ "$PYTHON" ] || { echo "no Python 3.12 or newer"; exit 2; }
    "$PYTHON" -c 'import sys; sys.exit(sys.version_info < (3, 12))' 2>/dev/null && break
done
source "$(dirname "$0")/packages.sh" dolfinx-solver-real==0.11.0.post0 h5py==3.16.0 vtk==9.7.1
python - <<'EOF' 2>errors.log || { cat errors.log; exit 1; }
from mpi4py import MPI  # isort: skip  # before dolfinx, which finds its library so

import h5py
import numpy as np
from dolfinx import fem, mesh
from dolfinx.io import vtkhdf
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkIOHDF import vtkHDFReader

box = mesh.create_unit_cube(MPI.COMM_SELF, 2, 2, 2)
pressure, gap = (fem.Function(fem.functionspace(box, ("Lagrange", 1))) for _ in range(2))
pressure.interpolate(lambda x: 5 + x[0])
gap.interpolate(lambda x: 0.001 + 0 * x[0])
cells = fem.Function(fem.functionspace(box, ("Discontinuous Lagrange", 0)))
vtkhdf.write_mesh("two.vtkhdf", box)
for field in (pressure, gap):
    vtkhdf.write_point_data("two.vtkhdf", box, field.x.array, 0.0)
with h5py.File("two.vtkhdf") as file:
    names, times = list(file["VTKHDF/PointData"]), file["VTKHDF/Steps/Values"][()]
reader = vtkHDFReader()
reader.SetFileName("two.vtkhdf")
reader.Update()
data, steps = reader.GetOutput().GetPointData(), reader.GetNumberOfSteps()
largest = []
for step in range(steps):
    reader.SetStep(step)
    reader.Update()
    largest.append(float(vtk_to_numpy(reader.GetOutput().GetPointData().GetArray(0)).max()))
print("fields", names, "times", times, "largest values of u step by step", largest)
assert names == ["u"] and data.GetNumberOfArrays() == 1 and list(times) == [0, 0] and np.allclose(largest, [6, 0.001])
for first in ("point", "cell"):
    vtkhdf.write_mesh(f"{first}.vtkhdf", box)
    writers = [
        lambda: vtkhdf.write_point_data(f"{first}.vtkhdf", box, pressure.x.array, 0.0),
        lambda: vtkhdf.write_cell_data(f"{first}.vtkhdf", box, cells.x.array, 0.0),
    ]
    one, other = writers if first == "point" else writers[::-1]
    one()
    try:
        other()
    except RuntimeError as error:
        print(f"first {first} data, then the other: {error}")
    else:
        raise SystemExit("changed: points and cells in one file")
EOF
