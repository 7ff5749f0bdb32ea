#!/usr/bin/env bash
# CalculiX 2.20: a plate that is taken back, on a law that is much stiffer than the body.
#
# Guess: an increment that has converged has found the contact, or it is cut back.
# Seen: with TYPE=NODE TO SURFACE a cube that bore 29 N bears nothing once the plate is taken back by four fifths of its
# way, in one increment or in ten, though the plate still overlaps the cube; the job ends as if all were well. At the
# larger load the slope of the law is some 400 times the stiffness of the cube. In increments of 0.3 % of the way, or under
# TYPE=MORTAR in one, it bears the same as on the way there.
set -euo pipefail
source "$(dirname "$0")/calculix_setup.sh" calculix-ccx=2.20-1 libspooles2.2=2.2-14 libarpack2=3.8.0-3
python3 - <<'EOF'
import math

from calculix_deck import deck, expect, forces_of

rows = [f"{1e-3 * math.expm1(n / 3.0):.9g}, {2.5e-5 * n:.9g}" for n in range(40)]
law = "\n".join(["*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=TABULAR", *rows])


def borne(kind, increment, *way):
    """Return what the cube bears after the plate has gone to places one after the other [N]."""
    text = deck(law=law, kind=kind).replace("1., 1.\n", f"{increment}, 1., 1e-6, {increment}\n", 1)
    before, step = text[: text.index("*STEP")], text[text.index("*STEP") :]
    return forces_of(before + "".join(step.replace("-0.005", f"-{x}") for x in way))[0][2]


for kind, increment, back in (
    ("NODE TO SURFACE", 1.0, 0.0),
    ("NODE TO SURFACE", 0.1, 0.0),
    ("NODE TO SURFACE", 0.003, 5.35681),
    ("MORTAR", 1.0, 5.35681),
):
    expect(f"{kind}, increments of {increment}, pressed", borne(kind, increment, 0.03), 29.22933)
    expect(f"{kind}, increments of {increment}, taken back", borne(kind, increment, 0.03, 0.006), back)
EOF
