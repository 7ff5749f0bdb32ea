#!/usr/bin/env bash
# Nanosurf (.nid): which line of the scan is the first row.
#
# Guess: the maker's package and other readers return the same rows.
# Seen: NSFopen returns lines as they were scanned, from the bottom; SurfaceTopography and Gwyddion begin with the
# last, at the top. One array is the other one upside down: a mirror image, which tilts, textures and mating
# surfaces see.
set -euo pipefail
source "$(dirname "$0")/packages.sh" NSFopen==2.2.4 SurfaceTopography==1.27.1 gwyddionpy==0.1.0 gwyddionpy-converter==0.1.0
python - <<'END'
import gwyddionpy
import numpy as np
import SurfaceTopography
from NSFopen.read import read

parts = {
    "DataSet": {"Version": 2, "GroupCount": 1, "Gr0-Name": "Scan forward", "Gr0-ID": 0, "Gr0-Count": 1},
    "DataSet-Info": {"Date": "01-02-2026", "Time": "03:04:05"},
    "DataSet-0:0": {"Version": 2, "Points": 4, "Lines": 3, "Frame": "Scan forward", "CurLine": 2},
}
parts["DataSet"]["Gr0-Ch0"] = "DataSet-0:0"
for axis, name, least, whole in ((0, "X*", 0, 8e-6), (1, "Y*", 0, 6e-6), (2, "Topography", -1e-6, 2e-6)):
    of = {"Name": name, "Unit": "m", "Min": least, "Range": whole}
    parts["DataSet-0:0"] |= {f"Dim{axis}{key}": value for key, value in of.items()}
parts["DataSet-0:0"] |= {"SaveMode": "Binary", "SaveBits": 16, "SaveSign": "Signed", "SaveOrder": "Intel"}
text = "".join(f"[{part}]\r\n" + "".join(f"{k}={v}\r\n" for k, v in keys.items()) + "\r\n" for part, keys in parts.items())
numbers = 1000 * np.arange(12, dtype="<i2").reshape(3, 4)
open("map.nid", "wb").write(text.encode() + b"\r\n#!" + numbers.tobytes())
scanned = numbers * 2e-6 / 65536
maker = np.array(read("map.nid", verbose=False).data["Image"]["Forward"]["Topography"])
topography = SurfaceTopography.read_topography("map.nid").heights().T
gwyddion = next(iter(gwyddionpy.load("map.nid").channels.values())).data
for name, rows, expected in (("NSFopen", maker, scanned), ("SurfaceTopography", topography, scanned[::-1]), ("Gwyddion", gwyddion, scanned[::-1])):
    print(name, "first row [nm]", (1e9 * rows[0]).round(1).tolist())
    np.testing.assert_allclose(rows, expected, atol=1e-12)
END
