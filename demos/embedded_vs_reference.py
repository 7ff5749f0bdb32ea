# %% [markdown]
# # Embedded roughness against the meshed one
#
# What one learns: how far models whose mesh knows nothing of the roughness are from finite elements
# of the rough surface itself, and why. This is Fig. 14 and 15 of Waddad et al. 2016 (doi
# 10.1016/j.triboint.2015.12.023), with a reference that states its own discretisation error.
#
#     F(embedded) / F(reference) = finite slopes × finite block × coupling × what is left
#
# Asperity models and isolated laws are limits of small slopes; half-space contacts of the other
# couplings count finite ones in their compliance. What slopes change in the reference is seen with
# heights and approach ten times smaller, on the same meshes: their own error cancels.
#
# Run time: two minutes. `--quick` for coarse meshes, `--out DIR` for the figure's folder.

# %%
import argparse
from pathlib import Path

import numpy as np
from matplotlib.colors import PowerNorm
from matplotlib.figure import Figure

from micro import MODELS
from multiscale import History, Scene, run

parser = argparse.ArgumentParser()
parser.add_argument("--quick", action="store_true")
parser.add_argument("--out", type=Path, default=Path("results/embedded_vs_reference"))
choice = parser.parse_args()
choice.out.mkdir(parents=True, exist_ok=True)

PAPER = Path(__file__).parent / "scenes" / "paper.toml"
GRIDS = (2, 4, 8) if choice.quick else (4, 8, 16)
COMMON = ["output.check=none", "surface.grid=[128, 128]", "block.cells=[24, 24, 12]"]
MESHES = ["coupling.kind=reference", "reference.mesh=tetrahedra", "reference.meshes=3"]
if choice.quick:
    COMMON[1:] = ["surface.grid=[64, 64]", "block.cells=[8, 8, 6]", "load.steps=2"]
    MESHES[2:] = ["reference.meshes=2", "reference.fine='20 um'"]
HALF_SPACE, SMALL = "micro.model=half-space", "micro.finite_slopes=false"


def go(*keys: str, patches: int = GRIDS[-1]) -> History:
    """Run the paper's scene with some keys changed."""
    return run(Scene.load(PAPER, [*COMMON, f"patches.grid=[{patches}, {patches}]", *keys]))


# %% [markdown]
# The reference, true and with a tenth of the heights; then models of the half-space, and those of
# the block: all contacts at once (concurrent, with finite slopes and with small ones), or by one
# law per patch (isolated ones on a plain mesh).

# %%
reference = go(*MESHES)
shallow = go(*MESHES, "surface.spectrum.rms_slope=0.0215", "load.approach='0.8 um'")
models = {"half-space": go("coupling.kind=analytic", HALF_SPACE)}
for name in MODELS:
    models[f"half-space, {name}"] = go("coupling.kind=analytic", f"micro.model={name}")
models["concurrent"] = go("coupling.kind=concurrent", HALF_SPACE)
flat = float(go("coupling.kind=concurrent", HALF_SPACE, SMALL).force_N[-1])
for kind in ("consistent", "isolated"):
    for n in GRIDS:
        models[f"{kind}, {n} × {n}"] = go(f"coupling.kind={kind}", HALF_SPACE, patches=n)

# %% [markdown]
# The difference of every model to the reference, and its parts, at the largest approach. What
# slopes change is proportional to them: a ninth more leads from a tenth of the heights to none.

# %%
record, small = reference.reference, shallow.reference
truth, tenth = float(record.force.value[-1]), 10.0 * float(small.force.value[-1])
limit = tenth + (tenth - truth) / 9.0
final = {name: float(history.force_N[-1]) for name, history in models.items()}
print(f"reference at 8 µm: {truth:.4f} N {record.label}, {record.unknowns} unknowns")
for name, force in final.items():
    print(f"  {name:36s} {force:8.4f} N  {force / truth - 1.0:+7.1%}")
parts = {
    "finest mesh": record.force_N[-1, -1] / truth - 1.0,
    "finite slopes": limit / truth - 1.0,
    "finite slopes, concurrent": flat / final["concurrent"] - 1.0,
    "left: concurrent": final["concurrent"] / truth - 1.0,
    "no finite block": final["half-space"] / final["concurrent"] - 1.0,
}
coupled = [name for name in models if "×" in name]
for name in coupled:  # each beside the contact problem with slopes such as its own
    parts[name] = final[name] / (flat if "isolated" in name else final["concurrent"]) - 1.0
for name, part in parts.items():
    print(f"  part: {name:30s} {part:+8.2%}")

# %%
figure = Figure(figsize=(14.0, 8.6), layout="constrained")
upper, lower = figure.subfigures(2, 1, height_ratios=(1.5, 1.0))
curve, apart, split = upper.subplots(1, 3)
approach, value = 1e3 * reference.approach_mm, record.force.value
bar, band = 100 * record.force.error / value, {"color": "0.75", "lw": 0}
curve.fill_between(approach, value * (1 - bar / 100), value * (1 + bar / 100), **band)
curve.plot(approach, value, "k", lw=2.5, label=f"reference, {record.label}")
apart.fill_between(approach, -bar, bar, **band)
COLOURS = {"half-space": "#0b3c5d", "half-space,": "#edae49", "concurrent": "#1b998b"}
COLOURS |= {"consistent,": "#6a4c93", "isolated,": "#d1495b"}
for (name, history), mark in zip(models.items(), "*sdv^osdvsdv", strict=False):
    look = {"color": COLOURS[name.split()[0]], "marker": mark, "label": name}
    look |= {"ls": ":", "mfc": "none", "ms": 10.0 if name == "concurrent" else 6.0}
    curve.plot(approach, history.mean_pressure_MPa, **look)
    apart.plot(approach, 100 * (history.force_N / value - 1.0), **look)
curve.set(xlabel="approach [µm]", ylabel="mean pressure [MPa]", ylim=(0.0, None))
curve.legend(frameon=False, fontsize=8)
apart.set(xlabel="approach [µm]", ylabel="force against the reference, grey its error bar [%]")
bars = split.barh(list(parts), [100 * part for part in parts.values()], color="#0b3c5d")
split.bar_label(bars, fmt="%+.2f", padding=3, fontsize=9)
split.set(xlabel="part of the difference at 8 µm [%]", xmargin=0.2)
split.invert_yaxis()
for axes in (curve, apart, split):
    axes.grid(alpha=0.3)
seen = ("half-space", "concurrent", coupled[len(GRIDS) - 1], coupled[-1])
maps = {"reference": reference} | {name: models[name] for name in seen}
BORDERS = reference.patches.borders_x, reference.patches.borders_y
SHADES = PowerNorm(0.5, vmin=0.0, vmax=reference.patch_pressure_MPa[-1].max())
panels = lower.subplots(1, len(maps), sharey=True)
for axes, (name, history) in zip(panels, maps.items(), strict=True):
    halves = (GRIDS[-1], history.patches.grid[0] // GRIDS[-1])
    pressure = history.patch_pressure_MPa[-1].reshape(halves * 2).mean(axis=(1, 3)).T
    pressure[pressure == 0.0] = np.nan  # open patches stay white
    image = axes.pcolormesh(*BORDERS, pressure, cmap="magma_r", norm=SHADES)
    axes.set(title=name, xlabel="x [mm]", aspect="equal", xticks=(0.0, 0.5, 1.0))
panels[0].set_ylabel("y [mm]")
lower.colorbar(image, ax=panels, label="patch pressure at 8 µm [MPa]", extend="max", shrink=0.75)
figure.savefig(choice.out / "embedded_vs_reference.png", dpi=110)
assert abs(parts["left: concurrent"]) < (0.02 if choice.quick else 0.01)
assert 0.01 < parts["finite slopes"] < 0.06
