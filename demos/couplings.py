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
# Slopes count as small here, for laws of single patches know no others.
#
# Run time: 10 min. `--quick` for one surface and few patches, `--out DIR` for the folder
# of figure and table, `--data demos/data/couplings.csv` to draw that table again.

# %%
import argparse
from itertools import product
from pathlib import Path

import numpy as np

from patchlaw.geometry import Control
from patchlaw.multiscale import PatchContact, Scene, make_setup, run
from patchlaw.multiscale.results.figures.style import COLOURS, FULL_WIDTH, new_figure, use_style

parser = argparse.ArgumentParser()
parser.add_argument("--quick", action="store_true")
parser.add_argument("--out", type=Path, default=Path("results/couplings"))
parser.add_argument("--data", type=Path)
choice = parser.parse_args()
choice.out.mkdir(parents=True, exist_ok=True)

PAPER = Path(__file__).parent / "scenes" / "paper.toml"
SEEDS = (1,) if choice.quick else (1, 2, 3)
GRIDS = (2,) if choice.quick else (1, 2, 4, 8, 16)
CELLS = 48 if choice.quick else 128
TILTS = {"level plane": 0.0, "plane tilted by 5 µm/mm": 5.0}
ROUGHLY = ["coupling.table_tolerance=1e-3"] if choice.quick else []
COUPLINGS = {
    "consistent": [*ROUGHLY, "coupling.kind=consistent"],
    "isolated": [*ROUGHLY, "coupling.kind=isolated"],
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
            'load.approach=["2 um", "4 um", "8 um"]',
            "load.steps=1",
            f'load.tilt=["{tilt} um/mm", "0 um/mm"]',
            *more,
        ],
    )
    coupling = make_setup(scene)
    if coupling.scene.kind != "isolated":
        return np.array(run(scene).force_N)
    # on a block without the error of a mesh
    solver = PatchContact(coupling.make_laws(), coupling.bodies.patch_compliance())
    planes = [Control(approach=each, tilt=scene.loading.slopes) for each in scene.loading.approach]
    return np.array([solver.press(plane).force_N for plane in planes])


# %% [markdown]
# The reference: concurrent, which has no patches and needs no mesh below them.
def errors():
    """Return the errors, one of each coupling, plane and partition per row, written as a table."""
    planes, alone = product(SEEDS, TILTS.items()), "coupling.kind=concurrent"
    measure = {(seed, name): forces(seed, tilt, 4, alone) for seed, (name, tilt) in planes}
    rows = []
    for keys, (name, tilt), patches in CASES:
        found = [forces(seed, tilt, patches, *keys) / measure[seed, name] for seed in SEEDS]
        rows.append(np.ravel(found) - 1.0)
    text = "errors of the force of each surface at 2, 4, 8 um; rows: coupling, plane, partition"
    np.savetxt(choice.out / "couplings.csv", rows, "%.3e", ",", header=text)
    return np.array(rows)


CASES = list(product(COUPLINGS.values(), TILTS.items(), GRIDS))
table = np.loadtxt(choice.data, delimiter=",") if choice.data else errors()
shape = len(COUPLINGS), len(TILTS), len(GRIDS), -1, 3
worst = np.abs(table).reshape(shape).max(axis=3)  # coupling, plane, partition, approach

# %%
print("largest error of the force over the surfaces, at 2, 4 and 8 µm")
print("| coupling | plane | patches | 2 µm | 4 µm | 8 µm |\n|---|---|---|---|---|---|")
for (coupling, name, patches), found in zip(
    product(COUPLINGS, TILTS, GRIDS), worst.reshape(-1, 3), strict=True
):
    cells = " | ".join(f"{value:.2%}" for value in found)
    print(f"| {coupling} | {name} | {patches} × {patches} | {cells} |")

# %%
use_style()
figure = new_figure(FULL_WIDTH, 2.9)
counts, GREEN, RED = [n**2 for n in GRIDS], COLOURS["consistent"], COLOURS["isolated"]
LOOKS = ("o-", {"c": GREEN}), ("s-", {"c": RED})
for index, (axes, name) in enumerate(zip(figure.subplots(1, 2, sharey=True), TILTS, strict=True)):
    for (mark, look), found in zip(LOOKS, worst[:, index, :, -1], strict=True):
        axes.loglog(counts, 100.0 * found, mark, **look)
    axes.set(title=name, xlabel="number of patches", ylim=(5e-4, 200.0))
    axes.set_xticks(counts, [f"{count}" for count in counts])
    axes.minorticks_off()
    axes.yaxis.set_major_formatter("{x:g}")
left = figure.axes[0]
left.set(ylabel="error of the force at 8 µm [%]")
left.text(1.0, 1.6, "every patch on its own\n(isolated laws)", color=RED)
left.text(1.0, 0.08, "laws of the whole surface\n(consistent)", color=GREEN)
whole, alone = 100.0 * worst[..., -1]
answer = f"within {whole.max():.1f} %, errors of {alone.min():.0f} to {alone.max():.0f} %"
figure.savefig(choice.out / "couplings.png", metadata={"answer": answer})

# %% [markdown]
# Consistent laws reproduce the concurrent solution with any number of patches, because their
# closures are calculated with the compliance of the macro model that uses them.

# %%
# at 4 and 8 µm: forces at 2 µm are less than a tenth of the largest
assert worst[0, ..., 1:].max() < 1e-3
assert worst[1, ..., 1:].max(axis=-1).min() > 1e-3
