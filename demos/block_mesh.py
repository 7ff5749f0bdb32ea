# %% [markdown]
# # How fine a block has to be
#
# What one learns: under the same patch laws, a block of plain finite elements converges slowly,
# because it has to resolve the near field of every loaded patch. A block that consists of the
# exact half-space and of what the finite body adds to it, in smooth modes of its face, needs no
# mesh.
#
#     plain          u from finite elements, tractions p on the patches
#     decomposed     u = u_half-space (Love 1929) + Φ D Φᵀ p,  few smooth modes Φ
#
# Run time: 5 min, nearly all for the finest plain mesh; compliances are cached on disk.
# `--quick` for coarse meshes, `--out DIR` for the folder of the figure.

# %%
import argparse
from pathlib import Path

import numpy as np

from patchlaw.geometry import Control
from patchlaw.multiscale import PatchContact, Scene, make_setup, run
from patchlaw.multiscale.results.figures.style import BLUE, ONE_COLUMN, new_figure, use_style

parser = argparse.ArgumentParser()
parser.add_argument("--quick", action="store_true")
parser.add_argument("--out", type=Path, default=Path("results/block_mesh"))
choice = parser.parse_args()
choice.out.mkdir(parents=True, exist_ok=True)

PAPER = Path(__file__).parent / "scenes" / "paper.toml"
MESHES = [(8, 8, 5), (16, 16, 8)]
MESHES += [] if choice.quick else [(32, 32, 16), (64, 64, 24)]


# %% [markdown]
# Isolated laws of 4 × 4 patches do not depend on the block: only its compliance differs.


# %%
def force(*block: str) -> float:
    """Return the force at 8 µm [N]."""
    laws = ["micro.model=elliptic", "load.steps=2"]
    return float(run(Scene.load(PAPER, [*laws, *block])).force_N[-1])


def limit_of_meshes() -> float:
    """Return the same on the half-space and what the block adds to it in smooth modes [N]."""
    coupling = make_setup(Scene.load(PAPER, ["micro.model=elliptic"]))
    solver = PatchContact(coupling.make_laws(), coupling.bodies.patch_compliance())
    return solver.press(Control(approach=8e-3)).force_N


limit = limit_of_meshes()
plain = [force(f"block.cells={list(n)}") for n in MESHES]
print(f"force at 8 µm on the decomposed block: {limit:.5f} N; on plain meshes")
for cells, value in zip(MESHES, plain, strict=True):
    print("  {:3d} × {:2d} × {:2d} {:9.5f} {:+8.3%}".format(*cells, value, value / limit - 1.0))

# %%
use_style()
figure = new_figure(1.3 * ONE_COLUMN, 2.8)
axes = figure.subplots()
sizes = [1e3 / cells[0] for cells in MESHES]  # of elements on the face of 1 mm [µm]
errors = [100.0 * (value / limit - 1.0) for value in plain]
axes.loglog(sizes, errors, "o-", color=BLUE)
for cells, size, error in zip(MESHES, sizes, errors, strict=True):
    axes.text(1.08 * size, error, " × ".join(map(str, cells)), color=BLUE, va="top")
axes.set_xticks(sizes, [f"{size:.3g}" for size in sizes])
axes.minorticks_off()
ticks = [0.5, 1.0, 2.0, 5.0]
axes.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
axes.set(xlim=(0.85 * min(sizes), 1.8 * max(sizes)))
axes.set(xlabel="edge of the elements on the face [µm]", ylabel="force in excess [%]")
ends = [f"{errors[k]:.2g} % with {sizes[k]:.0f} µm" for k in (0, -1)]
figure.savefig(choice.out / "block_mesh.png", metadata={"answer": ", ".join(ends)})

# %% [markdown]
# A plain mesh is too stiff below a loaded patch: it carries more force until it is fine.

# %%
assert np.all(np.diff([*plain, limit]) < 0.0)
assert plain[-1] / limit - 1.0 < (0.05 if choice.quick else 0.005)
