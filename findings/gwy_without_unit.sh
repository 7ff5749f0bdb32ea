#!/bin/bash
# Gwyddion (.gwy): a field whose unit of heights is left out, as the format allows.
#
# Guess: heights without a unit, which the user is asked for.
# Instead: SurfaceTopography counts no channel of heights and then takes the first of none: IndexError, "list
# index out of range". gwyfile reads the field.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --no-compile --disable-pip-version-check SurfaceTopography==1.27.1 gwyfile==0.3.0
cd "$folder"
venv/bin/python - <<'END'
from importlib.metadata import version

import numpy as np
import SurfaceTopography
from gwyfile import load
from gwyfile.objects import GwyContainer, GwyDataField, GwySIUnit

print("SurfaceTopography", version("SurfaceTopography"), "gwyfile", version("gwyfile"))
heights = 1e-9 * np.arange(12.0).reshape(3, 4)
for unit in ("m", None):
    container, metre = GwyContainer(), GwySIUnit(unitstr="m")
    known = {} if unit is None else {"si_unit_z": metre}
    container["/0/data"] = GwyDataField(heights, xreal=8e-6, yreal=6e-6, si_unit_xy=metre, **known)
    container["/0/data/title"] = "Height"
    container.tofile("map.gwy")
    np.testing.assert_allclose(load("map.gwy")["/0/data"].data, heights)
    with SurfaceTopography.open_topography("map.gwy") as reader:
        print("unit", unit, "channels", len(reader.channels))
        assert len(reader.channels) == (1 if unit else 0)
        try:
            print(reader.default_channel.name)
            assert unit
        except IndexError as error:
            print("IndexError:", error)
            assert unit is None
END
