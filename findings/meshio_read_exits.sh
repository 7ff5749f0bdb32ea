#!/usr/bin/env bash
# meshio: a file that meshio.read cannot read, here a series of load steps in XDMF, as its own TimeSeriesWriter or
# dolfinx writes it.
#
# Guess: an exception, meshio.ReadError.
# Seen: "Only supports one grid right now." is printed and SystemExit raised, which "except Exception" lets pass: the
# program ends in the middle, with exit code 1. TimeSeriesReader reads the file.
set -euo pipefail
source "$(dirname "$0")/packages.sh" meshio==5.3.5 h5py==3.16.0
python - <<'END'
import meshio
import numpy as np

points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
with meshio.xdmf.TimeSeriesWriter("steps.xdmf") as file:
    file.write_points_cells(points, [("tetra", np.array([[0, 1, 2, 3]]))])
    for step in (0, 1):
        file.write_data(float(step), point_data={"u": step * points})
with meshio.xdmf.TimeSeriesReader("steps.xdmf") as file:
    found, _ = file.read_points_cells()
    print("TimeSeriesReader:", file.num_steps, "steps")
    np.testing.assert_allclose(found, points)
try:
    meshio.read("steps.xdmf")
except Exception as error:
    raise SystemExit(f"{type(error).__name__} now") from error
except SystemExit as end:
    print("meshio.read: SystemExit", end.code)
    assert end.code == 1
END
