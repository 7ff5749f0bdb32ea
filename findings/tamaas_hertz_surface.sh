#!/usr/bin/env bash
# Tamaas: tamaas.utils.hertz_surface, the sphere for Hertz' contact, on 32 x 64 points.
#
# Guess: an array of (32, 64) heights; a solver refuses one of another shape.
# Seen: an array of (64, 32, 1), x and y exchanged. The solver takes it, as the number of points is right, in their order
# in memory: the "sphere" is a row of strips, with 1.4 times Hertz' largest pressure. On 64 x 64 points all is well.
set -euo pipefail
source "$(dirname "$0")/packages.sh" tamaas==2.9.0
python - <<'END'
import numpy as np
import tamaas
from tamaas.utils import hertz_surface

tamaas.set_log_level(tamaas.LogLevel.error)
load = 1e-3  # radius 1, contact modulus 1
hertz = (6 * load / np.pi**3) ** (1 / 3)
for (nx, ny), sides, own in (((64, 64), (1.0, 1.0), True), ((32, 64), (1.0, 2.0), True), ((32, 64), (1.0, 2.0), False)):
    heights = hertz_surface(sides, (nx, ny), 1.0)
    assert heights.shape == (ny, nx, 1)
    if not own:
        heights = np.ascontiguousarray(heights[..., 0].T)
    model = tamaas.ModelFactory.createModel(tamaas.model_type.basic_2d, list(sides), [nx, ny])
    model.E, model.nu = 1.0, 0.0
    tamaas.PolonskyKeerRey(model, heights, 1e-10).solve(load / np.prod(sides))
    touching = np.argwhere(model.traction > 0)
    widest = np.ptp(touching, axis=0) * np.array(sides) / (nx, ny)
    print(heights.shape, "largest pressure / Hertz'", model.traction.max() / hertz, "extent of contact", widest)
    wrong = own and nx != ny
    assert (abs(model.traction.max() / hertz - 1) < 0.05) != wrong
    assert (abs(widest[0] - widest[1]) < 1e-9) != wrong
END
