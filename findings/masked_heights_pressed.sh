#!/usr/bin/env bash
# Missing heights, as SurfaceTopography returns them, pressed by Tamaas and by ContactMechanics.
#
# Guess: a masked array is refused, or its masked heights touch nothing.
# Seen: Tamaas takes no notice of the mask and presses what happens to lie below it: here a spike that was masked
# carries the whole load. ContactMechanics leaves masked points out of contact, which makes holes in the surface.
# Neither says anything. Fill missing heights before.
set -euo pipefail
source "$(dirname "$0")/packages.sh" tamaas==2.9.0 ContactMechanics==1.8.3 SurfaceTopography==1.27.1
python - <<'END' 2>warnings.log
import numpy as np
import tamaas
from ContactMechanics.Factory import make_system
from SurfaceTopography import Topography

n = 32
x = (np.arange(n) + 0.5) / n - 0.5
sphere = -(x[:, None] ** 2 + x**2) / 2  # radius 1, highest in the middle
spike, middle = (3, 3), (16, 16)
heights = np.ma.masked_array(sphere.copy(), mask=np.zeros((n, n), bool))
heights[spike] = 9.0
heights[spike], heights[middle] = np.ma.masked, np.ma.masked

tamaas.set_log_level(tamaas.LogLevel.error)
model = tamaas.ModelFactory.createModel(tamaas.model_type.basic_2d, [1.0, 1.0], [n, n])
model.E, model.nu = 1.0, 0.0
tamaas.PolonskyKeerRey(model, heights, 1e-10).solve(2e-3)
print("Tamaas: share of the load on the masked spike", model.traction[spike] / model.traction.sum())
assert np.isclose(model.traction[spike] / model.traction.sum(), 1.0)

system = make_system(young=1.0, surface=Topography(heights, (1.0, 1.0)), substrate="free")
assert system.minimize_proxy(external_force=2e-3).success
share = system.force[:n, :n] / system.force.sum()
print("ContactMechanics: on the spike", share[spike], "in the middle", share[middle], "beside it", share[16, 15])
assert abs(share[spike]) == 0.0 and abs(share[middle]) == 0.0 and share[16, 15] > 0.01
END
