#!/usr/bin/env bash
# Tamaas: spectral moments and slopes of one surface.
#
# Guess: m2 of Statistics2D.computeMoments is the mean square slope of profiles, half the square of
# computeSpectralRMSSlope, both for sides of 1; likewise moments() and rmsSlopes() of a spectrum.
# Seen: slopes are for sides of 1, moments count waves per side without 2 pi: of a wave of 4 periods m2 is 4 in place of
# 158, m4 is 42.7 in place of 66,500. Multiply by (2 pi)^2 and (2 pi)^4; m0 m4 / m2^2 is right as it is.
set -euo pipefail
source "$(dirname "$0")/packages.sh" tamaas==2.9.0
python - <<'END'
import numpy as np
import tamaas

tamaas.set_log_level(tamaas.LogLevel.error)
n, turn = 64, 2 * np.pi
heights = np.cos(turn * 4 * np.arange(n) / n)[:, None] * np.ones(n)
statistics = tamaas.Statistics2D
m0, m2, m4 = statistics.computeMoments(heights)
slope = statistics.computeSpectralRMSSlope(heights)
print("m0, m2, m4", m0, m2, m4, "mean square slope / 2", slope**2 / 2)
assert np.allclose([m0, m2, m4, slope**2 / 2], [0.5, 4.0, 128 / 3, turn**2 * 4.0])
spectrum = tamaas.Isopowerlaw2D()
spectrum.q0, spectrum.q1, spectrum.q2, spectrum.hurst = 4, 4, 16, 0.8
print("spectrum: m2", spectrum.moments()[1], "mean square slope / 2", spectrum.rmsSlopes() ** 2 / 2)
assert abs(spectrum.rmsSlopes() ** 2 / 2 / spectrum.moments()[1] - turn**2) < 1e-6 * turn**2
END
