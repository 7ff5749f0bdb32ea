#!/usr/bin/env bash
# Zygo Mx (.datx, HDF5): heights in fringes, and the first line.
#
# Guess: heights in fringes become lengths, or are refused; two readers begin with the same line.
# Seen: where the unit is Fringes SurfaceTopography's reader of the format gives up and its reader of any HDF5 file takes
# over: bare fringes, x and y exchanged, no missing heights (1e10 stands there), no sides, which it asks for. prysm
# makes nm of them. Heights in nm are read by both, but prysm returns the last line first, in its reader of Zygo's older .dat
# the first.
set -euo pipefail
source "$(dirname "$0")/packages.sh" SurfaceTopography==1.27.1 prysm==0.19.1 h5py==3.14.0 scipy==1.17.1
python - <<'END'
import h5py
import numpy as np
import SurfaceTopography
from prysm.io import read_zygo_datx

heights = np.array([[0.5, 1.0, 0.0, 0.25], [1e10, -0.5, 2.0, 0.75], [3.0, 1.5, -1.0, 0.125]])
converter = np.dtype([("Category", "S32"), ("BaseUnit", "S32"), ("Parameters", "f8", (4,))])
entry = np.dtype([("Source", "S64"), ("Link", "S64"), ("Destination", "S64")])


def write(name, unit):
    """Write one map: points 2 um apart, wavelength 600 nm, interferometric scale 1/2."""
    with h5py.File(name, "w") as file:
        data = file.create_dataset("Data/Surface/map", data=heights)
        data.attrs["Unit"], data.attrs["No Data"] = np.array([unit.encode()]), [1e10]
        data.attrs["Wavelength"], data.attrs["Obliquity Factor"] = [600e-9], [1.0]
        data.attrs["Interferometric Scale Factor"] = [0.5]
        for axis in "XY":
            steps = [(b"LateralCat", b"Pixels", [0, 2e-6, 0, 0])]
            data.attrs[f"{axis} Converter"] = np.array(steps, dtype=converter)
        lengths = [(b"HeightCat", unit.encode(), [0, 600e-9, 0.5, 1.0])]
        data.attrs["Z Converter"] = np.array(lengths, dtype=converter)
        file.create_group("Attributes/all").attrs["Data Context.Lateral Resolution:Value"] = [2e-6]
        links = [(b"Root", b"Measurement", b"{M}"), (b"{M}", b"Surface", b"{S}"), (b"{S}", b"Path", b"/Data/Surface/map")]
        file["MetaData"] = np.array(links, dtype=entry)


missing = np.where(heights > 1e9, np.nan, heights)
write("nm.datx", "NanoMeters")
nm = SurfaceTopography.read_topography("nm.datx")
other = read_zygo_datx("nm.datx")["phase"]
print("nm, SurfaceTopography", nm.unit, np.ma.filled(nm.heights().T, np.nan).tolist())
print("nm, prysm", other.tolist())
assert np.array_equal(np.ma.filled(nm.heights().T, np.nan), missing, equal_nan=True)
assert np.array_equal(other, missing[::-1], equal_nan=True)
write("fringes.datx", "Fringes")
with SurfaceTopography.open_topography("fringes.datx") as reader:
    channel = reader.default_channel
    fringes = channel.topography(physical_sizes=(8.0, 6.0)).heights()
    print("fringes, SurfaceTopography", reader.format(), channel.physical_sizes, channel.unit, np.asarray(fringes).tolist())
    assert reader.format() == "h5" and channel.physical_sizes is None and channel.unit is None
    assert fringes.shape == (3, 4) and not np.ma.is_masked(fringes) and np.array_equal(fringes, heights)
other = read_zygo_datx("fringes.datx")["phase"]
print("fringes, prysm [nm]", other.tolist())
assert np.allclose(other, 300 * missing[::-1], equal_nan=True)
END
