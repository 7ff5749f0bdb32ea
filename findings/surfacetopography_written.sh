#!/usr/bin/env bash
# SurfaceTopography 1.27.1: maps that it writes, to_x3p and to_netcdf, and reads again.
#
# Guess: a map comes back with the sizes, the unit (or none) and the period that it had, heights in the same precision.
# Seen: a map without a unit is one in metres in .x3p, without a word; there a periodic map is no longer one. In .nc heights are in double and lengths
# in single precision: 1.7 comes back as 1.7000000476837158; unit and period are kept. Say the unit before you write .x3p.
set -euo pipefail
source "$(dirname "$0")/packages.sh" SurfaceTopography==1.27.1 scipy==1.17.1
python - <<'END'
import numpy as np
from SurfaceTopography import Topography, read_topography

heights = np.random.default_rng(0).standard_normal((17, 23))
sizes = 1.7, 4.6
for unit in (None, "um"):
    for write, suffix in (("to_x3p", "x3p"), ("to_netcdf", "nc")):
        getattr(Topography(heights, sizes, unit=unit, periodic=True), write)(f"map.{suffix}")
        back = read_topography(f"map.{suffix}")
        scale = 1e-6 if (unit, suffix) == ("um", "x3p") else 1.0
        lengths = [float(length) for length in back.physical_sizes]
        print(f"unit {unit}, .{suffix}: lengths {lengths}, unit {back.unit}, periodic {back.is_periodic}")
        np.testing.assert_allclose(back.heights(), heights * scale, rtol=1e-12)
        np.testing.assert_allclose(lengths, np.multiply(sizes, scale), rtol=1e-7)
        assert back.is_periodic == (suffix == "nc")
        if suffix == "nc":
            assert back.unit == (unit and "µm") and lengths == [float(np.float32(size)) for size in sizes]
        else:
            assert back.unit == "m"
END
