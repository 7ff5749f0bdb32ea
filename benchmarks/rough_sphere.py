"""The rough sphere of Greenwood & Tripp 1967 on finite elements, over roughness and mesh.

`.venv/bin/python benchmarks/rough_sphere.py` prints the errors that `docs/accuracy.md` sums
up; it takes two minutes.
"""

import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from helpers.rough_sphere_on_block import forces_on_strips
from helpers.rough_sphere_oracle import gaussian, rough_sphere

HEIGHTS = gaussian()
MESHES = (15, 25, 35)

heads = [f"{cells} cells: pressure, radius" for cells in MESHES]
print(f"| μ | α | a\\*/a₀ | p(0)/p₀ | {' | '.join(heads)} |")
print("|---" * (4 + len(heads)) + "|")
for mu in (4.0, 17.0):
    for alpha in (0.05, 0.5, 5.0):
        exact = rough_sphere(mu, alpha, HEIGHTS)
        row = [f"{mu:g}", f"{alpha:g}", f"{exact.radius:.3f}", f"{exact.peak:.3f}"]
        for cells in MESHES:
            began = time.perf_counter()
            found, rings = forces_on_strips(mu, alpha, HEIGHTS, cells=cells, beyond=2.5)
            wide, narrow = (line.sum() / line[cells // 2] for line in (found, rings))
            pressure = np.abs(found - rings).max() / rings.max()
            row.append(f"{pressure:.1%}, {wide / narrow - 1.0:+.1%}")
            print(f"{time.perf_counter() - began:.1f} s", file=sys.stderr)
        print(f"| {' | '.join(row)} |", flush=True)
