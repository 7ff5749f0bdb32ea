#!/usr/bin/env bash
# CalculiX 2.20: a number of 21 characters loses its last digit, which can be the exponent's.
#
# Guess: a number with more digits than a double holds is rounded, or refused.
# Seen: only 20 characters are read. -5.0000000000000e-03 (20) is -0.005. -5.00000000000000e-03 (21) is read as
# -5.00000000000000e-0, which is -5: a displacement a thousand times as large, exit code 0, no warning. The
# 22nd character makes it an error ("error reading *BOUNDARY"). Python's repr of doubles has up to 24
# characters. Write 13 digits.
set -euo pipefail
source "$(dirname "$0")/calculix_setup.sh" calculix-ccx=2.20-1 libspooles2.2=2.2-14 libarpack2=3.8.0-3
python3 - <<'EOF'
from calculix_deck import expect, forces

expect("displacement of -5.0000000000000e-03 mm, 20 characters", forces(shift="5.0000000000000e-03")[0][2], 4.166667)
expect("displacement of -5.00000000000000e-03 mm, 21 characters", forces(shift="5.00000000000000e-03")[0][2], 50.0)
EOF
