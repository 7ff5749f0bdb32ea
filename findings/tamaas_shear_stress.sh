#!/usr/bin/env bash
# Tamaas 2.9.0: shear stresses below a pressure on a half-space, model type volume_2d, operators boussinesq_gradient and hooke.
#
# Guess: the six components are Voigt's, as to_voigt is called: xx, yy, zz, yz, xz, xy.
# Seen: shear stresses are sqrt(2) times what they are (Mandel's components), so are shear strains in place of twice; the order is xx, yy,
# zz, xy, xz, yz. Below a wave of pressure of amplitude 1 the greatest shear stress xz is 0.52 in place of 0.368. Stresses xx, yy, zz and von
# Mises' are right. Divide the last three components by sqrt(2), or take from_voigt.
set -euo pipefail
source "$(dirname "$0")/packages.sh" tamaas==2.9.0
python - <<'END'
import numpy as np
import tamaas

tamaas.set_log_level(tamaas.LogLevel.error)
layers, n = 41, 64
model = tamaas.Model(tamaas.model_type.volume_2d, [1.0, 1.0, 1.0], [layers, n, n])
model.E, model.nu = 3.0, 0.3
tamaas.ModelFactory.registerVolumeOperators(model)
angle = 2 * np.pi * np.arange(n) / n
model.traction[..., 2] = np.cos(angle)[:, None]
strain, stress = np.zeros((2, layers, n, n, 6))
model.operators["boussinesq_gradient"](model.traction, strain)
model.operators["hooke"](strain, stress)
deep = 2 * np.pi * np.linspace(0, 1, layers)[1:, None]  # below the surface, where the series of waves is cut off
fall = np.exp(-deep)
shear, found = np.abs(deep * fall * np.sin(angle)), np.abs(stress[1:, :, 0, 4])
print("shear stress xz, greatest:", found.max(), "closed form", shear.max())
np.testing.assert_allclose(found, np.sqrt(2) * shear, atol=1e-9)
np.testing.assert_allclose(stress[1:, :, 0, 2], -(1 + deep) * fall * np.cos(angle), atol=1e-9)
np.testing.assert_allclose(np.abs(strain[1:, :, 0, 4]), np.sqrt(2) * shear * (1 + model.nu) / model.E, atol=1e-9)
mises = np.zeros((layers, n, n))
tamaas.compute.von_mises(model.type, mises, stress)
xx, yy = -(1 - deep) * fall * np.cos(angle), -2 * model.nu * fall * np.cos(angle)
zz = -(1 + deep) * fall * np.cos(angle)
true = np.sqrt(((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) / 2 + 3 * shear**2)
np.testing.assert_allclose(mises[1:, :, 0], true, atol=1e-9)
given = np.arange(1.0, 10.0).reshape(3, 3) + np.arange(1.0, 10.0).reshape(3, 3).T
six = np.asarray(tamaas.compute.to_voigt(np.tile(given.ravel(), (1, 1, 1, 1))))[0, 0, 0]
print("to_voigt of", given.tolist(), "is", six)
np.testing.assert_allclose(six, [*np.diag(given), *(np.sqrt(2) * given[[0, 0, 1], [1, 2, 2]])])
END
