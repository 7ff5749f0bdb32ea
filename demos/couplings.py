# %% [markdown]
# # Couplings against each other: how many patches, how tilted a plane
#
# What one learns: what each coupling of contacts and block costs in accuracy, on the paper's cube
# with Set 1 surfaces. `concurrent` solves contacts and block together and serves as the measure;
# `consistent` tabulates all patches from one solution of the whole surface; `isolated` takes every
# patch alone, as Waddad et al. 2016 (doi 10.1016/j.triboint.2015.12.023) do.
#
#     error of the force  =  F(coupling) / F(concurrent) − 1
#
# Slopes count as small here, for laws of single patches know no others: forces scale with heights
# and approach together, and the table holds for heights ten times smaller too.
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
GRIDS = (2,) if choice.quick else (1, 2, 4, 8, 16)
CELLS = 48 if choice.quick else 128
TILTS = {"level": 0.0, "tilted by 5 µm/mm": 5.0}
CONSISTENT = ["coupling.kind=consistent"]
ISOLATED = ["coupling.kind=isolated", "coupling.compliance=decomposed"]
if choice.quick:
    CONSISTENT += ["coupling.table_tolerance=1e-3"]
    ISOLATED += ["coupling.table_tolerance=1e-2"]
COUPLINGS = {
    "consistent": CONSISTENT,
    "consistent, plain mesh": [*CONSISTENT, "coupling.compliance=finite-element"],
    "isolated": ISOLATED,
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
            "micro.finite_slopes=false",
            "output.check=none",
            "block.cells=[16, 16, 8]",  # of the plain mesh; other blocks have none
            'load.approach=["2 um", "4 um", "8 um"]',
            "load.steps=1",
            f'load.tilt=["{tilt} um/mm", "0 um/mm"]',
            *more,
        ],
    )
    return np.array(run(scene).force_N)


# %% [markdown]
# The measure: concurrent, which knows of no patches and needs no mesh under them.

# %%
measure = {
    (seed, name): forces(seed, tilt, 4, "coupling.kind=concurrent")
    for seed in SEEDS
    for name, tilt in TILTS.items()
}
rows = []
for coupling, keys in COUPLINGS.items():
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
    for mark, coupling in zip("ov^", COUPLINGS, strict=True):
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
# Consistent laws find the concurrent solution again with any number of patches and on any mesh, as
# their closures count in the compliance of the macro model that they are for.

# %%
# at 4 and 8 µm: forces at 2 µm are less than a tenth of the largest
errors = {tuple(key): np.abs(error[:, 1:]).max() for *key, error in rows}
assert max(error for key, error in errors.items() if key[0] != "isolated") < 1e-3
assert min(error for key, error in errors.items() if key[0] == "isolated") > 1e-3
