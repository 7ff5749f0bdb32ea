#!/usr/bin/env bash
# Tamaas, MaxwellViscoelastic: a wave pressed flat and held, with one Maxwell branch beside the model's own spring.
#
# Guess: the pressures relax to those of the spring, those of an elastic model of that modulus, however long the steps are.
# Seen: the first step is right (backward Euler), the others are not: pressures fall to 0.608, 0.667, 0.867 of the elastic
# ones with steps of 0.1, 1, 10 relaxation times, and stay there. A wavy contact under a constant load ends with 28 % more
# area than the elastic one has. One step of a thousand times has the relaxed contact, one of a thousandth the sudden one.
set -euo pipefail
source "$(dirname "$0")/packages.sh" tamaas==2.9.0 scipy==1.17.1
python - <<'EOF'
import numpy as np
import tamaas as tm

tm.set_log_level(tm.LogLevel.error)
n = 32
x = np.linspace(0, 1, n, endpoint=False)


def model():
    made = tm.ModelFactory.createModel(tm.model_type.basic_2d, [1.0, 1.0], [n, n])
    made.E, made.nu = 1.0, 0.0
    return made


wave = 0.001 * np.cos(2 * np.pi * x)[:, None] * np.ones(n)
for step, count, last in ((0.1, 400, 0.60784), (1.0, 40, 0.66667), (10.0, 10, 0.86667)):
    held, found = model(), []
    solver = tm.MaxwellViscoelastic(held, wave, 1e-12, step, [1.0], [1.0])
    for _ in range(count):
        solver.solve(0.1)  # full contact, so that the amplitude is pi E h of a spring of modulus E
        found.append(np.ptp(held.traction) / 2 / (np.pi * 0.001))
    euler = 1 + 2 / (1 + step) ** np.arange(1, count + 1)
    print(f"steps of {step}: {np.round(found[:4], 4)} ... {found[-1]:.5f}, backward Euler {np.round(euler[:4], 4)} ... {euler[-1]:.5f}")
    assert np.isclose(found[0], euler[0], rtol=1e-6) and np.isclose(found[-1], last, rtol=1e-4)
waves = 0.01 * (np.cos(2 * np.pi * x)[:, None] + np.cos(2 * np.pi * x)[None])
elastic = model()
tm.PolonskyKeerRey(elastic, waves, 1e-12).solve(1e-3)
area = (elastic.traction > 0).mean()
for step, count, ratio in ((0.1, 400, 1.3), (1000.0, 1, 1.0)):
    held = model()
    solver = tm.MaxwellViscoelastic(held, waves, 1e-12, step, [1.0], [1.0])
    for _ in range(count):
        solver.solve(1e-3)
    found = (held.traction > 0).mean()
    print(f"contact area after {count} steps of {step}: {found:.4f}, elastic {area:.4f}")
    assert abs(found / area - ratio) < 0.08, found / area
EOF
