#!/bin/bash
# Digital Surf (.sur): the header's offset of heights, and what heights count from.
#
# Guess: heights are numbers times increment plus offset in all readers.
# Instead: so they are in surfalize; SurfaceTopography leaves the offset out, rosettasciio adds it but
# counts from the lowest number. Three readers, three levels, of no harm to roughness but to steps between files.
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
open("map.sur", "wb").write(sur(5, offset=7.0))
found = {name: float(one[0, 0]) for name, one in heights("map.sur").items()}
print("first height, 5 increments of 0.1 µm and an offset of 7 µm:", found)
expected = {"SurfaceTopography": 0.5, "surfalize": 7.5, "rosettasciio": 7.0}
for name, height in expected.items():
    assert abs(found[name] - height) < 1e-5, name
END
