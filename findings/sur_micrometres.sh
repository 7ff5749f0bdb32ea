#!/usr/bin/env bash
# Digital Surf (.sur): maps that surfalize writes, read by others.
#
# Guess: sides and heights come back with their unit, µm.
# Seen: the unit is 'Âµm' in SurfaceTopography and rosettasciio, which SurfaceTopography cannot convert to another
# ("Unknown unit"): surfalize writes the header in UTF-8 where the others read Latin-1. Its own reader and Gwyddion
# have µm. Written with encoding="latin-1" the unit is right everywhere.
set -euo pipefail
source "$(dirname "$0")/packages.sh" surfalize==0.19.2 SurfaceTopography==1.27.1 rosettasciio==0.15.0
python - <<'END'
import numpy as np
import surfalize
import SurfaceTopography
from rsciio.digitalsurf import file_reader

surface = surfalize.Surface(0.1 * np.arange(12.0).reshape(3, 4), 2.0, 3.0)
for encoding, unit in (("utf-8", "Âµm"), ("latin-1", "µm")):
    surface.save("map.sur", encoding=encoding)
    topography = SurfaceTopography.read_topography("map.sur")
    other = file_reader("map.sur")[0]["axes"][0]["units"]
    print(encoding, "SurfaceTopography", topography.unit, "rosettasciio", other)
    assert topography.unit == unit and other == unit
    try:
        print("sides", topography.to_unit("mm").physical_sizes, "mm")
        assert unit == "µm"
    except ValueError as error:
        print(error)
        assert "Unknown unit" in str(error) and unit != "µm"
END
