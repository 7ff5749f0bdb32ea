# %% [markdown]
# # A tilted plane and the laws that know of it
#
# What one learns: patch laws made for a level plane do not know how a tilted one distributes the
# load among the summits of a patch; they need small patches. Laws made for the tilted plane
# itself reproduce the force of the whole surface on any partition, at the same cost.
#
#       ╲___ plane, 10 µm higher on one side of each millimetre
#     ▁▂▃▂▁▂▄▃▂▁▃▅▃▂      c_i = s_i − Σ_j Λ_ij p_j / (π E*),  s_i the approach at patch i
#
# Here the macro model is the half-space itself, so that any difference comes from the laws.
#
# Run time: 1 min. `--quick` for two surfaces and one partition, `--out DIR` for the figure.

# %%
import argparse
from pathlib import Path

import numpy as np

from patchlaw.geometry import Control, Material, PatchGrid, Spectrum, patch_means, synthesise
from patchlaw.micro import HalfSpaceModel, influence_matrix
from patchlaw.multiscale import PatchContact, consistent_laws
from patchlaw.multiscale.results.figures.style import (
    GREEN,
    ONE_COLUMN,
    VERMILLION,
    new_figure,
    use_style,
)

parser = argparse.ArgumentParser()
parser.add_argument("--quick", action="store_true")
parser.add_argument("--out", type=Path, default=Path("results/tilt"))
choice = parser.parse_args()
choice.out.mkdir(parents=True, exist_ok=True)
SEEDS = (1, 2) if choice.quick else (1, 2, 3, 4, 5, 6)
GRIDS = (8,) if choice.quick else (1, 4, 8, 16)
TILT, APPROACH = (10e-3, 0.0), 8e-3
MODULUS = Material(young_modulus=4000.0, poisson_ratio=0.15).contact_modulus


# %%
def errors(seed: int, count: int, tilt: tuple[float, float]) -> tuple[float, float]:
    """Return the errors of the force, and of the worst patch over the largest patch pressure."""
    spectrum = Spectrum(hurst=0.95, waves=(2, 10), rms_slope=0.215, seed=seed)
    surface = synthesise(spectrum, grid=(128, 128), lengths=(1.0, 1.0))
    patches = PatchGrid(grid=(count, count), lengths=surface.lengths)
    model = HalfSpaceModel(surface=surface, contact_modulus=MODULUS)
    means = patch_means(surface, patches)
    end = 1.2 * APPROACH + (0.5 * TILT[0] if tilt != TILT else 0.0)
    largest = Control(approach=end, tilt=tilt)
    laws = consistent_laws(model, patches, mean_heights=means, largest=largest)
    half_space = influence_matrix(patches) / (np.pi * MODULUS)
    step = PatchContact(laws, half_space).press(Control(approach=APPROACH, tilt=TILT))
    control = Control(approach=APPROACH, tilt=TILT)
    whole = model.press(control, patches=patches, mean_heights=means)
    pressure = whole.patch_pressure
    missed = np.abs(step.patches.pressure_MPa - pressure).max() / pressure.max()
    return step.force_N / whole.force - 1.0, float(missed)


# %% [markdown]
# Errors of the force and of patch pressures at 8 µm, for a plane tilted by 10 µm per mm.

# %%
MADE = {"laws of a level plane": (0.0, 0.0), "laws made under the tilt": TILT}
found = {
    (name, count): np.array([errors(seed, count, tilt) for seed in SEEDS])
    for name, tilt in MADE.items()
    for count in GRIDS
}
print(f"largest errors over {len(SEEDS)} surfaces of the force, and of a patch pressure")
for (name, count), values in found.items():
    force, patch = np.abs(values).max(axis=0)
    print(f"  {name:26s} {count:2d} × {count:<2d} patches {force:8.3%} {patch:8.2%}")

# %%
use_style()
figure = new_figure(1.3 * ONE_COLUMN, 2.8)
axes, counts = figure.subplots(), [count**2 for count in GRIDS]
for mark, colour, name in zip("so", (VERMILLION, GREEN), MADE, strict=True):
    worst = [100.0 * np.abs(found[name, count][:, 0]).max() for count in GRIDS]
    axes.loglog(counts, worst, mark + "-", color=colour)
    axes.text(counts[0], 1.5 * worst[0], name, color=colour)
axes.set_xticks(counts, [str(count) for count in counts])
axes.minorticks_off()
axes.yaxis.set_major_formatter("{x:g}")
axes.set(xlabel="number of patches", ylabel="largest error of the force [%]", ymargin=0.15)

# %% [markdown]
# With laws made for the tilt, even one patch for the whole surface is accurate.

# %%
worst = {key: np.abs(values[:, 0]).max() for key, values in found.items()}
level, tilted = (100.0 * max(worst[name, count] for count in GRIDS) for name in MADE)
answer = f"errors of up to {level:.0f} %, within {tilted:.2f} %"
figure.savefig(choice.out / "tilt.png", metadata={"answer": answer})
assert all(worst["laws made under the tilt", count] < 2e-3 for count in GRIDS)
assert worst["laws of a level plane", 8] < 0.05
