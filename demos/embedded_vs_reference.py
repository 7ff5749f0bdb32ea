# %% [markdown]
# # Embedded roughness against the meshed one
#
# What one learns: how far models whose mesh knows nothing of the roughness are from finite elements
# of the rough surface itself, and where the difference comes from. This is Fig. 14 and Fig. 15 of
# Waddad et al. 2016 (doi 10.1016/j.triboint.2015.12.023) for a Set 1 surface, with a reference
# that states its own discretisation error: without it one tunes one error against another.
#
#     F(embedded) / F(reference) = discretisation × finite slopes × finite block × coupling
#
# Half-spaces and flat interfaces are limits of small slopes. What finite slopes change is seen
# with heights and approach ten times smaller, on the same meshes: their own error cancels.
#
# Run time: about five minutes. `--quick` for coarse meshes, `--out DIR` for the figure's folder.

# %%
import argparse
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from micro import MODELS, finite_slope_effect
from multiscale import History, Scene, make_stage, run

parser = argparse.ArgumentParser()
parser.add_argument("--quick", action="store_true")
parser.add_argument("--out", type=Path, default=Path("results/embedded_vs_reference"))
choice = parser.parse_args()
choice.out.mkdir(parents=True, exist_ok=True)

PAPER = Path(__file__).parent / "scenes" / "paper.toml"
GRIDS = (2, 4) if choice.quick else (4, 8, 16)
FINEST = GRIDS[-1]
COMMON = ["surface.grid=[128, 128]", "block.cells=[16, 16, 12]"]
MESHES = ["coupling.kind=reference", "reference.mesh=tetrahedra", "reference.meshes=3"]
if choice.quick:
    COMMON = ["surface.grid=[64, 64]", "block.cells=[8, 8, 6]", "load.steps=2"]
    MESHES[2:] = ["reference.meshes=2", "reference.fine='20 um'"]


def go(*keys: str, patches: int = FINEST) -> History:
    """Run the paper's scene with some keys changed."""
    return run(Scene.load(PAPER, [*COMMON, f"patches.grid=[{patches}, {patches}]", *keys]))


# %% [markdown]
# The reference, true and with a tenth of the heights; then the models of a half-space, and those
# of the block: all contacts at once (concurrent), or as one law per patch.

# %%
reference = go(*MESHES)
shallow = go(*MESHES, "surface.spectrum.rms_slope=0.0215", "load.approach='0.8 um'")
half_space = go("coupling.kind=analytic", "micro.model=half-space")
discrete = {name: go("coupling.kind=analytic", f"micro.model={name}") for name in MODELS}
concurrent = go("coupling.kind=concurrent", "micro.model=half-space")
embedded = {
    (kind, n): go(f"coupling.kind={kind}", "micro.model=half-space", patches=n)
    for kind in ("consistent", "isolated")
    for n in GRIDS
}

# %% [markdown]
# The difference of every model to the reference, and its parts, at the largest approach.

# %%
record, small = reference.reference, shallow.reference
assert record is not None and small is not None
truth, limit = float(record.force.value[-1]), 10.0 * float(small.force.value[-1])
models = {
    "half-space": half_space,
    **{f"half-space, {name}": history for name, history in discrete.items()},
    "block, concurrent": concurrent,
    **{f"block, {kind} {n} × {n}": history for (kind, n), history in embedded.items()},
}
print(f"reference at 8 µm: {truth:.4f} N {record.label}; {max(record.unknowns)} unknowns")
for name, history in models.items():
    print(f"  {name:36s} {history.force_N[-1]:8.4f} N  {history.force_N[-1] / truth - 1.0:+7.1%}")
stage = make_stage(Scene.load(PAPER, [*COMMON, "coupling.kind=analytic", "micro.model=half-space"]))
effect = finite_slope_effect(stage.model, 8e-3, poisson_ratio=0.15)
force, block = half_space.force_N[-1], concurrent.force_N[-1]
parts = {
    "discretisation (finest mesh)": record.force_N[-1, -1] / truth - 1.0,
    "finite slopes": limit / truth - 1.0,
    "rest: concurrent to small slopes": block / limit - 1.0,
    "finite block": force / block - 1.0,
    **{
        f"coupling, {kind} {n} × {n}": history.force_N[-1] / block - 1.0
        for (kind, n), history in embedded.items()
    },
}
for name, part in parts.items():
    print(f"  {name:36s} {part:+7.2%}")
print(f"  finite slopes, estimated without mesh {1.0 / (1.0 + effect) - 1.0:+6.2%}")

# %%
figure = Figure(figsize=(13.0, 8.2), layout="constrained")
upper, lower = figure.subfigures(2, 1, height_ratios=(1.25, 1.0))
curve, apart, split = upper.subplots(1, 3)
approach = np.append(0.0, 1e3 * reference.approach_mm)
value, error = np.append(0.0, record.force.value), np.append(0.0, record.force.error)
curve.fill_between(approach, value - error, value + error, color="0.6", lw=0)
curve.plot(approach, value, "k", lw=2.5, label=f"reference, {record.label}")
apart.fill_between(
    approach[1:], -100 * error[1:] / value[1:], 100 * error[1:] / value[1:], color="0.75", lw=0
)
apart.axhline(0.0, color="k", lw=1.5)
LOOKS = {"half-space": ("#0b3c5d", "--"), "block, concurrent": ("#1b998b", "-")}
for (name, history), mark in zip(models.items(), " sdv^ " + "123" + "xP*", strict=False):
    isolated = "isolated" in name
    colour = "#d1495b" if isolated else "#1b998b" if "block" in name else "#edae49"
    colour, style = LOOKS.get(name, (colour, ":" if isolated else ""))
    look = {"color": colour, "ls": style, "marker": mark.strip(), "mfc": "none", "label": name}
    curve.plot(approach[1:], history.mean_pressure_MPa, **look)
    apart.plot(approach[1:], 100 * (history.force_N / record.force.value - 1.0), **look)
curve.set(xlabel="approach [µm]", ylabel="mean pressure [MPa]")
curve.legend(frameon=False, fontsize=7.5)
apart.set(xlabel="approach [µm]", ylabel="force over the reference's [%]")
names, values = list(parts), 100 * np.array(list(parts.values()))
split.barh(names, values, color=["#d1495b" if "iso" in name else "#0b3c5d" for name in names])
split.set(xlabel="part of the difference at 8 µm [%]")
split.invert_yaxis()
for axes in (curve, apart, split):
    axes.grid(alpha=0.3)
maps = {
    f"reference, {record.label}": reference,
    "half-space": half_space,
    "block, concurrent": concurrent,
    f"consistent, {FINEST} × {FINEST}": embedded["consistent", FINEST],
    f"isolated, {FINEST} × {FINEST}": embedded["isolated", FINEST],
}
top = reference.patch_pressure_MPa[-1].max()
panels = lower.subplots(1, len(maps), sharey=True)
for axes, (name, history) in zip(panels, maps.items(), strict=True):
    grid, pressure = history.patches, history.patch_pressure_MPa[-1].reshape(history.patches.grid)
    image = axes.pcolormesh(
        grid.borders_x, grid.borders_y, pressure.T, cmap="magma_r", vmin=0.0, vmax=top
    )
    axes.set(title=name, xlabel="x [mm]", aspect="equal")
panels[0].set_ylabel("y [mm]")
lower.colorbar(image, ax=panels, label="patch pressure at 8 µm [MPa]", extend="max", shrink=0.9)
figure.savefig(choice.out / "embedded_vs_reference.png", dpi=120)

# %%
assert abs(parts["rest: concurrent to small slopes"]) < (0.05 if choice.quick else 0.02)
assert 0.0 < parts["finite slopes"] < 0.06
