#!/usr/bin/env bash
# CalculiX 2.20: two surface interactions of one name, as two files that are included may have.
#
# Guess: the second is refused, or replaces the first.
# Seen: the first is used, without a word.
set -euo pipefail
source "$(dirname "$0")/calculix_setup.sh" calculix-ccx=2.20-1 libspooles2.2=2.2-14 libarpack2=3.8.0-3
python3 - <<'EOF'
from calculix_deck import TABLE, expect, forces

stiff = TABLE.replace("50., 0.01", "500., 0.01")  # 50,000 instead of 5000 MPa/mm
twice = "{}\n*SURFACE INTERACTION, NAME=LAW\n{}"
for kind in ("NODE TO SURFACE", "MORTAR"):
    expect(f"{kind}, one law", forces(law=TABLE, kind=kind)[0][2], 4.166667)
    expect(f"{kind}, another", forces(law=stiff, kind=kind)[0][2], 4.901961)
    expect(f"{kind}, both", forces(law=twice.format(TABLE, stiff), kind=kind)[0][2], 4.166667)
    expect(f"{kind}, the other first", forces(law=twice.format(stiff, TABLE), kind=kind)[0][2], 4.901961)
EOF
