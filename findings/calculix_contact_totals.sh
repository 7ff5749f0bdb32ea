#!/usr/bin/env bash
# CalculiX 2.20: *CONTACT PRINT, SLAVE=..., MASTER=... with CF, the total force of a contact pair and its area.
#
# Guess: the force that base and plate bear, 4.17 N on 1 mm^2, with all types of contact.
# Seen: with SURFACE TO SURFACE it is. With NODE TO SURFACE, which does take tables, and with MORTAR force and area are
# 0, the other figures NaN; exit code 0. Add up CSTR times the nodes' areas, or print the reaction of the base.
set -euo pipefail
source "$(dirname "$0")/calculix_setup.sh" calculix-ccx=2.20-1 libspooles2.2=2.2-14 libarpack2=3.8.0-3
python3 - <<'EOF'
import re

from calculix_deck import expect, forces

law = "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR\n5000., 1e-4"
for kind, area in (("SURFACE TO SURFACE", 1.0), ("NODE TO SURFACE", 0.0), ("MORTAR", 0.0)):
    total = "*CONTACT PRINT, SLAVE=SLAVE, MASTER=MASTER\nCF"
    base, _, _ = forces(law=law, kind=kind, cells=2, printed=total)
    with open("deck.dat") as file:
        found = file.read().partition("statistics for slave set")[2]
    row = re.search(r"area,.*?\n\s*\n(.*?)\n", found)[1].split()
    print(f"{kind}: base {base[2]} N, CF: area, normal and shear force {row}")
    expect("area", float(row[0]), area)
    expect("normal force is NaN", "NaN" in row[1], area == 0.0)
EOF
