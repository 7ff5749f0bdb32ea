#!/bin/bash
# Text with sides and a matrix of heights, one of which is missing and marked by '---'.
#
# Guess: the height is missing, as with 'nan' and 'BAD', or the file is refused.
# Instead: SurfaceTopography leaves out the whole row and stretches the others over the same sides, without
# a word; so it does with 1.#QNAN, which libraries of C write for no number.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check SurfaceTopography==1.27.1
cd "$folder"
venv/bin/python - <<'END'
from importlib.metadata import version

import numpy as np
import SurfaceTopography

print("SurfaceTopography", version("SurfaceTopography"))
for word, grid, missing in (("nan", (4, 6), 1), ("BAD", (4, 6), 1), ("---", (4, 5), 0), ("1.#QNAN", (4, 5), 0)):
    rows = [[str(4 * j + i) for i in range(4)] for j in range(6)]
    rows[2][1] = word
    lines = ["# Channel: Height", "# Width: 8 µm", "# Height: 12 µm", "# Value units: nm"]
    open("map.txt", "w", encoding="utf-8").write("\n".join([*lines, *map(" ".join, rows), ""]))
    topography = SurfaceTopography.read_topography("map.txt")
    masked = int(np.ma.count_masked(topography.heights()))
    print(f"{word:8}", topography.nb_grid_pts, "heights on", topography.physical_sizes, masked, "missing")
    assert topography.nb_grid_pts == grid and masked == missing
    np.testing.assert_allclose(topography.physical_sizes, (8e3, 12e3))
END
