#!/usr/bin/env bash
# gstools 1.7.0 and scikit-gstat 1.0.26: the correlation length of a Gaussian surface.
#
# Guess: correlations fall to 1/e over that length, as in exp(-(r / β)²) of surfaces that tribologists draw; one map has one length.
# Seen: "len_scale" of gstools' Gaussian is β √π / 2, the integral of correlations: over it they fall to 0.456, rms slopes are 0.89 of those of
# a surface with β = len_scale. The range of scikit-gstat is 2 β, where 2 % are left. Of exponential correlations 1 and 3 times the 1/e
# length. Give gstools len_scale = β √π / 2, or rescale=1; halve the range of scikit-gstat.
set -euo pipefail
source "$(dirname "$0")/packages.sh" gstools==1.7.0 scikit-gstat==1.0.26
python - <<'END' 2>log || { cat log; exit 1; }
import gstools
import numpy as np
import skgstat

BETA, RMS = 4.0, 2.0  # µm
for model, left, factor in (
    (gstools.Gaussian, np.exp(-np.pi / 4), np.sqrt(np.pi) / 2),
    (gstools.Exponential, np.exp(-1.0), 1.0),
):
    given = model(dim=2, var=RMS**2, len_scale=BETA)
    right = model(dim=2, var=RMS**2, len_scale=factor * BETA)
    print(f"{model.__name__}, len_scale {BETA}: left over it {given.correlation(BETA):.4f}, 1/e is {np.exp(-1):.4f}")
    assert np.isclose(given.correlation(BETA), left, rtol=1e-9) and np.isclose(right.correlation(BETA), np.exp(-1), rtol=1e-9)
assert np.isclose(gstools.Gaussian(dim=2, len_scale=BETA, rescale=1.0).correlation(BETA), np.exp(-1), rtol=1e-9)

x = np.arange(0, 192, 0.5)
slopes = []
for scale in (BETA, np.sqrt(np.pi) / 2 * BETA):
    heights = gstools.SRF(gstools.Gaussian(dim=2, var=RMS**2, len_scale=scale), seed=1).structured([x, x])
    slopes.append(float(np.sqrt(np.mean((np.diff(heights, axis=0) / 0.5) ** 2))))
print(f"rms slope along x with len_scale = β: {slopes[0]:.3f}, β √π / 2: {slopes[1]:.3f}, expected of β: {np.sqrt(2) * RMS / BETA:.3f}")
np.testing.assert_allclose(slopes, np.array([np.sqrt(np.pi) / 2, 1]) * np.sqrt(2) * RMS / BETA, rtol=0.05)

for name, points in (("gaussian", 2), ("exponential", 3)):  # the range over the 1/e length
    r = np.linspace(0.5, 25, 50)
    found = getattr(skgstat.models, name)(r, points * BETA, RMS**2)
    true = RMS**2 * (1 - np.exp(-((r / BETA) ** (2 if points == 2 else 1))))
    print(f"scikit-gstat, {name}: its range is {points} times the 1/e length")
    np.testing.assert_allclose(found, true, rtol=1e-9)
places = np.random.default_rng(1).integers(0, 192, (600, 2)) / 2.0
values = heights[tuple((2 * places).astype(int).T)]
fitted = skgstat.Variogram(places, values, model="gaussian", n_lags=25, maxlag=15.0).parameters[0]
print(f"scikit-gstat, range fitted to that map: {fitted:.2f}, β is {BETA}")
assert abs(fitted / (2 * BETA) - 1) < 0.15
END
