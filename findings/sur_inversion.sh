#!/bin/bash
# Digital Surf (.sur): the header's inversion flag says that heights were turned over.
#
# Guess: either all readers obey it, or none does.
# Instead: SurfaceTopography turns the heights over (1) and mirrors them besides (2, 3), surfalize and
# rosettasciio leave them: summits of one are valleys of the others.
set -e
PYTHONPATH=$(cd "$(dirname "$0")" && pwd)
export PYTHONPATH
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check SurfaceTopography==1.27.1 surfalize==0.19.2 rosettasciio==0.15.0
cd "$folder"
venv/bin/python - <<'END'
from importlib.metadata import version

import numpy as np
from sur_file import heights, sur

for name in ("SurfaceTopography", "surfalize", "rosettasciio"):
    print(name, version(name))
plain = 0.1 * np.arange(12).reshape(3, 4)
there = {0: plain, 1: -plain, 2: -plain[:, ::-1], 3: -plain[::-1]}
for inversion, expected in there.items():
    open("map.sur", "wb").write(sur(0, inversion))
    found = heights("map.sur")
    print("flag", inversion, {name: one[0].round(3).tolist() for name, one in found.items()})
    np.testing.assert_allclose(found["SurfaceTopography"], expected, atol=1e-6)
    np.testing.assert_allclose(found["surfalize"], plain, atol=1e-6)
    np.testing.assert_allclose(found["rosettasciio"], plain, atol=1e-6)
END
