# %% [markdown]
# # Couplings against each other: how many patches, how fine a block, how tilted a plane
#
# What one learns: what each coupling of contacts and block costs in accuracy, on the paper's cube
# with Set 1 surfaces. `concurrent` solves contacts and block together and serves as the measure;
# `consistent` tabulates all patches from one solution of the whole surface; `isolated` takes every
# patch alone, as Waddad et al. 2016 (doi 10.1016/j.triboint.2015.12.023) do.
#
#     error of the force  =  F(coupling) / F(concurrent, finer block, finer loads) − 1
#
# All of these are models of small slopes: forces scale with heights and approach together, so the
# table holds for heights ten times smaller too, where a meshed rough block tends to the same.
#
# Run time: about ten minutes; compliances are kept on disk and make it shorter the second time.
# `--quick` for one surface and few patches, `--out DIR` for the folder of the figures.

# %%
import argparse
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from multiscale import Scene, run

parser = argparse.ArgumentParser()
parser.add_argument("--quick", action="store_true")
parser.add_argument("--out", type=Path, default=Path("results/couplings"))
choice = parser.parse_args()
choice.out.mkdir(parents=True, exist_ok=True)

PAPER = Path(__file__).parent / "scenes" / "paper.toml"
SEEDS = (1,) if choice.quick else (1, 2, 3)
GRIDS = (2, 4) if choice.quick else (1, 2, 4, 8, 16)
CELLS = 64 if choice.quick else 128
TILTS = {"level": 0.0, "tilted by 5 µm/mm": 5.0}
COUPLINGS = {
    "consistent": ["coupling.kind=consistent"],
    "consistent, plain mesh": [
        "coupling.kind=consistent",
        "coupling.compliance=finite-element",
        "block.cells=[16, 16, 8]",
    ],
    "isolated": ["coupling.kind=isolated", "coupling.compliance=decomposed"],
}


# %%
def forces(seed: int, tilt: float, patches: int, *more: str) -> np.ndarray:
    """Return the forces at 2, 4 and 8 µm [N]."""
    scene = Scene.load(
        PAPER,
        [
            f"surface.spectrum.seed={seed}",
            f"surface.grid=[{CELLS}, {CELLS}]",
            f"patches.grid=[{patches}, {patches}]",
            "micro.model=half-space",
            "block.cells=[16, 16, 8]",
            'load.approach=["2 um", "4 um", "8 um"]',
            "load.steps=1",
            f'load.tilt=["{tilt} um/mm", "0 um/mm"]',
            *more,
        ],
    )
    return np.array(run(scene).force_N)


# %% [markdown]
# The measure: concurrent on a finer block, with contacts gathered on a finer grid of loads. Beside
# it the concurrent coupling as it comes.

# %%
FINER = [] if choice.quick else ["block.cells=[24, 24, 12]"]
measure = {
    (seed, name): forces(seed, tilt, 4 if choice.quick else 16, "coupling.kind=concurrent", *FINER)
    for seed in SEEDS
    for name, tilt in TILTS.items()
}
rows = []
for coupling, keys in {"concurrent": ["coupling.kind=concurrent"], **COUPLINGS}.items():
    for name, tilt in TILTS.items():
        for patches in GRIDS:
            found = np.array([forces(seed, tilt, patches, *keys) for seed in SEEDS])
            error = found / np.array([measure[seed, name] for seed in SEEDS]) - 1.0
            rows.append((coupling, name, patches, error))

# %% [markdown]
# One table: the largest error over the surfaces at each approach.

# %%
print("largest error of the force over the surfaces, at 2, 4 and 8 µm")
print("| coupling | plane | patches | 2 µm | 4 µm | 8 µm |")
print("|---|---|---|---|---|---|")
for coupling, name, patches, error in rows:
    cells = " | ".join(f"{value:.2%}" for value in np.abs(error).max(axis=0))
    print(f"| {coupling} | {name} | {patches} × {patches} | {cells} |")

# %%
figure = Figure(figsize=(9.0, 4.2), layout="constrained")
for axes, name in zip(figure.subplots(1, 2, sharey=True), TILTS, strict=True):
    for mark, coupling in zip("sov^", ["concurrent", *COUPLINGS], strict=True):
        picked = [row for row in rows if row[:2] == (coupling, name)]
        counts = [patches**2 for _, _, patches, _ in picked]
        worst = [100.0 * np.abs(error[:, -1]).max() for *_, error in picked]
        axes.loglog(counts, np.maximum(worst, 1e-2), mark + "-", label=coupling, base=10)
    axes.set(title=f"{name}, 8 µm", xlabel="number of patches")
    axes.set_xticks([patches**2 for patches in GRIDS], [f"{p**2}" for p in GRIDS])
    axes.minorticks_off()
    axes.grid(alpha=0.3)
    axes.set_yticks([0.01, 0.1, 1.0, 10.0, 100.0], ["≤ 0.01", "0.1", "1", "10", "100"])
figure.axes[0].set_ylabel("largest error of the force [%]")
figure.axes[0].legend(frameon=False)
figure.savefig(choice.out / "couplings.png", dpi=130)

# %% [markdown]
# The block's mesh: the half-space exactly and finite elements for the rest, against finite elements
# for everything. Consistent laws of 4 × 4 patches in both.

# %%
coarse = [(8, 8, 5), (16, 16, 8)]
by_way = {
    "decomposed": coarse if choice.quick else [*coarse, (24, 24, 12)],
    "finite-element": coarse if choice.quick else [*coarse, (32, 32, 16), (64, 64, 24)],
}
print("force at 8 µm with isolated laws of 4 × 4 patches [N]")
found = {}
for way, meshes in by_way.items():
    for cells in meshes:
        laws = ["coupling.kind=isolated", f"coupling.compliance={way}"]
        more = [*laws, "coupling.newton=condensed", f"block.cells={list(cells)}"]
        found[way, cells] = forces(SEEDS[0], 0.0, 4, *more)[-1]
        print("  {:15s} {:3d} × {:2d} × {:2d} {:9.5f}".format(way, *cells, found[way, cells]))

# %%
figure = Figure(figsize=(5.5, 4.2), layout="constrained")
axes = figure.subplots()
limit = found["decomposed", by_way["decomposed"][-1]]
for mark, (way, meshes) in zip("so", by_way.items(), strict=True):
    shown = meshes[:-1] if way == "decomposed" else meshes  # its last one is the measure
    error = [100.0 * abs(found[way, cells] / limit - 1.0) for cells in shown]
    axes.loglog([np.prod(cells) for cells in shown], error, mark + "-", label=way)
axes.set(xlabel="number of hexahedra", ylabel="error of the force at 8 µm [%]")
axes.grid(alpha=0.3)
axes.legend(frameon=False)
figure.savefig(choice.out / "block_mesh.png", dpi=130)

# %% [markdown]
# The concurrent coupling does not know of patches; consistent laws come close to it with any
# number of them, as they know how the plane leans and where the contacts are.

# %%
errors = {(coupling, name, patches): np.abs(error).max() for coupling, name, patches, error in rows}
for name in TILTS:
    assert errors["consistent", name, GRIDS[-1]] < 0.03
    assert errors["consistent", name, GRIDS[-1]] < errors["isolated", name, GRIDS[-1]]
