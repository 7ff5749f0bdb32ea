# %% [markdown]
# # How fine a block has to be
#
# What one learns: under the same patch laws, a block of plain finite elements converges slowly,
# for it has to resolve the near field of every loaded patch; a block that is the half-space
# exactly, and finite elements for the smooth rest alone, is there with a few hundred elements.
#
#     plain          u from finite elements, tractions p on the patches
#     decomposed     u = u_half-space (Love 1929) + u_c,  u_c smooth, without load on the top
#
# Run time: five minutes, nearly all for the finest plain mesh; compliances are kept on disk.
# `--quick` for coarse meshes, `--out DIR` for the folder of the figure.

# %%
import argparse
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from multiscale import Scene, run

parser = argparse.ArgumentParser()
parser.add_argument("--quick", action="store_true")
parser.add_argument("--out", type=Path, default=Path("results/block_mesh"))
choice = parser.parse_args()
choice.out.mkdir(parents=True, exist_ok=True)

PAPER = Path(__file__).parent / "scenes" / "paper.toml"
COARSE = [(8, 8, 5), (16, 16, 8)]
MESHES = {
    "decomposed": COARSE if choice.quick else [*COARSE, (16, 16, 12), (24, 24, 16)],
    "finite-element": COARSE if choice.quick else [*COARSE, (32, 32, 16), (64, 64, 24)],
}


# %% [markdown]
# Isolated laws of 4 × 4 patches do not depend on the block: what differs is its compliance alone.


# %%
def force(way: str, cells: tuple[int, int, int]) -> float:
    """Return the force at 8 µm [N]."""
    block = [f"coupling.compliance={way}", f"block.cells={list(cells)}"]
    laws = ["coupling.newton=condensed", "micro.model=elliptic", "load.steps=2"]
    return float(run(Scene.load(PAPER, [*laws, *block])).force_N[-1])


found = {(way, cells): force(way, cells) for way, meshes in MESHES.items() for cells in meshes}
limit = found["decomposed", MESHES["decomposed"][-1]]
print("force at 8 µm [N], and its distance from that on the finest decomposed block")
for (way, cells), value in found.items():
    print(
        "  {:15s} {:3d} × {:2d} × {:2d} {:9.5f} {:+8.3%}".format(
            way, *cells, value, value / limit - 1
        )
    )

# %%
figure = Figure(figsize=(6.0, 4.2), layout="constrained")
axes = figure.subplots()
for mark, (way, meshes) in zip("so", MESHES.items(), strict=True):
    shown = meshes[:-1] if way == "decomposed" else meshes  # its last one is the measure
    error = [100.0 * abs(found[way, cells] / limit - 1.0) for cells in shown]
    axes.loglog([np.prod(cells) for cells in shown], error, mark + "-", label=way)
axes.set(xlabel="number of cells", ylabel="error of the force at 8 µm [%]")
axes.grid(alpha=0.3)
axes.legend(frameon=False)
figure.savefig(choice.out / "block_mesh.png", dpi=130)

# %% [markdown]
# A plain mesh is too stiff below a loaded patch: it carries more force until it is fine.

# %%
plain = [found["finite-element", cells] for cells in MESHES["finite-element"]]
assert np.all(np.diff(plain) < 0.0)
assert abs(found["decomposed", COARSE[1]] / limit - 1.0) < 0.2 * abs(plain[1] / limit - 1.0)
