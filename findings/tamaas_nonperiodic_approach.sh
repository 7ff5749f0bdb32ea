#!/usr/bin/env bash
# Tamaas 2.9: a sphere on a half-space that is not periodic (operator "dcfft"), pressed by a given force.
#
# Guess: with the operator of a half-space that is held far away, the solver's displacements are those of its pressures; in the middle of
# the contact they are the approach, as Hertz has it.
# Seen: pressures are Hertz', but the displacements are those of heights plus gap, where the heights given are: 0 in the middle in place of
# the approach, 0.3 where the same sphere lies 0.3 higher. The operator applied to the pressures gives Hertz' approach; model.solveNeumann
# stays with the periodic one.
set -euo pipefail
source "$(dirname "$0")/packages.sh" tamaas==2.9.0 scipy==1.17.1
python - <<'END'
import numpy as np
import tamaas

tamaas.set_log_level(tamaas.LogLevel.error)
n, radius, force = 64, 2.0, 1e-3
x = (np.arange(n) - n / 2) / n
for level in (0.0, 0.3):
    sphere = level - np.add.outer(x**2, x**2) / (2 * radius)
    model = tamaas.ModelFactory.createModel(tamaas.model_type.basic_2d, [1.0, 1.0], [n, n])
    model.E, model.nu = 1.0, 0.3
    tamaas.ModelFactory.registerNonPeriodic(model, "dcfft")
    solver = tamaas.PolonskyKeerRey(model, sphere, 1e-12)
    solver.setIntegralOperator("dcfft")
    solver.solve(force)
    a = (3 * force * radius / (4 * model.E_star)) ** (1 / 3)
    true = np.zeros_like(model.displacement)
    model.operators["dcfft"](model.traction, true)
    given = model.displacement[n // 2, n // 2]
    shift = given - true[n // 2, n // 2]
    print(f"heights from {level}: displacement {given:.6f}, of its pressures {true.max():.6f}, Hertz {a**2 / radius:.6f}")
    np.testing.assert_allclose(model.traction.max(), 1.5 * force / (np.pi * a**2), rtol=5e-3)
    np.testing.assert_allclose(given, level, atol=1e-9)
    np.testing.assert_allclose(true.max(), a**2 / radius, rtol=1e-3)
    contact = model.traction > 0
    np.testing.assert_allclose((model.displacement - true)[contact], shift, atol=1e-9)
    model.solveNeumann()
    np.testing.assert_allclose(model.displacement.mean(), 0, atol=1e-12)
END
