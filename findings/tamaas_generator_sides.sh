#!/usr/bin/env bash
# Tamaas: a random surface on a rectangle, 64 x 256 points of square cells.
#
# Guess: an isotropic spectrum (Isopowerlaw2D) gives isotropic roughness.
# Seen: its wave numbers count waves per side, whichever side: roughness is stretched with the rectangle, slopes along the
# short side are 4 times those along the long one. Generate a square and cut it.
set -euo pipefail
source "$(dirname "$0")/packages.sh" tamaas==2.9.0
python - <<'END'
import numpy as np
import tamaas

tamaas.set_log_level(tamaas.LogLevel.error)
for form in (tamaas.SurfaceGeneratorFilter2D, tamaas.SurfaceGeneratorRandomPhase2D):
    for shape, ratio in (([64, 64], 1.0), ([64, 256], 4.0)):
        spectrum = tamaas.Isopowerlaw2D()
        spectrum.q0, spectrum.q1, spectrum.q2, spectrum.hurst = 4, 4, 16, 0.8
        generator = form(shape)
        generator.random_seed, generator.spectrum = 3, spectrum
        heights = generator.buildSurface()
        slopes = [np.diff(heights, axis=axis).std() for axis in (0, 1)]
        print(form.__name__, shape, "rms step to the next point along x", slopes[0], "along y", slopes[1])
        assert abs(slopes[0] / slopes[1] - ratio) < 0.15 * ratio
END
