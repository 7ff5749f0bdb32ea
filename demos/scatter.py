# %% [markdown]
# # A thousand rough surfaces on one block
#
# What one learns: how much the force at a given approach scatters between surfaces that are equal
# in everything that is usually told of a rough surface (spectrum, rms gradient, size), and differ
# in their phases alone. One deterministic curve, such as the paper's, is one draw.
#
#     compliance of the block: once                   1000 × { surface → contact problem on
#     (finite elements in smooth modes)                 the block → 16 laws → 8 load steps }
#
# Run time: seven minutes on one core, half of it under `mpirun -n 2`; the surfaces are dealt to the
# ranks. `--quick` for 6 surfaces, `--out DIR` for the folder of the figure.

# %%
import argparse
import time
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from mpi4py import MPI

from geometry import Control
from multiscale import CondensedCoupling, Scene, consistent_laws, load_steps, make_setup, run
from multiscale.couplings.body import scene_body
from multiscale.couplings.contact import on_body
from multiscale.couplings.patch_compliance import patch_compliance

parser = argparse.ArgumentParser()
parser.add_argument("--quick", action="store_true")
parser.add_argument("--out", type=Path, default=Path("results/scatter"))
choice = parser.parse_args()
comm = MPI.COMM_WORLD
SURFACES = 6 if choice.quick else 1000
PAPER = Path(__file__).parent / "scenes" / "paper.toml"

# %% [markdown]
# The paper's scene with consistent laws of half-space contacts: Set 1 of its Table 1, here on
# 64 × 64 heights, on which the half-space model is within 1.2 per cent (rms) of its limit
# (accuracy.md, micro models), and the paper's cube under 4 × 4 patches.
KEYS = (
    "micro.model=half-space",
    "micro.finite_slopes=false",  # which lower all curves alike, by 2.5 to 4 %
    "output.check=none",
    "coupling.kind=consistent",
    "coupling.table_tolerance=3e-3",
    "surface.grid=[64, 64]",
)


def scene(seed: int) -> Scene:
    """Return the scene of one surface."""
    return Scene.load(PAPER, [*KEYS, f"surface.spectrum.seed={seed}"])


# %% [markdown]
# The block is the same below all surfaces: what pressures do to its top is found once, on all
# ranks together.

# %%
start = time.perf_counter()
first = make_setup(scene(0))
face, compliance = scene_body(first).face(comm), patch_compliance(first, comm)
once = time.perf_counter() - start


# %%
def curve(seed: int) -> list[float]:
    """Return the forces of one surface at all load steps [N]."""
    setup = make_setup(scene(seed))
    load_history = setup.scene.loading.load_history
    table = consistent_laws(
        on_body(setup, None, face=face)(setup.micro, 0),
        setup.patches,
        mean_heights=setup.mean_heights,
        largest=Control(approach=load_history.largest, tilt=load_history.tilt),
        displacements=lambda pressures: pressures @ compliance.T,
        tolerance=setup.table_tolerance,
    )
    return [step.force_N for step in load_steps(CondensedCoupling(table, compliance), load_history)]


start = time.perf_counter()
mine = {seed: curve(seed) for seed in range(comm.rank, SURFACES, comm.size)}
found = {seed: row for part in comm.allgather(mine) for seed, row in part.items()}
forces = np.array([found[seed] for seed in range(SURFACES)])
spent = time.perf_counter() - start

# %% [markdown]
# The scatter is largest where few summits touch, and is far from small where many do.

# %%
if comm.rank == 0:
    choice.out.mkdir(parents=True, exist_ok=True)
    alone = run(scene(0))  # which finds all of this itself
    approach = alone.approach_mm
    low, median, high = np.percentile(forces, (5, 50, 95), axis=0)
    mean, deviation = forces.mean(axis=0), forces.std(axis=0, ddof=1)
    print(f"{SURFACES} surfaces, {comm.size} rank(s): block {once:.1f} s, curves {spent:.1f} s")
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
        xlim=(0.0, 1e3 * approach[-1]),
        ylim=(0.0, None),
    )
    axes.legend(loc="upper left", frameon=False)
    figure.savefig(choice.out / "scatter.png", dpi=130)
    assert np.all(np.diff(forces, axis=1) >= 0.0)
    # the same laws but for the residual of their micro solutions, 1e-8 here and 1e-10 there
    np.testing.assert_allclose(forces[0, 1:], alone.force_N, rtol=1e-6)
