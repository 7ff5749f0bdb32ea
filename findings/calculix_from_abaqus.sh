#!/usr/bin/env bash
# abq2ccx: *FRICTION, ELASTIC SLIP of an Abaqus deck in CalculiX 2.20.
#
# Guess: the slip becomes a stick slope, or a warning; what sticks bears shear in proportion to its shift over that slip.
# Seen: it is dropped with a note, and CalculiX takes half of Young's modulus of the first material: a slip of 0.01 mm would
# make 0.0625 N, it bears 0.25 N, four times that. State the stick slope. A table of pressures does get its row beyond the end.
set -euo pipefail
scripts=$(cd "$(dirname "$0")" && pwd)
source "$scripts/calculix_setup.sh" calculix-ccx=2.20-1 libspooles2.2=2.2-14 libarpack2=3.8.0-3
python3 -m venv venv
venv/bin/pip install -qq --no-compile --disable-pip-version-check --only-binary=:all: abq2ccx==1.6.0
python3 - <<'END'
import os
import re
import subprocess

from calculix_deck import TABLE, deck, expect

SLIP, SHIFT = 0.01, 0.0005  # mm
text = deck(law=f"{TABLE}\n*FRICTION, ELASTIC SLIP={SLIP}\n0.3", shear=str(SHIFT), printed="")
text = text.replace("*CONTROLS, PARAMETERS=FIELD\n1e-8, 1e-8, , , 1e-8\n", "").replace("TOTALS=ONLY", "TOTALS=YES")
with open("abaqus.inp", "w") as file:
    file.write(text)
env = {key: value for key, value in os.environ.items() if key != "LD_LIBRARY_PATH"}
done = subprocess.run(["venv/bin/abq2ccx", "abaqus.inp", "-o", "deck.inp"], capture_output=True, text=True, env=env, check=True)
words = [line for line in done.stderr.splitlines() if "ELASTIC SLIP" in line]
print(*words, sep="\n")
print(done.stderr.strip().splitlines()[0])
assert len(words) == 1 and words[0].startswith("[NOTE]")
with open("deck.inp") as file:
    converted = file.read()
assert "*FRICTION\n0.3" in converted
subprocess.run([os.environ["CCX"], "-i", "deck"], capture_output=True, timeout=300, check=True)
with open("deck.dat") as file:
    rows = re.findall(r"total force .*? for set PLATE .*?\n\s*\n(.*?)\n", file.read())
shear, _, normal = (abs(float(word)) for word in rows[-1].split())
expect("normal force [N]", normal, 25 / 6)
print("by the elastic slip", 0.3 * normal * SHIFT / SLIP)
expect("shear [N]", shear, 0.25)
END
