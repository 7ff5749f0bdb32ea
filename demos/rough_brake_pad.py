# %% [markdown]
# # A rough brake pad, from three maps to the contact
#
# What one learns: maps as an instrument delivers them become one law, the law presses a whole pad,
# and every link of the chain has a witness: the roughness without the instrument, CalculiX with the
# same law, and a chip of the pad whose roughness is meshed as it is.
#
#     3 maps ──▶ prepared ──▶ law p(closure) ──▶ pad: lining on steel, rim of a piston behind it
#                  └──────▶ chip off its face: contacts on cells, and roughness meshed
#
# Scenes: `pad/pad.toml`, `pad/chip.toml`. Run time: 4 min; works under `mpirun -n N`.
# `--quick` for coarse meshes and maps, `--out DIR` for all files.

# %%
import argparse
import subprocess
import sys
from functools import partial
from pathlib import Path

import numpy as np
from mpi4py import MPI
from pad import calculix
from pad.chip import write_chip
from pad.maps import deliver, rough
from pad.picture import draw, pressures

from patchlaw.geometry import Control, Filter, Preparation, Surface, mirrored, read_surface
from patchlaw.geometry.preparation import prepared
from patchlaw.micro import HalfSpaceModel
from patchlaw.multiscale import Run, Scene, export_laws, run

parser = argparse.ArgumentParser()
parser.add_argument("--quick", action="store_true")
parser.add_argument("--out", type=Path, default=Path("results/rough_brake_pad"))
choice = parser.parse_args()
COMM, DEMOS, OUT = MPI.COMM_WORLD, Path(__file__).parent, choice.out.absolute()
PIXELS, SAMPLE, CELLS = (64, 32, 32) if choice.quick else (256, 160, 128)  # along sides
SHORT, EDGE = (0.15, 8.0) if choice.quick else (0.05, 2.0)  # cut-off, edges of the pad [mm]
MATERIALS = {"lining": (1000.0, 0.25), "back plate": (210e3, 0.3)}  # E [MPa] and ν
FORCE, PRESSURE = 8e3, 1.73  # on the pad [N], its mean [MPa]
ROWS = {"coupling.table_tolerance": 1e-2} if choice.quick else {}
say = partial(print, flush=True) if COMM.rank == 0 else (lambda text: None)

# %% [markdown]
# Three places of the lining under the instrument, which adds noise, tilt, dust and dark places. How
# much of that is left shows in the mean gap of the three samples under the pressure on the pad.

# %%
maps, mesh, chip = [OUT / f"map_{n}.npy" for n in (1, 2, 3)], OUT / "pad.msh", OUT / "chip.msh"
true = [rough(seed, PIXELS) for seed in (11, 12, 13)]
if COMM.rank == 0:
    OUT.mkdir(parents=True, exist_ok=True)
    for seed, (surface, file) in enumerate(zip(true, maps, strict=True)):
        deliver(surface, seed, file)
    words = [sys.executable, DEMOS / "bodies/brake_pad.py", "--size", str(EDGE), "--out", mesh]
    subprocess.run(words, check=True, capture_output=True)
    write_chip(chip, side=1.0, size=0.25)
COMM.barrier()


def gap(surface: Surface) -> float:
    """Return the mean gap of a sample under the mean pressure [mm]."""
    sample, modulus = mirrored(surface), MATERIALS["lining"][0] / (1 - MATERIALS["lining"][1] ** 2)
    model = HalfSpaceModel(surface=sample, contact_modulus=modulus, periodic=True)
    return model.press(Control(force=PRESSURE * sample.area)).mean_separation


level = {"detrend": "plane", "resample": (SAMPLE, SAMPLE)}
filled = {"lengths": true[0].lengths, "missing": "fill", **level}
whole = {**filled, "outliers": "remove", "filter": Filter(short=SHORT)}
gaps = {
    "roughness itself": [gap(prepared(one, Preparation(**level))) for one in true],
    "prepared maps": [gap(read_surface(file, **whole)) for file in maps],
    "unfiltered maps": [gap(read_surface(file, **filled)) for file in maps],
}
for name, values in gaps.items():
    say(f"{name:17s} gap {1e3 * np.mean(values):.3f} µm, ±{1e3 * np.std(values, ddof=1):.3f} among")

# %% [markdown]
# The pad under the law of the three prepared maps, with quadratic elements and with the linear ones
# that CalculiX gets, beside the same law.

# %%
quiet = {"output.figures": False, "output.report": False, "surface.file": str(maps[0])}
quiet["surface.filter.short"] = SHORT
sizes = {"surface.resample": [SAMPLE, SAMPLE], "law.samples": [str(file) for file in maps[1:]]}
pads = {}
for element in ("quadratic", "linear"):
    body = {"body.mesh": str(mesh), "body.element": element}
    pad = Run(Scene.load(DEMOS / "pad/pad.toml").with_(quiet | sizes | body | ROWS), COMM)
    *_, step = pad.load_steps()
    pads[element] = step, *pressures(pad.coupling.model)
    table, approach, error = pad.make_laws(), 1e3 * step.approach_mm, 1e3 * step.approach_error_mm
    causes = ", ".join(f"{cause} {each:.0f} N" for cause, each in step.errors)
    say(f"pad, {element:12s} approach {approach:.3f} ± {error:.3f} µm ({causes})")
    pad.close()
witness = None
if COMM.rank == 0 and calculix.PROGRAM is not None:
    (law,) = export_laws(table, OUT, "calculix")
    down = pads["linear"][0].approach_mm
    witness = calculix.solve(mesh, law, "pad face", "piston", MATERIALS, down)
    say(f"pad, CalculiX     {witness.force:.1f} N at the approach of the linear elements")

# %% [markdown]
# The chip, 1 mm wide, with the roughness of the first map: contacts on cells above the chip, patch
# laws on its mesh, and the roughness meshed.

# %%
chips, sizes = {}, {"surface.resample": [CELLS, CELLS], "body.mesh": str(chip)}
scene = Scene.load(DEMOS / "pad/chip.toml").with_(quiet | sizes)
for kind, steps, rows in (("concurrent", 9, {}), ("consistent", 9, ROWS), ("reference", 3, {})):
    changes = {"coupling.kind": kind, "load.steps": steps // (3 if choice.quick else 1), **rows}
    chips[kind] = found = run(scene.with_(changes), COMM)
    approach, error = 1e3 * found.approach_mm[-1], 1e3 * found.approach_error_mm[-1]
    area = 100 * found.contact_area_fraction[-1]
    say(f"chip, {kind:11s} approach {approach:.3f} ± {error:.2g} µm, contact area {area:.2f} %")
if COMM.rank == 0:
    draw(OUT / "rough_brake_pad.png", maps[0], pads, witness, chips)

# %% [markdown]
# The preparation keeps the gap of the roughness, which unfiltered maps lose; CalculiX finds the
# force of the law; and the flat chip under its contacts approaches as the meshed roughness does.

# %%
truth, kept, raw = (np.mean(values) for values in gaps.values())
assert abs(kept / truth - 1) < min(0.1, 0.5 * abs(raw / truth - 1))
assert witness is None or abs(witness.force / FORCE - 1) < (5e-3 if choice.quick else 1e-3)
embedded, meshed = chips["concurrent"].approach_mm[2::3], chips["reference"].approach_mm
assert np.abs(embedded / meshed - 1).max() < (1e-2 if choice.quick else 5e-3)
