#!/usr/bin/env bash
# Digital Surf (.sur): maps in single precision that rosettasciio 0.15.0 writes.
#
# Guess: heights come back within the steps of the file, for all types of numbers.
# Seen: so they do from double precision and whole numbers. From single precision the highest point becomes the lowest, a peak a pit, in every
# reader and with both of is_special: the largest of 32-bit numbers is not one of single precision, which rounds it up by one, and it
# turns round to the least. The rest is right; rms heights of rough maps change little. Convert to double precision before writing.
set -euo pipefail
source "$(dirname "$0")/packages.sh" rosettasciio==0.15.0 surfalize==0.19.2 SurfaceTopography==1.27.1
python - <<'END' 2>log || { cat log; exit 1; }
import numpy as np
import surfalize
import SurfaceTopography
from rsciio.digitalsurf import file_reader, file_writer

heights = np.array([[0.5, 1.0, 0.0, 2.0], [3.0, -1.0, 0.25, 7.0], [1.0, 2.0, 3.0, 4.0]])  # µm
for kind in (np.float64, np.float32):
    for special in (False, True):
        axes = [
            {"name": name, "navigate": False, "units": "µm", "scale": 1.0, "offset": 0.0, "size": size, "index_in_array": i}
            for i, (name, size) in enumerate(zip("YX", heights.shape))
        ]
        metadata = {"General": {}, "Signal": {"quantity": "Height (µm)"}}
        signal = {"data": heights.astype(kind), "axes": axes, "metadata": metadata, "original_metadata": {}}
        file_writer("map.sur", signal, is_special=special, compressed=False)
        found = {
            "rosettasciio": file_reader("map.sur")[0]["data"],
            "surfalize": surfalize.Surface.load("map.sur").data,
            "SurfaceTopography": np.asarray(SurfaceTopography.read_topography("map.sur").heights()).T,
        }
        for name, data in found.items():
            data = data - data[0, 0] + heights[0, 0]  # the levels differ, see sur_offset.sh
            print(kind.__name__, f"is_special={special}", name, "highest point", round(float(data[1, 3]), 6), "of", heights[1, 3])
            true = heights.copy()
            if kind == np.float32:
                true[1, 3] = heights.min()
            np.testing.assert_allclose(data, true, atol=1e-6)
END
