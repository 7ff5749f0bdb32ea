# %% [markdown]
# # A thousand rough surfaces on one block
#
# What one learns: how much the force at a given approach scatters between surfaces that are equal
# in everything that is usually told of a rough surface (spectrum, rms gradient, size), and differ
# in their phases alone. One deterministic curve, such as the paper's, is one draw.
#
#     block, sides, kernels: once a rank              1000 × { surface → contact problem on the
#                                                       block → 8 load steps → measured error }
#
# Run time: three minutes on one core, half of it under `mpirun -n 2`; every rank takes the next
# surface as it becomes free. `--quick` for 6 surfaces, `--out DIR` for the folder of the figure.
# From the shell it is `patchlaw sweep … --vary surface.spectrum.seed=0..999`.

# %%
import argparse
import time
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from mpi4py import MPI

from multiscale import Scene, run, sweep

parser = argparse.ArgumentParser()
parser.add_argument("--quick", action="store_true")
parser.add_argument("--out", type=Path, default=Path("results/scatter"))
choice = parser.parse_args()
comm = MPI.COMM_WORLD
SURFACES = 6 if choice.quick else 1000
PAPER = Path(__file__).parent / "scenes" / "paper.toml"

# %% [markdown]
# The paper's scene with half-space contacts on the paper's cube: Set 1 of its Table 1, here on
# 64 × 64 heights, on which the half-space model is within 1.2 per cent (rms) of its limit
# (accuracy.md, micro models). What finite slopes change is among the measured errors.

# %%
scene = Scene.load(
    PAPER,
    [
        "coupling.kind=concurrent",
        "micro.model=half-space",
        "micro.finite_slopes=false",  # which lower all curves alike, by 2.5 to 4 %
        "surface.grid=[64, 64]",
    ],
)
start = time.perf_counter()
found = sweep(scene, {"surface.spectrum.seed": range(SURFACES)}, comm)
((_, statistics),) = found.statistics
forces, approach, errors = found.force_N, found.approach_mm[0], found.force_error_N[:, -1]
spent = time.perf_counter() - start

# %% [markdown]
# The scatter is largest where few summits touch, and is far from small where many do.

# %%
if comm.rank == 0:
    choice.out.mkdir(parents=True, exist_ok=True)
    mean, deviation, low, median, high = (
        statistics.of("force_N", name) for name in ("mean", "deviation", "low", "median", "high")
    )
    print(f"{SURFACES} surfaces, {comm.size} rank(s): {spent:.1f} s")
    print("approach [µm]   mean force [N]   deviation   5 … 95 % [N]")
    for row in zip(1e3 * approach, mean, deviation / mean, low, high, strict=True):
        print("{:10.1f} {:16.3f} {:12.0%} {:9.3f} … {:.3f}".format(*row))
    print(f"measured error at the last step, median: {np.median(errors / forces[:, -1]):.1%}")
    figure = Figure(figsize=(7.0, 4.5), layout="constrained")
    axes = figure.subplots()
    x = np.append(0.0, 1e3 * approach)
    axes.plot(x, np.insert(forces[:60], 0, 0.0, axis=1).T, color="0.75", lw=0.6)
    axes.plot([], [], color="0.75", lw=0.6, label=f"{min(60, SURFACES)} of {SURFACES} surfaces")
    low, mean, median, high = (np.append(0.0, values) for values in (low, mean, median, high))
    axes.fill_between(x, low, high, color="C0", alpha=0.25, label="5 to 95 %")
    axes.plot(x, mean, color="C0", lw=2.0, label="mean")
    axes.plot(x, median, color="C0", lw=1.2, ls="--", label="median")
    axes.set(
        xlabel="approach from first touch [µm]",
        ylabel="force [N]",
        xlim=(0.0, x[-1]),
        ylim=(0.0, None),
    )
    axes.legend(loc="upper left", frameon=False)
    figure.savefig(choice.out / "scatter.png", dpi=130)
    assert np.all(np.diff(forces, axis=1) >= 0.0)
    alone = run(scene.with_({"surface.spectrum.seed": 0}))
    np.testing.assert_array_equal(forces[0], alone.force_N)  # a case is what a run of its own is
