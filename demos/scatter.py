# %% [markdown]
# # A thousand rough surfaces on one block
#
# What one learns: how much the force at a given approach scatters between surfaces that are equal
# in everything that is usually told of a rough surface (spectrum, rms gradient, size), and differ
# in their phases alone. One deterministic curve, such as the paper's, is one draw.
#
#     Λ/(π E*) and D of the block: once               1000 × { surface → whole-surface micro
#     (half-space exactly, finite elements for D)                solution → 16 laws → 8 load steps }
#
# Run time: three minutes on one core, half of it under `mpirun -n 2`; the surfaces are dealt to the
# ranks. `--quick` for 24 surfaces, `--out DIR` for the folder of the figure.

# %%
import argparse
import time
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from mpi4py import MPI

from geometry import BlockShape, PatchGrid, Spectrum, patch_means, synthesise
from macro import Material, make_correction
from micro import HalfSpace, HalfSpaceModel, influence_matrix
from multiscale import (
    CondensedCoupling,
    Programme,
    SpreadLoads,
    consistent_laws,
    load_steps,
)

parser = argparse.ArgumentParser()
parser.add_argument("--quick", action="store_true")
parser.add_argument("--out", type=Path, default=Path("results/scatter"))
choice = parser.parse_args()
comm = MPI.COMM_WORLD
SURFACES = 24 if choice.quick else 1000
APPROACH, STEPS = 8e-3, 8

# %% [markdown]
# The block of the paper, a cube of 1 mm on a clamped bottom, and its compliance under 4 × 4
# patches: the half-space's in closed form and the smooth rest from coarse elements.

# %%
start = time.perf_counter()
material = Material(young_modulus=4000.0, poisson_ratio=0.15)
patches = PatchGrid(grid=(4, 4), lengths=(1.0, 1.0))
shape = BlockShape(interface=(1.0, 1.0), height=1.0, cells=(16, 16, 8))
loads = PatchGrid(grid=(16, 16), lengths=(1.0, 1.0))
half_space = HalfSpace(material.young_modulus, material.poisson_ratio)
correction = make_correction(shape, material, "free", loads, half_space, comm)
under_patches = influence_matrix(patches) / (np.pi * material.contact_modulus)
once = time.perf_counter() - start

# %% [markdown]
# Set 1 of the paper's Table 1, 64 × 64 heights: the half-space model on them is within 1.2 per
# cent (rms) of its limit on finer grids (accuracy.md, micro models). It knows no free sides here.


# %%
def curve(seed: int) -> list[float]:
    """Return the forces of one surface at all load steps [N]."""
    spectrum = Spectrum(hurst=0.95, waves=(2, 10), rms_slope=0.215, seed=seed)
    surface = synthesise(spectrum, grid=(64, 64), lengths=(1.0, 1.0))
    model = HalfSpaceModel(surface=surface, contact_modulus=material.contact_modulus)
    table = consistent_laws(
        model,
        patches,
        mean_heights=patch_means(surface, patches),
        approach_end=1.15 * APPROACH,
        tolerance=3e-3,
        sinking=correction,
    )
    coupling = CondensedCoupling(table, SpreadLoads(under_patches, table.spread))
    programme = Programme(quantity="approach", points=(APPROACH,), steps=STEPS)
    return [step.force_N for step in load_steps(coupling, programme)]


start = time.perf_counter()
mine = [curve(seed) for seed in range(comm.rank, SURFACES, comm.size)]
forces = np.array([row for part in comm.allgather(mine) for row in part])
spent = time.perf_counter() - start
approach = np.linspace(0.0, APPROACH, STEPS + 1)[1:]

# %% [markdown]
# The scatter is largest where few summits touch, and is far from small where many do.

# %%
if comm.rank == 0:
    choice.out.mkdir(parents=True, exist_ok=True)
    low, median, high = np.percentile(forces, (5, 50, 95), axis=0)
    mean, deviation = forces.mean(axis=0), forces.std(axis=0, ddof=1)
    print(
        f"{SURFACES} surfaces, {comm.size} rank(s): compliance {once:.1f} s, curves {spent:.1f} s"
    )
    print("approach [µm]   mean force [N]   deviation   5 … 95 % [N]")
    for row in zip(1e3 * approach, mean, deviation / mean, low, high, strict=True):
        print("{:10.1f} {:16.3f} {:12.0%} {:9.3f} … {:.3f}".format(*row))
    figure = Figure(figsize=(7.0, 4.5), layout="constrained")
    axes = figure.subplots()
    approach, forces = np.append(0.0, approach), np.insert(forces, 0, 0.0, axis=1)
    low, median, high = np.percentile(forces, (5, 50, 95), axis=0)
    axes.plot(1e3 * approach, forces[:60].T, color="0.75", lw=0.6)
    axes.plot([], [], color="0.75", lw=0.6, label=f"{min(60, SURFACES)} of {SURFACES} surfaces")
    axes.fill_between(1e3 * approach, low, high, color="C0", alpha=0.25, label="5 to 95 %")
    axes.plot(1e3 * approach, forces.mean(axis=0), color="C0", lw=2.0, label="mean")
    axes.plot(1e3 * approach, median, color="C0", lw=1.2, ls="--", label="median")
    axes.set(
        xlabel="approach from first touch [µm]",
        ylabel="force [N]",
        xlim=(0.0, 1e3 * APPROACH),
        ylim=(0.0, None),
    )
    axes.legend(loc="upper left", frameon=False)
    figure.savefig(choice.out / "scatter.png", dpi=130)
    assert np.all(np.diff(forces, axis=1) >= 0.0)
