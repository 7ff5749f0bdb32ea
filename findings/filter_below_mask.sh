#!/usr/bin/env bash
# SurfaceTopography: filters of maps with missing heights.
#
# Guess: what lies below a mask changes no result; where missing heights are not allowed, an error says so.
# Seen: shortcut and longcut filter the numbers below the mask as heights, without a word: 0 or 1000 in three of 1024 points
# move all others by 2.9. mirror_stitch returns these numbers as measured. Power spectra and derivatives refuse masks,
# rms heights, slopes and detrending leave masked points out. Fill missing heights first.
set -euo pipefail
source "$(dirname "$0")/packages.sh" SurfaceTopography==1.27.1
python - <<'END'
import numpy as np
from SurfaceTopography import Topography
from SurfaceTopography.Exceptions import UndefinedDataError

n = 32
wave = np.cos(2 * np.pi * np.arange(n) / n)
mask = np.zeros((n, n), bool)
mask[[10, 20, 5], [12, 3, 5]] = True


def surface(below, periodic=True):
    return Topography(np.ma.masked_array(np.where(mask, below, wave[:, None] * wave), mask), (1.0, 1.0), periodic=periodic)


filters = {"shortcut": lambda one: one.shortcut(0.1), "longcut": lambda one: one.longcut(0.5)}
filters |= {"detrend": lambda one: one.detrend("slope"), "mirror_stitch": lambda one: one.mirror_stitch()}
for name, seen in (("shortcut", True), ("longcut", True), ("detrend", False), ("mirror_stitch", False)):
    results = [filters[name](surface(below, periodic=name != "mirror_stitch")).heights() for below in (0, 1000)]
    kept = [np.ma.masked_array(np.ma.getdata(one)[:n, :n], mask) for one in results]
    change, lost = np.abs(kept[1] - kept[0]).max(), not np.ma.count_masked(results[0])
    print(f"{name}: others move by {change:.4g}; mask is {'lost' if lost else 'kept'}")
    assert (change > 1) == seen and lost == (name != "detrend")
assert surface(0).rms_gradient() == surface(1000).rms_gradient()
try:
    surface(0).power_spectrum_from_area()
except UndefinedDataError as error:
    print("power spectrum:", str(error)[:60])
else:
    raise SystemExit("changed: power spectra of missing heights")
END
