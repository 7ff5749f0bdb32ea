#!/usr/bin/env bash
# surfalize 0.19.2: Sk, Spk and Svk (ISO 25178-2) of waves z = cos(kx), whose summits and valleys are alike, and of a Gaussian surface.
#
# Guess: Spk and Svk are equal, and exchanged where the map is turned over.
# Seen: of waves one is 0 and the other 0.3 to 0.5 amplitudes: of 8 waves on 256 points Svk is 0, of 5 waves Spk. The Abbott curve of waves is
# flattest at both ends, and the 40 % of it that the standard draws its line through lie at one of them, by chance. Of a Gaussian surface both agree to a few per cent. Sk itself is right, 1.7 amplitudes.
set -euo pipefail
source "$(dirname "$0")/packages.sh" surfalize==0.19.2 scipy==1.17.1
python - <<'END' 2>log || { cat log; exit 1; }
import numpy as np
from surfalize import Surface

n = 256
eight, five = (np.cos(2 * np.pi * count * np.arange(n) / n)[:, None] * np.ones(n) for count in (8, 5))
q = 2 * np.pi * np.fft.fftfreq(n)
white = np.random.default_rng(0).standard_normal((n, n))
gaussian = np.fft.ifft2(np.fft.fft2(white) * np.exp(-4 * (q[:, None] ** 2 + q**2))).real
gaussian /= gaussian.std()


def found(name, heights):
    surface = Surface(heights, 1.0, 1.0)
    values = [float(getattr(surface, parameter)()) for parameter in ("Sk", "Spk", "Svk")]
    print(f"{name}: Sk {values[0]:.4f}, Spk {values[1]:.4f}, Svk {values[2]:.4f}, skewness {float(surface.Ssk()):+.4f}")
    return values


flattest = (1 - np.cos(0.4 * np.pi)) / 0.4  # the slope of the Abbott curve cos(pi p) across 40 % at either end
pairs = [found("8 waves", eight), found("8 waves, turned over", -eight), found("5 waves", five)]
print(f"Sk of the curve cos(pi p): {flattest:.4f}")
for (sk, spk, svk), summits in zip(pairs, (True, False, False), strict=True):
    assert abs(sk / flattest - 1) < 0.05 and min(spk, svk) == 0 and 0.3 < max(spk, svk) < 0.5
    assert (spk > svk) == summits
_, spk, svk = found("Gaussian", gaussian)
assert abs(spk / svk - 1) < 0.1
END
