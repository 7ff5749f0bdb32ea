# %% [markdown]
# # From a half-space to a block, and back
#
# What one learns: the contact law of one patch, put on the flat interface of an elastic block,
# reproduces the micro model that made it when the block is large compared with the interface.
# Love's correction of the closure exists for this consistency (Waddad et al. 2016, eq. 31, doi
# 10.1016/j.triboint.2015.12.023). A cube of the interface's own size comes close to it only by a
# coincidence of its free sides and its clamped bottom.
#
#     ╔═ rigid plane ═╗          find u:  ∫ σ(u) : ε(v) dx = −∫ p(c) v_z ds   on the interface,
#       ┌┄┄┄┄┄┄┄┄┄┄┄┐              c = δ − ū,  ū = mean of −u_z over the patch,  p(c) the law
#     ──┴───────────┴──  z = 0
#     │    block      │   width and height: ratio × interface
#     └───────────────┘   clamped
#
# Run time: 25 s. `--quick` for fewer blocks, `--out DIR` for the folder of the figure.

# %%
import argparse
from pathlib import Path

import numpy as np
from matplotlib import colormaps

from patchlaw.multiscale import Scene, run
from patchlaw.multiscale.results.figures.style import INK, ONE_COLUMN, new_figure, use_style

parser = argparse.ArgumentParser()
parser.add_argument("--quick", action="store_true")
parser.add_argument("--out", type=Path, default=Path("results/large_block"))
choice = parser.parse_args()
choice.out.mkdir(parents=True, exist_ok=True)

PAPER = Path(__file__).parent / "scenes" / "paper.toml"
COMMON = ["patches.grid=[1, 1]", f"load.steps={2 if choice.quick else 8}"]
CELLS = 8 if choice.quick else 16
RATIOS = (1, 8) if choice.quick else (1, 2, 4, 8, 16)

# %% [markdown]
# The micro model alone, on a half-space: no finite elements take part.

# %%
half_space = run(Scene.load(PAPER, [*COMMON, "coupling.kind=analytic"]))
print(f"half-space: {half_space.force_N[-1]:.5f} N at {1e3 * half_space.approach_mm[-1]:g} µm")

# %% [markdown]
# The same law embedded in blocks of growing size, their meshes graded away from the interface.

# %%
histories = {}
for ratio in RATIOS:
    scene = Scene.load(
        PAPER,
        [
            *COMMON,
            f"block.cells=[{CELLS}, {CELLS}, 12]",
            f"block.height={ratio} mm",
            f"block.margin={(ratio - 1) / 2} mm",
            f"block.grading={4 * ratio}",
            f"block.margin_grading={2 * ratio}",
        ],
    )
    histories[ratio] = run(scene)
    error = histories[ratio].force_N[-1] / half_space.force_N[-1] - 1
    print(f"block {ratio:2d} × the interface: {histories[ratio].force_N[-1]:.5f} N, {error:+.2%}")

# %%
use_style()
figure = new_figure(1.3 * ONE_COLUMN, 3.2)
axes, approach = figure.subplots(), 1e3 * half_space.approach_mm
shades = colormaps["viridis"](np.linspace(0.85, 0.0, len(RATIOS)))
beside = {"xytext": (6, 0), "textcoords": "offset points", "va": "center"}
for (ratio, history), colour in zip(histories.items(), shades, strict=True):
    change = 100 * (history.force_N / half_space.force_N - 1)
    axes.plot(approach, change, "o-", color=colour)
    text = "a cube" if ratio == 1 else f"{ratio} times as large"
    # the curves of the two largest blocks nearly coincide
    beside["xytext"] = 6, {8: 1, 16: -7}.get(ratio, 0)
    axes.annotate(text, (approach[-1], change[-1]), color=colour, **beside)
axes.axhline(0.0, color=INK, lw=0.8)
axes.set(xlabel="approach [µm]", ylabel="force against the half-space [%]")

# %% [markdown]
# What remains is the block's size, about 1/ratio, and the mesh of the interface: linear elements
# resolve the pressure's jump at the patch's border to a few tenths of a per cent.

# %%
largest = histories[RATIOS[-1]].force_N[-1] / half_space.force_N[-1] - 1
about = {"answer": f"within {100 * abs(largest):.1f} %"}
figure.savefig(choice.out / "large_block.png", metadata=about)
assert abs(largest) < 0.008, largest
