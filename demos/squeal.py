# %% [markdown]
# # Squeal: where the modes of a pressed brake pad merge
#
# What one learns: the contact stiffness of three zones moves the natural frequencies of a pad with
# the brake pressure, and friction couples its modes: beyond some coefficient of friction two of
# them merge, and one of the pair grows. Another map of the same roughness merges them elsewhere.
#
#     3 laws of samples ──▶ Interface in a dolfinx problem ──▶ K + contact, M ──▶ natural_modes
#
# Run time: 4 min; works under `mpirun -n N`. `--quick` for few maps and coarse meshes,
# `--out DIR` for the picture.

# %%
import argparse
from pathlib import Path

import numpy as np
from mpi4py import MPI
from pad.squealing import LENGTHS, LINING, Pad, draw
from petsc4py import PETSc

from patchlaw import (
    ContactProblem,
    Control,
    Interface,
    PatchGrid,
    Spectrum,
    natural_modes,
    representative_law,
    synthesise,
)

parser = argparse.ArgumentParser()
parser.add_argument("--quick", action="store_true")
parser.add_argument("--out", type=Path, default=Path("results/squeal"))
choice = parser.parse_args()
COMM, OUT = MPI.COMM_WORLD, choice.out
CELLS, GRID, MAPS = ((6, 3, 5), 32, 3) if choice.quick else ((9, 6, 5), 64, 10)
PRESSURES = [0.5, 4.0] if choice.quick else [0.25, 0.5, 1.0, 2.0, 4.0]  # [MPa]
AREA, MODES, GROWS = LENGTHS[0] * LENGTHS[1], 10, 1.0  # mm²; rate that is no rounding [1/s]

# %% [markdown]
# Laws of the lining's roughness, one for each map; a pad has three neighbouring ones in its zones.

# %%
laws = []
for seed in range(MAPS):
    band = Spectrum(hurst=0.8, waves=(2, GRID // 6), rms_height=1e-2, seed=seed)
    sample = synthesise(band, grid=(GRID, GRID), lengths=(5.0, 5.0))
    modulus = LINING[0] / (1.0 - LINING[1] ** 2)
    laws.append(representative_law([sample], modulus, largest_pressure=40.0, tolerance=1e-2))
zones, pad = PatchGrid(grid=(3, 1), lengths=LENGTHS), Pad(COMM, CELLS)

# %% [markdown]
# The pad under a brake pressure, and its modes while the disc slides below it.


# %%
def pressed(first, pressure):
    """Return the face of a pad with three neighbouring laws under a brake pressure [MPa]."""
    own = [laws[(first + zone) % MAPS] for zone in range(3)]
    force = Control(force=pressure * AREA)
    options = {"laws": own, "patches": zones, "mode": "pointwise", "indenter": force}
    rough = Interface(pad.space, None, pad.top, **options)
    ContactProblem(pad.inner(pad.u), pad.u, pad.bcs, rough).solve()
    return rough


def modes(rough, friction):
    """Return the natural modes."""
    whole = pad.stiffness.copy()
    contact = rough.stiffness_matrix(pad.u, sliding=(friction, 0.0))
    whole.axpy(1.0, contact, PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN)
    return natural_modes(whole, pad.mass, MODES, bcs=pad.bcs)


def merging(rough):
    """Return the least friction at which a mode grows, and its frequency; none below 1."""
    low, high, found = 0.0, 1.0, modes(rough, 1.0)
    if found.damping.min() > -GROWS:
        return np.nan, np.nan
    while high - low > 0.01:
        middle = 0.5 * (low + high)
        tried = modes(rough, middle)
        grows = tried.damping.min() < -GROWS
        low, high, found = (low, middle, tried) if grows else (middle, high, found)
    return high, found.frequencies[found.damping.argmin()]


# %% [markdown]
# Frequencies of a pad that glides rise with the pressure; friction lets two of them merge.

# %%
curves, merges = [], []
for pressure in PRESSURES:
    rough = pressed(0, pressure)
    curves.append(modes(rough, 0.0).frequencies / 1e3)
    merges.append(merging(rough))
    friction, hertz = merges[-1]
    if COMM.rank == 0:
        first = ", ".join(f"{each:.2f}" for each in curves[-1][:4])
        there = f"{friction:.2f}, {hertz / 1e3:.2f} kHz"
        print(f"{pressure:5.2f} MPa: {first} kHz; modes merge at μ = {there}", flush=True)
frictions = np.linspace(0.0, 1.0, 3 if choice.quick else 9)
swept = [modes(rough, friction) for friction in frictions]
scatter = [merging(pressed(first, PRESSURES[-1])) for first in range(MAPS)]
least = np.array([friction for friction, _ in scatter])
if COMM.rank == 0:
    told = f"{np.mean(least):.3f} ± {np.std(least):.3f}"
    print(f"{MAPS} pads at {PRESSURES[-1]} MPa: modes merge at μ = {told}")
    OUT.mkdir(parents=True, exist_ok=True)
    draw(OUT / "squeal.png", PRESSURES, curves, merges, frictions, swept, least)

# %% [markdown]
# Rough contacts stiffen with their pressure, so that the lowest frequency rises with it.

# %%
assert np.all(np.diff([one[0] for one in curves]) > 0.0)
