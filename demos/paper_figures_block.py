# %% [markdown]
# # The paper's figures, 3: the block (Figures 14 and 15 and the times of section 4.2)
#
# What one learns: how well a flat interface with one law per patch stands for the meshed
# roughness, and what it saves. Waddad et al. 2016 (doi 10.1016/j.triboint.2015.12.023) compare
# with one mesh of 6·10⁵ hexahedra; here the reference states its own error. `index.html` puts
# their claims beside what this run finds; `paper_figures.py` begins the page.
#
# Run time: two minutes. `--quick` for coarse meshes, `--out DIR` for the folder.

# %%
import argparse
import time
from pathlib import Path

import numpy as np
from matplotlib.colors import PowerNorm
from matplotlib.figure import Figure
from paper.page import Page

from multiscale import Scene, run
from multiscale.figures import draw_error_band

parser = argparse.ArgumentParser()
parser.add_argument("--quick", action="store_true")
parser.add_argument("--out", type=Path, default=Path("results/paper_figures"))
choice = parser.parse_args()
page = Page(choice.out)
PAPER = Path(__file__).parent / "scenes" / "paper.toml"
GRIDS = (1, 2, 4)
COMMON = ["load.steps=4"]
MESHES = ["coupling.kind=reference", "reference.mesh=tetrahedra", "reference.meshes=3"]
if choice.quick:
    COMMON = ["surface.grid=[64, 64]", "block.cells=[8, 8, 6]", "load.steps=2"]
    MESHES[2:] = ["reference.meshes=2", "reference.fine='20 um'"]


def go(*keys, patches=16):
    """Run the paper's scene with some keys changed; return history and seconds."""
    start = time.perf_counter()
    grid = f"patches.grid=[{patches}, {patches}]"
    history = run(Scene.load(PAPER, [*COMMON, grid, *keys]))
    return history, time.perf_counter() - start


# %% [markdown]
# One surface of Set 1, pressed to 8 µm. Isolated laws are the paper's: circular contacts with
# interaction, each patch alone. Consistent laws come from one solution of the whole surface.

# %%
reference, spent = go(*MESHES)
record = reference.reference
HALF_SPACE = ("micro.model=half-space",)
runs = {
    "circular without interaction": go(
        "coupling.kind=analytic", "micro.model=circular-independent"
    ),
    "circular with interaction": go("coupling.kind=analytic", "micro.model=circular"),
    "half-space": go("coupling.kind=analytic", *HALF_SPACE),
}
for n in GRIDS:
    runs[f"isolated, {n} × {n}"] = go("coupling.kind=isolated", patches=n)
runs["consistent, 16 × 16"] = go("coupling.kind=consistent", *HALF_SPACE)
truth, bar = float(record.force.value[-1]), float(record.force.error[-1])
error = {name: history.force_N[-1] / truth - 1.0 for name, (history, _) in runs.items()}

# %% [markdown]
# Figure 14: mean pressure over approach.

# %%
figure = Figure(figsize=(8.6, 5.2), layout="constrained")
curve = figure.subplots()
approach = 1e3 * reference.approach_mm
curve.plot(approach, record.force.value, "k", lw=2.5)
draw_error_band(curve, None, reference, colour="black")
LOOKS = ("s:#edae49", "d:#b07d00", "*:#0b3c5d", "o:#d1495b", "v:#8c2f39", "^:#e98a96", "x:#1b998b")
for (name, (history, _)), look in zip(runs.items(), LOOKS, strict=True):
    style = {"marker": look[0], "color": look[2:], "ls": "--", "lw": 1.0, "label": name}
    curve.plot(approach, history.mean_pressure_MPa, **style)
curve.set(xlabel="approach [µm]", ylabel="mean pressure [MPa]")
curve.grid(alpha=0.3)
curve.legend(frameon=False)
found = f"against the reference's {truth:.3f} ± {bar:.3f} MPa at 8 µm: "
found += ", ".join(f"{name} {part:+.1%}" for name, part in error.items()) + "."
claim = "without interaction the pressure is too high; with it the micro model matches the "
claim += "reference; patches change the embedded pressure by 0 to 3 %."
page.add(14, "mean pressure over approach", figure, claim, found)
assert bar < 0.1 * truth
assert abs(error["consistent, 16 × 16"]) < (0.15 if choice.quick else 0.06)

# %% [markdown]
# Figure 15: patch pressures at 8 µm on one scale.

# %%
maps = {"reference": reference} | {name: runs[name][0] for name in list(runs)[1:]}
top = reference.patch_pressure_MPa[-1].max()
figure = Figure(figsize=(13.0, 6.2), layout="constrained")
panels = figure.subplots(2, 4, sharex=True, sharey=True)
for axes, (name, history) in zip(panels.flat, maps.items(), strict=False):
    patches, pressure = history.patches, history.patch_pressure_MPa[-1]
    shown = np.where(pressure > 0.0, pressure, np.nan).reshape(patches.grid).T  # open: white
    image = axes.pcolormesh(
        patches.borders_x, patches.borders_y, shown, cmap="magma_r", norm=PowerNorm(0.5, 0.0, top)
    )
    axes.set(title=name, aspect="equal", xticks=(0.0, 0.5, 1.0), yticks=(0.0, 0.5, 1.0))
