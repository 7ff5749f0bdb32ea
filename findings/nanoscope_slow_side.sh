#!/usr/bin/env bash
# NanoScope (.spm): an oblong scan of 8 x 4 µm and 4 x 2 points, which "Scan Size: 8 4 um" states.
#
# Guess: points lie 2 µm apart both ways to both readers.
# Seen: so it is to Gwyddion. pySPM takes the second side times lines per points of a line, which shortens it once more:
# 2 µm for 4, points 1 µm apart, slopes along the slow side twice as steep. Its rows are those of Gwyddion
# from the bottom to the top. Square scans have the right sides.
set -euo pipefail
source "$(dirname "$0")/packages.sh" gwyddionpy==0.1.0 gwyddionpy-converter==0.1.0 scikit-image==0.26.0 scikit-learn==1.9.1 \
    pandas==3.1.1 matplotlib==3.11.2 psutil==5.9.8 tqdm==4.70.1
pip install -qq --no-compile --disable-pip-version-check --no-deps --only-binary=:all: pySPM==0.6.3 # the rest is for its shell and plots
python - 2>log <<'END' || { cat log; exit 1; }
import gwyddionpy
import numpy as np
import pySPM


def sides(nx, ny, size):
    """Write a scan, compare its heights in two readers, and return its sides [µm] in both."""
    counts = (np.arange(nx * ny).reshape(ny, nx) << 20).astype("<i4")
    image = ["*Ciao image list", "Data offset: 8192", f"Data length: {counts.nbytes}", "Bytes/pixel: 4", "Start context: OL"]
    image += ["Data type: AFM", "Note: ", "Plane fit: 0 0 0 0", "Frame direction: Up", f"Samps/line: {nx}"]
    image += [f"Number of lines: {ny}", f"Aspect Ratio: {nx // ny}:1", f"Scan Size: {size} um", "Line Direction: Trace"]
    image += [f"Valid data len X: {nx}", f"Valid data len Y: {ny}", '@2:Image Data: S [Height] "Height"']
    image += ["@Z magnify: C [2:Z scale] 1.0", "@2:Z scale: V [Sens. Zsens] (0.006713867 V/LSB) 440.0 V"]
    image += ["@2:Z offset: V [Sens. Zsens] (0.006713867 V/LSB) 0 V", "*File list end"]
    head = ["*File list", "Version: 0x09400202", "Date: 10:00:00 AM Mon Mar 02 2026", "Start context: OL", "Data length: 8192"]
    head += ["*Scanner list", "@Sens. Zsens: V 10.0 nm/V", "*Ciao scan list", f"Scan Size: {size} um", f"Samps/line: {nx}", f"Lines: {ny}"]
    text = "".join(f"\\{line}\r\n" for line in head + image).encode("latin-1") + b"\r\n\x1a"
    with open("scan.spm", "wb") as file:
        file.write(text.ljust(8192, b"\0") + counts.tobytes())
    two = next(iter(gwyddionpy.load("scan.spm").channels.values()))
    three = pySPM.Bruker("scan.spm").get_channel("Height")
    heights = 1e6 * two.data
    assert np.ptp(heights) > 0 and np.allclose(three.pixels[::-1] / 1e3, heights)
    real = three.size["real"]
    return [1e6 * two.xreal, 1e6 * two.yreal, real["x"], real["y"]]


for nx, ny, size, seen in ((4, 2, "8 4", [8, 4, 8, 2]), (4, 4, "8 8", [8, 8, 8, 8])):
    found = np.array(sides(nx, ny, size), float)
    print(f"{nx} x {ny} points: Gwyddion {found[:2]}, pySPM {found[2:]} µm")
    np.testing.assert_allclose(found, seen)
END
