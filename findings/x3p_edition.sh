#!/bin/bash
# X3P (.x3p): files that name ISO 25178-72 as their edition, which replaced ISO 5436-2.
#
# Guess: what reads X3P reads them: the layout is the same but for additions.
# Instead: SurfaceTopography refuses them, as it accepts the text 'ISO5436 - 2000' alone; with that text
# in its place the same file is read. surfalize reads both.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check SurfaceTopography==1.27.1 surfalize==0.19.2 x3pio==2.0.0
cd "$folder"
venv/bin/python - <<'END'
import hashlib
import zipfile
from importlib.metadata import version

import numpy as np
import surfalize
import SurfaceTopography
import x3pio

for name in ("SurfaceTopography", "surfalize", "x3pio"):
    print(name, version(name))
heights = 1e-9 * np.arange(12.0).reshape(3, 4)
x3pio.write("new.x3p", heights, x_scale=1e-6, y_scale=1e-6)
with zipfile.ZipFile("new.x3p") as new, zipfile.ZipFile("old.x3p", "w") as old:
    start, rest = new.read("main.xml").split(b"<Revision>")
    edition, end = rest.split(b"</Revision>")
    print("edition", edition.decode())
    content = start + b"<Revision>ISO5436 - 2000</Revision>" + end
    old.writestr("main.xml", content)
    old.writestr("md5checksum.hex", hashlib.md5(content).hexdigest() + " *main.xml\n")
    old.writestr("bindata/data.bin", new.read("bindata/data.bin"))
for file in ("old.x3p", "new.x3p"):
    np.testing.assert_allclose(surfalize.Surface.load(file).data, 1e6 * heights)
np.testing.assert_allclose(SurfaceTopography.read_topography("old.x3p").heights().T, heights)
try:
    SurfaceTopography.read_topography("new.x3p")
except Exception as error:
    print(type(error).__name__, [line for line in str(error).splitlines() if "Revision" in line])
    assert "Revision should be" in str(error)
else:
    raise SystemExit("it is read now")
END
