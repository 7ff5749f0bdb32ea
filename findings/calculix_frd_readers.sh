#!/usr/bin/env bash
# CalculiX 2.20 results (.frd) in ccx2paraview and pyvista-frd-reader: the equivalent strain that both add.
#
# Guess: they agree, on the equivalent strain of von Mises.
# Seen: of a bar pressed by 0.0041665 ccx2paraview's E_Mises is 0.0041665, the formula of stresses applied to strains;
# pyvista-frd-reader's TOSTRAIN_Mises is two thirds of it, 0.0027777. Stresses, their Mises and pressures agree.
# ccx2paraview does not read the binary files that *NODE OUTPUT makes, frd2vtu reads nothing else, and says so with exit code 0.
set -euo pipefail
scripts=$(cd "$(dirname "$0")" && pwd)
source "$scripts/calculix_setup.sh" calculix-ccx=2.20-1 libspooles2.2=2.2-14 libarpack2=3.8.0-3
python3 - <<'END'
import os
import subprocess

from calculix_deck import deck

asked = "*NODE FILE\nU\n*EL FILE\nS, E\n*CONTACT FILE\nCDIS, CSTR"
for name, printed in (("text", asked), ("binary", asked.replace("FILE", "OUTPUT").replace("EL O", "ELEMENT O"))):
    with open(f"{name}.inp", "w") as file:
        file.write(deck(cells=2, printed=printed))
    subprocess.run([os.environ["CCX"], "-i", name], capture_output=True, timeout=300, check=True)
END
results=$folder
unset LD_LIBRARY_PATH PYTHONPATH
source "$scripts/packages.sh" ccx2paraview==3.2.0 pyvista-frd-reader==0.3.1 frd2vtu==0.2.1 pyvista==0.49.1 vtk==9.7.2
cp "$results"/*.frd .
rm -rf "$results"
python - <<'END'
import os
import subprocess

import numpy as np
import pyvista
import pyvista_frd


def convert(*command):
    """Return the exit code and the last words of a program."""
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    return done.returncode, (done.stdout + done.stderr).strip().splitlines()[-1]


print("ccx2paraview, text:", convert("ccx2paraview", "text.frd", "vtu"))
one, other = pyvista.read("text.vtu"), pyvista_frd.read("text.frd")
bar = slice(0, 27)
strain, found = np.abs(one["E"][bar, 2]), (one["E_Mises"][bar], other["TOSTRAIN_Mises"][bar])
print("strain", strain.max(), "ccx2paraview", found[0].max(), "pyvista-frd-reader", found[1].max())
assert np.allclose(found[0], strain) and np.allclose(found[1], strain * 2 / 3) and strain.max() > 0.004
assert np.allclose(one["S_Mises"], other["STRESS_Mises"]) and np.allclose(one["CONTACT"], other["CONTACT"])
assert np.allclose(pyvista_frd.read("binary.frd")["DISP"], other["DISP"], atol=1e-8)
code, words = convert("ccx2paraview", "binary.frd", "vtu")
print("ccx2paraview, binary:", code, words)
assert code and not os.path.exists("binary.vtu")
code, words = convert("frd2vtu", "convert", "binary.frd")
print("frd2vtu, binary:", code, words)
assert code == 0 and os.path.exists("binary.vtu")
os.remove("text.vtu")
code, words = convert("frd2vtu", "convert", "text.frd")
print("frd2vtu, text:", code, words)
assert code == 0 and not os.path.exists("text.vtu")
END
