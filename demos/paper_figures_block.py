# %% [markdown]
# # The paper's figures, 3: the block (Figures 14 and 15 and the times of section 4.2)
#
# What one learns: how well a flat interface with one law per patch stands for the meshed
# roughness, and what it saves. Waddad et al. 2016 (doi 10.1016/j.triboint.2015.12.023) compare
# with one mesh of 6·10⁵ hexahedra; here the reference states its own error. `index.html`, begun by
# `paper_figures.py`, puts their claims beside what this run finds.
#
# Run time: 2 min. `--quick` for coarse meshes, `--out DIR` for the folder.

# %%
import argparse
import os
import time
from pathlib import Path

import numpy as np
from paper.page import Page

from patchlaw.multiscale import Scene, run
from patchlaw.multiscale.results.figures import style
from patchlaw.multiscale.results.figures.curves import draw_error_band
from patchlaw.multiscale.results.figures.style import colour_bar, draw_pressures

parser = argparse.ArgumentParser()
parser.add_argument("--quick", action="store_true")
parser.add_argument("--out", type=Path, default=Path("results/paper_figures"))
choice = parser.parse_args()
page, INK = Page(choice.out), style.INK
style.use_style()
os.environ["PATCHLAW_CACHE"] = "off"  # times must not depend on earlier runs
PAPER = Path(__file__).parent / "scenes" / "paper.toml"
COMMON = ["output.check=none"]  # the errors are those against the reference
MESHES = ["coupling.kind=reference", "reference.meshes=3"]
if choice.quick:
    COMMON += ["surface.grid=[64, 64]", "block.cells=[8, 8, 6]", "load.steps=2"]
    MESHES[1:] = ["reference.meshes=2", "reference.fine='30 um'"]


def go(*keys, n=16):
    """Run the paper's scene with some keys changed; return history and seconds."""
    start = time.perf_counter()
    history = run(Scene.load(PAPER, [*COMMON, f"patches.grid=[{n}, {n}]", *keys]))
    return history, time.perf_counter() - start


# %% [markdown]
# One surface of Set 1, pressed to 8 µm. Isolated laws are the paper's: circular contacts with
# interaction, each patch alone. Consistent laws come from the whole surface pressed on the block.

# %%
reference, spent = go(*MESHES)
record, ALONE = reference.reference, "coupling.kind=analytic"
runs = {
    "circular, no interaction": go(ALONE, "micro.model=circular-independent"),
    "circular, interaction": go(ALONE, "micro.model=circular"),
    "half-space": go(ALONE, "micro.model=half-space"),
}
runs |= {f"isolated, {n} × {n}": go("coupling.kind=isolated", n=n) for n in (1, 2, 4)}
runs["consistent, 16 × 16"] = go("coupling.kind=consistent", "micro.model=half-space")
truth, bar = float(record.force.value[-1]), float(record.force.error[-1])
error = {name: history.force_N[-1] / truth - 1.0 for name, (history, _) in runs.items()}

# %% [markdown]
# Figure 14: mean pressure over approach.

# %%
figure = style.new_figure(style.FULL_WIDTH, 4.2)
curve = figure.subplots()
curve.plot(1e3 * reference.approach_mm, record.force.value, color=INK, label="reference")
draw_error_band(curve, None, reference, colour=INK)
KINDS = ["analytic"] * 3 + ["isolated"] * 3 + ["consistent"]
for (name, (history, _)), mark, kind in zip(runs.items(), "ds*ov^x", KINDS, strict=True):
    look = {"marker": mark, "color": style.COLOURS[kind], "ls": "--", "lw": 0.8, "label": name}
    curve.plot(1e3 * history.approach_mm, history.mean_pressure_MPa, **look)
curve.set(xlabel="approach [µm]", ylabel="mean pressure [MPa]")
curve.legend()
found = f"against the reference's {truth:.3f} ± {bar:.3f} MPa at 8 µm: "
found += ", ".join(f"{name} {part:+.1%}" for name, part in error.items()) + "."
claim = "too high without interaction, matched with it; patch sizes differ by 0 to 3 %."
page.add("Figure 14", "mean pressure over approach", figure, claim, found)
assert error["circular, interaction"] * truth < -bar < bar < 0.1 * truth
assert abs(error["consistent, 16 × 16"]) < 0.02  # half-space contacts with finite slopes

# %% [markdown]
# Figure 15: patch pressures at 8 µm on one scale.

# %%
maps = {"reference": reference} | {name: history for name, (history, _) in runs.items()}
target = reference.patch_pressure_MPa[-1]
figure = style.new_figure(style.FULL_WIDTH, 3.9)
panels, TOP = figure.subplots(2, 4), 0.5 * target.max()
for axes, (name, history) in zip(panels.flat, maps.items(), strict=True):
    draw_pressures(axes, history.patches, history.patch_pressure_MPa[-1], top=TOP, label="")
    axes.set(title=name, xlabel="", ylabel="", xticks=(0.0, 0.5, 1.0), yticks=(0.0, 0.5, 1.0))
for axes in panels[:, -1]:
    colour_bar(axes.collections[0], axes, "mean pressure [MPa]", extend="max")
figure.supxlabel("x [mm]")
figure.supylabel("y [mm]")
fine = {name: x.patch_pressure_MPa[-1] for name, x in maps.items() if x.patches.count == 256}
alike = {name: np.corrcoef(target, pressure)[0, 1] for name, pressure in fine.items()}
missed = target[fine["circular, interaction"] == 0.0].sum() / target.sum()
shares = ", ".join(f"{name} {value:.3f}" for name, value in list(alike.items())[1:])
found = f"correlation of 16 × 16 patch pressures with the reference's: {shares}"
found += f". Where circular contacts see none (at the border) it carries {missed:.1%} of its force."
found += f" {100 * reference.contact_area_fraction[-1]:.2f} % of the area is in contact."
claim = "more patches resolve the stresses better; about 4 % of the area is in contact."
page.add("Figure 15", "patch pressures at 8 µm", figure, claim, found)
assert alike["consistent, 16 × 16"] > max(0.99, alike["circular, interaction"])

# %% [markdown]
# Times: wall time of everything a run does, meshes, laws and load steps included.

# %%
PAPERS = {"reference, 6·10⁵ hexahedra": 10800.0, "embedded": 900.0, "semi-analytic": 600.0}
rows = [(f"paper: {name}", seconds, "") for name, seconds in PAPERS.items()]
rows.append((f"reference, {record.unknowns[-1]} unknowns", spent, f"(± {bar / truth:.2%})"))
rows += [(name, seconds, f"({error[name]:+.1%})") for name, (_, seconds) in runs.items()]
figure = style.new_figure(style.FULL_WIDTH, 3.4)
axes, colours = figure.subplots(), ["0.7"] * 3 + [INK] + [style.BLUE] * len(runs)
bars = axes.barh([row[0] for row in rows], [row[1] for row in rows], color=colours)
axes.bar_label(bars, [f"{s:.{0 if s > 5 else 2}f} s {part}" for _, s, part in rows], padding=4)
axes.set(xscale="log", xlabel="time [s] (and error of the force)", xlim=(None, 2e5))
axes.invert_yaxis()
edges = ", ".join(f"{1e3 * size:.3g}" for size in record.sizes)
found = f"the reference's tetrahedra have edges of {edges} µm in the contacts, {record.unknowns} "
found += f"unknowns, {spent:.0f} s for all; isolated, 4 × 4: {runs['isolated, 4 × 4'][1]:.1f} s; "
found += f"consistent, 16 × 16: {runs['consistent, 16 × 16'][1]:.1f} s."
claim = "reference 3 h, embedded 15 min, semi-analytic 10 min."
page.add("Section 4.2", "times, one process", figure, claim, found)
