#!/usr/bin/env bash
# Tamaas, PolonskyKeerRey: contact area by its two forms, on pressures (the default) and on gaps.
#
# Guess: both give the same pressures, and the share of positive ones is the contact area.
# Seen: with gaps as unknowns pressures are positive, of 3e-6 of the largest, on all points but one: an area of
# 99.98 % in place of 2.64 %. The tolerance changes nothing, and the returned error is 1.6e-5 for a tolerance of
# 1e-12. There the points whose gap is 0 are those in contact.
set -euo pipefail
source "$(dirname "$0")/packages.sh" tamaas==2.9.0
python - <<'END'
import tamaas

tamaas.set_log_level(tamaas.LogLevel.error)
n = 64
spectrum = tamaas.Isopowerlaw2D()
spectrum.q0, spectrum.q1, spectrum.q2, spectrum.hurst = 2, 2, 16, 0.8
generator = tamaas.SurfaceGeneratorFilter2D([n, n])
generator.random_seed, generator.spectrum = 1, spectrum
heights = generator.buildSurface()
heights *= 0.1 / tamaas.Statistics2D.computeSpectralRMSSlope(heights)
form = tamaas.PolonskyKeerRey
areas = {}
for name, unknowns in (("pressures", form.pressure), ("gaps", form.gap)):
    for tolerance in (1e-6, 1e-12):
        model = tamaas.ModelFactory.createModel(tamaas.model_type.basic_2d, [1.0, 1.0], [n, n])
        model.E, model.nu = 1.0, 0.0
        error = form(model, heights, tolerance, unknowns, form.pressure).solve(1e-3)
        positive, closed = (model.traction > 0).mean(), (model["gap"] == 0).mean()
        print(name, "tolerance", tolerance, "error", error, "pressure > 0:", positive, "gap = 0:", closed)
        areas[name] = positive, closed
        assert (error < tolerance) == (name == "pressures")
assert areas["pressures"][0] == areas["gaps"][1] == 108 / 4096
assert areas["gaps"][0] == 4095 / 4096
END
