#!/usr/bin/env bash
# Tamaas, FloodFill.getClusters: contact spots at the borders of a map, as of a contact that is not periodic.
#
# Guess: spots on opposite borders are two, as to scipy.ndimage.label, or there is a word to say whether the map is periodic.
# Seen: maps are always periodic: two spots are one, four corners are one of four points, and of a strip across the map the ends have no
# perimeter, 16 edges in place of 20, from which the corrected contact area is made. A margin of one point without contact undoes it.
set -euo pipefail
source "$(dirname "$0")/packages.sh" tamaas==2.9.0 scipy==1.17.1
python - <<'END'
import numpy as np
import tamaas
from scipy import ndimage

n = 8
borders, corners, strip = np.zeros((3, n, n), bool)
borders[0, 3] = borders[-1, 3] = True
corners[::7, ::7] = True
strip[3:5] = True
for name, spots, seen in (
    ("opposite borders", borders, [(2, 6)]),
    ("four corners", corners, [(4, 8)]),
    ("strip", strip, [(16, 16)]),
):
    found = [(one.area, one.perimeter) for one in tamaas.FloodFill.getClusters(spots, False)]
    margin = [(one.area, one.perimeter) for one in tamaas.FloodFill.getClusters(np.pad(spots, 1), False)]
    print(f"{name}: areas and perimeters {found}, with a margin {margin}")
    assert found == seen and len(margin) == ndimage.label(spots)[1]
assert margin == [(16, 20)]
END
