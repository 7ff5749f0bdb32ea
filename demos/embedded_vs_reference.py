# %% [markdown]
# # Embedded roughness against the meshed one
#
# What one learns: how far models whose mesh does not resolve the roughness are from finite
# elements of the rough surface itself, and why. This is Fig. 14 and 15 of Waddad et al. 2016 (doi
# 10.1016/j.triboint.2015.12.023), with a reference that states its own discretisation error.
#
#     F(embedded) / F(reference) = finite slopes × finite block × coupling × what is left
#
# Asperity models and isolated laws are limits of small slopes; half-space contacts of the other
# couplings count finite ones in their compliance. What slopes change in the reference is seen with
# heights and approach ten times smaller, on the same meshes: their own error cancels.
#
# Run time: 2 min. `--quick` for coarse meshes, `--out DIR` for the figure's folder.

# %%
import argparse
from pathlib import Path

import numpy as np
from matplotlib.colors import PowerNorm

from patchlaw.multiscale import History, Scene, run
from patchlaw.multiscale.results.figures import style

parser = argparse.ArgumentParser()
parser.add_argument("--quick", action="store_true")
parser.add_argument("--out", type=Path, default=Path("results/embedded_vs_reference"))
choice = parser.parse_args()
choice.out.mkdir(parents=True, exist_ok=True)

PAPER = Path(__file__).parent / "scenes" / "paper.toml"
GRIDS = (2, 4, 8) if choice.quick else (4, 8, 16)
COMMON = ["output.check=none", "surface.grid=[128, 128]", "block.cells=[24, 24, 12]"]
MESHES = ["coupling.kind=reference", "reference.meshes=3"]
if choice.quick:
    COMMON[1:] = ["surface.grid=[64, 64]", "block.cells=[8, 8, 6]", "load.steps=2"]
    MESHES[1:] = ["reference.meshes=2", "reference.fine='30 um'"]
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
models["asperities"] = go("coupling.kind=analytic", "micro.model=circular")
models["concurrent"] = go("coupling.kind=concurrent", HALF_SPACE)
flat = float(go("coupling.kind=concurrent", HALF_SPACE, SMALL).force_N[-1])
models["consistent"] = go("coupling.kind=consistent", HALF_SPACE)
isolated = {n: f"{n**2} patches, each alone" for n in GRIDS}
for n, name in isolated.items():
    models[name] = go("coupling.kind=isolated", HALF_SPACE, patches=n)

# %% [markdown]
# The difference of every model to the reference, and its parts, at the largest approach. What
# slopes change is proportional to them: a ninth more leads from a tenth of the heights to none.

# %%
record, small = reference.reference, shallow.reference
truth, tenth = float(record.force.value[-1]), 10.0 * float(small.force.value[-1])
final = {name: float(history.force_N[-1]) for name, history in models.items()}
print(f"reference at 8 µm: {truth:.4f} N {record.label}, {record.unknowns} unknowns")
for name, force in final.items():
    print(f"  {name:36s} {force:8.4f} N  {force / truth - 1.0:+7.1%}")
parts = {
    "half-space instead of the block": final["half-space"] / final["concurrent"] - 1.0,
    "small slopes, meshed": (10.0 * tenth - truth) / 9.0 / truth - 1.0,
    "small slopes, concurrent": flat / final["concurrent"] - 1.0,
    "laws of the whole surface": final["consistent"] / final["concurrent"] - 1.0,
    **{name: final[name] / flat - 1.0 for name in isolated.values()},  # of small slopes, too
    "finest mesh of the reference": record.force.meshes[-1, -1] / truth - 1.0,
    "what is left, concurrent": final["concurrent"] / truth - 1.0,
}
print("\n".join(f"  part: {name:30s} {part:+8.2%}" for name, part in parts.items()))

# %%
style.use_style()
figure = style.new_figure(style.FULL_WIDTH, 5.0)
upper, lower = figure.subfigures(2, 1, height_ratios=(1.25, 1.0))
apart, split = upper.subplots(1, 2, width_ratios=(1.5, 1.0))
approach, value = 1e3 * reference.approach_mm, record.force.value
bar = 100 * record.force.error / value
apart.fill_between(approach, -bar, bar, **style.ERROR_BAND)
apart.text(1.1, 29.0, "grey: error bar of the reference;\nhollow: within it", color="0.4")
FIRST, *_, LAST = isolated.values()
for name, mark, colour, up in (  # and by how much the name stands above the end of its curve
    ("half-space", "o", style.COLOURS["analytic"], 0),
    ("asperities", "D", style.ORANGE, -7),
    (FIRST, "s", style.COLOURS["isolated"], 2),
    (LAST, "s", style.COLOURS["isolated"], 0),
    ("consistent", "o", style.COLOURS["consistent"], -5),
    ("concurrent", "^", style.COLOURS["concurrent"], 4),
):
    error = 100 * (models[name].force_N / value - 1.0)
    apart.plot(approach, error, color=colour)
    fills = np.where(np.abs(error) < bar, "white", colour)  # nobody knows what is true there
    apart.scatter(approach, error, 18.0, fills, mark, edgecolors=colour, zorder=3)
    beside = {"textcoords": "offset points", "va": "center", "color": colour}
    apart.annotate(name, (approach[-1], error[-1]), (7, up), **beside)
apart.set(xlabel="approach [µm]", ylabel="force off the reference [%]", ymargin=0.08)
seen = {name: 100 * part for name, part in parts.items() if abs(100 * part) > bar[-1]}
bars = split.barh(list(seen), list(seen.values()), color=style.BLUE)
split.bar_label(bars, fmt="%+.1f", padding=3)
split.set(xlabel="change of the force [%]", xmargin=0.2, ylim=(len(seen) - 0.4, -0.6))
MAPS = {"roughness meshed": reference, "consistent laws": models["consistent"], LAST: models[LAST]}
scale = PowerNorm(0.5, vmin=0.0, vmax=reference.patch_pressure_MPa[-1].max())
for axes, (name, history) in zip(lower.subplots(1, len(MAPS)), MAPS.items(), strict=True):
    halves = (GRIDS[-1], history.patches.grid[0] // GRIDS[-1])
    pressure = history.patch_pressure_MPa[-1].reshape(halves * 2).mean(axis=(1, 3)).T
    style.map_axes(axes, history.patches.lengths)
    borders = reference.patches.borders_x, reference.patches.borders_y
    shown = np.ma.masked_equal(pressure, 0.0)  # open patches stay white
    image = axes.pcolormesh(*borders, shown, cmap=style.PRESSURES, norm=scale)
    axes.set(title=name)
style.colour_bar(image, axes, "mean pressure [MPa] (square-root scale)", extend="max")
off = [100 * abs(final[name] / truth - 1.0) for name in ("concurrent", "half-space", LAST)]
answer = "together err by {:.1f} %, a half-space by {:.0f} %, on its own by {:.0f} %".format(*off)
figure.savefig(choice.out / "embedded_vs_reference.png", metadata={"answer": answer})
assert abs(parts["what is left, concurrent"]) < (0.02 if choice.quick else 0.01)
assert 0.01 < parts["small slopes, meshed"] < 0.06
