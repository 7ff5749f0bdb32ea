#!/usr/bin/env bash
# CalculiX 2.20: a contact law on a face that is stretched, as on rubber; here by 20 % along the face, with Poisson's ratio 0.
#
# Guess: pressures act on the deformed face with NLGEOM, on the face as drawn without, whichever the type of contact.
# Seen: the type decides, not NLGEOM. NODE TO SURFACE takes the deformed areas, also in a linear step: 0.2830 N in place of 0.2381.
# SURFACE TO SURFACE takes the areas as drawn, also with NLGEOM: 0.2381 N in place of 0.2830, at the same pressures. Exit code 0, no warning.
set -euo pipefail
source "$(dirname "$0")/calculix_setup.sh" calculix-ccx=2.20-1 libspooles2.2=2.2-14 libarpack2=3.8.0-3
python3 - <<'EOF'
from calculix_deck import expect, forces

# far softer than the cube
table = "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=TABULAR\n0., 0.\n50., 1."
slope = "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR\n50., 1e-4"
for kind, law, area in (("NODE TO SURFACE", table, 1.2), ("SURFACE TO SURFACE", slope, 1.0)):
    for geometry in ("", ", NLGEOM"):
        options = {"law": law, "kind": kind, "cells": 2, "geometry": geometry}
        base, _, _ = forces(**options)
        stretched, _, _ = forces(**options, stretch=0.2)
        expect(f"{kind}{geometry}, as drawn", base[2], 0.005 / (1 / 50 + 1 / 1000))
        expect(f"{kind}{geometry}, stretched", stretched[2], 0.005 / (1 / 50 / area + 1 / 1000))
EOF
