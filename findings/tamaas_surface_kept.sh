#!/usr/bin/env bash
# Tamaas, PolonskyKeerRey: an array of heights that changes after it was given.
#
# Guess: the solver has a copy, so that one array can be scaled for the next of several solvers.
# Seen: it keeps the array itself. Heights that are scaled by 3 between construction and solution give the contact
# of the scaled surface, without a word.
set -euo pipefail
source "$(dirname "$0")/packages.sh" tamaas==2.9.0
python - <<'END'
import numpy as np
import tamaas

tamaas.set_log_level(tamaas.LogLevel.error)
n = 32
x = (np.arange(n) + 0.5) / n - 0.5


def area(scale_before, scale_after):
    heights = scale_before * -(x[:, None] ** 2 + x**2) / 2
    model = tamaas.ModelFactory.createModel(tamaas.model_type.basic_2d, [1.0, 1.0], [n, n])
    model.E, model.nu = 1.0, 0.0
    solver = tamaas.PolonskyKeerRey(model, heights, 1e-10)
    heights *= scale_after
    solver.solve(1e-2)
    return (model.traction > 0).mean()


once, scaled, later = area(1.0, 1.0), area(3.0, 1.0), area(1.0, 3.0)
print("contact area", once, "of heights × 3", scaled, "scaled after construction", later)
assert once != scaled and later == scaled
END
