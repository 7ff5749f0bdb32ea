#!/usr/bin/env bash
# rfgen, the random fields that come with aspher: rms_quantities of a wave, whose amplitude is 1.
#
# Guess: heights of 0.707 rms whatever the spacing of the points, slopes that go with its inverse.
# Seen: they are divided by the length of a side: 0.707 where the side is 1, 0.00276 at a spacing of 1 on 256 points, its default; slopes and
# curvatures likewise. The one rms_slope of a surface is that of a profile, 0.71 of its rms gradient. m11 of compute_standard_moments,
# "cross-correlation of slopes", takes wave numbers without their sign: oblique waves one way or the other have the same.
set -euo pipefail
source "$(dirname "$0")/packages.sh" rfgen==0.2.3 scipy==1.17.1
python - <<'END'
import numpy as np
import rfgen

n = 256
at = 2 * np.pi * 8 * np.arange(n) / n
wave = np.cos(at)[:, None] * np.ones(n)
for spacing, seen in ((1 / n, 2**-0.5), (1.0, 2**-0.5 / n)):
    found = rfgen.rms_quantities(wave, spacing)
    slope = 2 * np.pi * 8 / (n * spacing) * 2**-0.5
    print(f"spacing {spacing}: rms height {found['rms_height']:.5f}, gradient {found['rms_slope']:.5g} in place of {slope:.5g}")
    np.testing.assert_allclose(found["rms_height"], seen, rtol=1e-6)
    np.testing.assert_allclose(found["rms_slope"], slope / (n * spacing) / 2**0.5, rtol=1e-6)
for sign in (1, -1):
    oblique = np.cos(at[:, None] + sign * at)
    m11 = rfgen.compute_standard_moments(oblique, 1 / n)["m11"]
    exact = np.mean(np.sin(at[:, None] + sign * at) ** 2) * sign * (2 * np.pi * 8) ** 2
    print(f"oblique wave: m11 {m11:.1f}, mean product of slopes {exact:.1f}")
    np.testing.assert_allclose(m11, abs(exact), rtol=1e-6)
END
