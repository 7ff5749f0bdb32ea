# %% [markdown]
# # A thousand rough surfaces on one block
#
# What one learns: how much the force at a given approach scatters between surfaces that agree in
# everything that is usually stated of a rough surface (spectrum, rms gradient, size) and differ
# only in their phases. One deterministic curve, such as the paper's, is one sample.
#
#     block, sides, kernels: once a rank              1000 × { surface → contact problem on the
#                                                       block → 8 load steps → measured error }
#
# Run time: 3 min on one core, half of it under `mpirun -n 2`; every rank takes the next
# surface as it becomes free. From the shell it is `patchlaw sweep … --vary
# surface.spectrum.seed=0..999`. `--quick` for 6 surfaces, `--out DIR` for the folder of figure and
# table, `--data demos/data/scatter.csv` to draw that table, which a run has made, again.

# %%
import argparse
import time
from pathlib import Path

import numpy as np
from mpi4py import MPI

from patchlaw.multiscale import Scene, run, sweep
from patchlaw.multiscale.results.figures.style import BLUE, ONE_COLUMN, new_figure, use_style

parser = argparse.ArgumentParser()
parser.add_argument("--quick", action="store_true")
parser.add_argument("--out", type=Path, default=Path("results/scatter"))
parser.add_argument("--data", type=Path)
choice = parser.parse_args()
choice.out.mkdir(parents=True, exist_ok=True)
comm = MPI.COMM_WORLD
SURFACES = 6 if choice.quick else 1000
PAPER = Path(__file__).parent / "scenes" / "paper.toml"

# %% [markdown]
# The paper's scene with half-space contacts on the paper's cube: Set 1 of its Table 1, here on
# 64 × 64 heights, on which the half-space model is within 1.2 per cent (rms) of its limit
# (accuracy.md, micro models). What finite slopes change is among the measured errors.
KEYS = (
    "coupling.kind=concurrent",
    "micro.model=half-space",
    "micro.finite_slopes=false",  # which lower all curves alike, by 2.5 to 4 %
    "surface.grid=[64, 64]",
)


# %%
def curves():
    """Return the forces of all surfaces [N], written as a table with the approaches above them."""
    scene = Scene.load(PAPER, KEYS)
    found = sweep(scene, {"surface.spectrum.seed": range(SURFACES)}, comm)
    forces, approach, errors = found.force_N, found.approach_mm[0], found.force_error_N[:, -1]
    table = np.vstack([1e3 * approach, forces])
    if comm.rank == 0:
        alone = run(scene.with_({"surface.spectrum.seed": 0}))
        np.testing.assert_array_equal(forces[0], alone.force_N)  # to the last bit
        print(f"measured error at the last step, median: {np.median(errors / forces[:, -1]):.1%}")
        text = "approaches [um] in the first row, forces [N] of a surface in every other"
        np.savetxt(choice.out / "scatter.csv", table, "%.6g", ",", header=text)
    return table


start = time.perf_counter()
approach, *rows = np.loadtxt(choice.data, delimiter=",") if choice.data else curves()
spent = time.perf_counter() - start

# %% [markdown]
# The scatter is largest where few summits touch, and is far from small where many do.

# %%
if comm.rank == 0:
    forces = np.array(rows)
    low, median, high = np.percentile(forces, (5, 50, 95), axis=0)
    mean, deviation = forces.mean(axis=0), forces.std(axis=0, ddof=1)
    print(f"{len(forces)} surfaces, {comm.size} rank(s): {spent:.1f} s")
    print("approach [µm]   mean force [N]   deviation   5 … 95 % [N]")
    for row in zip(approach, mean, deviation / mean, low, high, strict=True):
        print("{:10.1f} {:16.3f} {:12.0%} {:9.3f} … {:.3f}".format(*row))
    use_style()
    figure = new_figure(1.3 * ONE_COLUMN, 3.0)
    axes = figure.subplots()
    zero = np.append(0.0, approach)
    from_zero = [np.append(0.0, values) for values in (low, high, median)]
    axes.plot(zero, np.insert(forces[:60], 0, 0.0, axis=1).T, color="0.72", lw=0.5)
    axes.fill_between(zero, *from_zero[:2], color=BLUE, alpha=0.2, lw=0.0)
    axes.plot(zero, from_zero[2], color=BLUE, lw=2.0)
    right = {"xytext": (4, 0), "textcoords": "offset points", "va": "center"}
    for text, values in (("95 %", high), ("median", median), ("5 %", low)):
        axes.annotate(text, (approach[-1], values[-1]), color=BLUE, **right)
    few = f"grey: {min(60, len(forces))} of {len(forces)} surfaces"
    axes.text(0.03, 0.95, few, transform=axes.transAxes, color="0.4", va="top")
    axes.set(xlim=(0.0, approach[-1]), ylim=(0.0, 1.5 * high[-1]))
    axes.set(xlabel="approach from first touch [µm]", ylabel="mean pressure [MPa]")
    answer = f"between {low[-1]:.1f} and {high[-1]:.1f} MPa"
    figure.savefig(choice.out / "scatter.png", metadata={"answer": answer})
    assert np.all(np.diff(forces, axis=1) >= 0.0)
    assert high[-1] > 2.0 * low[-1] or choice.quick
