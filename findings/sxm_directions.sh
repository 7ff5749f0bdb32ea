#!/usr/bin/env bash
# Nanonis (.sxm): scans upwards and downwards, traces and retraces.
#
# Guess: both readers have one picture of one surface: the same first row whichever way it was scanned, and retraces over traces.
# Seen: the file keeps heights in the order of scanning. Gwyddion puts the last line of a scan upwards first, and turns retraces round;
# pySPM does neither: rows of scans upwards are in reverse order, and retraces run from right to left, so that differences of
# the two directions (friction, creep) compare opposite ends of a line. SCAN_DIR in the header says which way.
set -euo pipefail
source "$(dirname "$0")/packages.sh" gwyddionpy==0.1.0 gwyddionpy-converter==0.1.0 scikit-image==0.26.0 scikit-learn==1.9.1 \
    pandas==3.1.1 matplotlib==3.11.2 psutil==5.9.8 tqdm==4.70.1
pip install -qq --no-compile --disable-pip-version-check --no-deps --only-binary=:all: pySPM==0.6.3 # the rest is for its shell and plots
python - 2>log <<'END' || { cat log; exit 1; }
import gwyddionpy
import numpy as np
import pySPM

SURFACE = 1e-9 * np.arange(12.0).reshape(3, 4)  # first row at the top [m]


def write(upwards):
    """Write trace and retrace of SURFACE as the instrument records them."""
    rows = SURFACE[::-1] if upwards else SURFACE
    fields = {
        "NANONIS_VERSION": "2", "SCANIT_TYPE": "FLOAT MSBFIRST", "REC_DATE": "02.03.2026", "REC_TIME": "10:00:00",
        "REC_TEMP": "290.0", "ACQ_TIME": "10.0", "SCAN_PIXELS": "4 3", "SCAN_FILE": "map.sxm", "SCAN_TIME": "1.0 1.0",
        "SCAN_RANGE": "4.0E-6 3.0E-6", "SCAN_OFFSET": "0.0 0.0", "SCAN_ANGLE": "0.0", "SCAN_DIR": "up" if upwards else "down",
        "BIAS": "0.0", "Z-CONTROLLER": "\tName\ton\tSetpoint\n\tlog Current\t1\t1.0E-10 A", "COMMENT": "",
        "DATA_INFO": "\tChannel\tName\tUnit\tDirection\tCalibration\tOffset\n\t14\tZ\tm\tboth\t1.0\t0.0\n",
    }  # fmt: skip
    text = "".join(f":{key}:\n{value}\n" for key, value in fields.items()) + ":SCANIT_END:\n\n\n"
    with open("map.sxm", "wb") as file:
        file.write(text.encode() + b"\x1a\x04" + rows.astype(">f4").tobytes() + rows[:, ::-1].astype(">f4").tobytes())


for upwards in (False, True):
    write(upwards)
    channels = gwyddionpy.load("map.sxm").channels
    for direction in ("forward", "backward"):
        (other,) = (np.asarray(one.data) for name, one in channels.items() if direction in str(name).lower())
        found = pySPM.SXM("map.sxm").get_channel("Z", direction).pixels
        print("upwards" if upwards else "downwards", direction, "first row [nm]: Gwyddion", 1e9 * other[0], "pySPM", 1e9 * found[0])
        true = SURFACE[::-1] if upwards else SURFACE
        np.testing.assert_allclose(other, SURFACE, rtol=1e-6)
        np.testing.assert_allclose(found, true[:, ::-1] if direction == "backward" else true, rtol=1e-6)
END
