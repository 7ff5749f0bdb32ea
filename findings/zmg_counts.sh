#!/usr/bin/env bash
# Zeta Instruments (.zmg): heights are whole numbers of 16 bits.
#
# Guess: two readers have the same heights.
# Seen: SurfaceTopography takes the numbers for 0 to 65535 (as Gwyddion's source says too), surfalize for -32768 to 32767:
# what is higher than half the range lies 65536 steps lower, so that the summits of a map that uses it are its deepest
# valleys, without a word.
set -euo pipefail
source "$(dirname "$0")/packages.sh" surfalize==0.19.2 SurfaceTopography==1.27.1 scipy==1.17.1
python - <<'END'
import struct

import numpy as np
import surfalize
import SurfaceTopography

counts = np.array([[100, 20000, 40000], [60000, 200, 300]])
header = b"Zeta-Instruments" + bytes(69) + struct.pack("<2I4x3f8xI", 3, 2, 1.0, 2.0, 0.01, 0) + bytes(84)
with open("map.zmg", "wb") as file:  # points 1 and 2 um apart, steps of 0.01 um
    file.write(header + counts.astype("<u2").tobytes())
one = SurfaceTopography.read_topography("map.zmg")
other = surfalize.Surface.load("map.zmg")
print("SurfaceTopography", one.heights().T.round(2).tolist(), one.unit)
print("surfalize", other.data.round(2).tolist(), "um")
assert np.allclose(one.heights().T, 0.01 * counts)
assert np.allclose(other.data, 0.01 * np.where(counts > 32767, counts - 65536, counts))
END
