#!/usr/bin/env bash
# Tamaas 2.9: models written to files (NumPy, HDF5, NetCDF, JSON) and read back, the way to go on with an earlier run.
#
# Guess: the model that is read is the one that was written: its fields, sizes and elastic constants.
# Seen: fields and sizes come back, Young's modulus and Poisson's ratio do not, nor are they in the file: they are 1 and 0, without a
# word. Displacements of the same pressures are then 3.125 times as large where the modulus was 3 and the ratio 0.2. Set both again.
set -euo pipefail
source "$(dirname "$0")/packages.sh" tamaas==2.9.0 scipy==1.17.1 h5py==3.16.0 netCDF4==1.7.4
python - <<'END'
import numpy as np
import tamaas
from tamaas.dumpers import H5Dumper, JSONDumper, NetCDFDumper, NumpyDumper

model = tamaas.ModelFactory.createModel(tamaas.model_type.basic_2d, [2.0, 3.0], [4, 6])
model.E, model.nu = 3.0, 0.2
model.traction[:] = np.random.default_rng(0).random((4, 6))
model.solveNeumann()
for kind, file in (
    (NumpyDumper, "numpys/run_0000.npz"),
    (H5Dumper, "hdf5/run_0000.h5"),
    (NetCDFDumper, "netcdf/run.nc"),
    (JSONDumper, "run.json"),
):
    dumper = kind(file) if kind is JSONDumper else kind("run", "traction", "displacement")
    dumper.dump(model)
    read = kind.read(file)
    kept = [np.array_equal(read[one], model[one]) for one in ("traction", "displacement")] + [list(read.system_size) == [2.0, 3.0]]
    read.solveNeumann()
    larger = np.ptp(read.displacement) / np.ptp(model.displacement)
    print(f"{kind.__name__}: fields and sizes kept {kept}, modulus {read.E}, ratio {read.nu}, displacements times {larger:.4f}")
    assert all(kept) and (read.E, read.nu) == (1.0, 0.0)
    np.testing.assert_allclose(larger, 3 / (1 - 0.2**2), rtol=1e-9)
END
