# %% [markdown]
# # How far can a micro model be trusted?
#
# What one learns: the error in force and contact area of every micro model against a half-space
# solution, over many realizations of the paper's Set 1 and Set 2 (Waddad et al. 2016, Table 1, doi
# 10.1016/j.triboint.2015.12.023), and what each costs. Times are the processor's.
#
#     reference: cell-wise pressures p ≥ 0, gap ≥ 0, p · gap = 0 on 256², 512² and 1024² cells,
#                extrapolated (Richardson) with the rate observed over all results; its own
#                error is what the finest grid changes in it; rows marked * are part of it
#
# Run time: 4 min. `--quick`: two seeds, coarser grids; `--out DIR`: folder of figure, table;
# `--data demos/data/micro_accuracy.csv` draws that table, which a run has made, again.

# %%
import argparse
import time
from functools import lru_cache
from pathlib import Path

import numpy as np
from paper.accuracy_figure import draw_accuracy

from patchlaw.geometry import Material, PatchGrid, Spectrum, patch_means, stacked, synthesise
from patchlaw.micro import micro_model, press_along

parser = argparse.ArgumentParser()
parser.add_argument("--quick", action="store_true")
parser.add_argument("--out", type=Path, default=Path("results/micro_accuracy"))
parser.add_argument("--data", type=Path)
choice = parser.parse_args()
choice.out.mkdir(parents=True, exist_ok=True)
SETS = {"Set 1": {"waves": (2, 10)}, "Set 2": {"waves_x": (2, 7), "waves_y": (2, 12)}}
SEEDS = range(1, 3) if choice.quick else range(1, 21)
CELLS = (32, 64, 128) if choice.quick else (32, 64, 128, 256, 512, 1024)
APPROACHES = np.array([4e-3, 8e-3, 12e-3, 18e-3])
MODULUS = Material(young_modulus=4000.0, poisson_ratio=0.15).contact_modulus
WHOLE = PatchGrid(grid=(1, 1), lengths=(1.0, 1.0))
ASPERITY_GRID = 128 if choice.quick else 256
KINDS = ("elliptic-independent", "circular-independent", "elliptic", "circular")
MODELS = {
    **{f"{kind}, {ASPERITY_GRID}²": (kind, ASPERITY_GRID) for kind in KINDS},
    **{f"half-space, {n}²": ("half-space", n) for n in CELLS},
}
REFERENCE = list(MODELS)[-3:]


@lru_cache(maxsize=8)
def rough(spectrum, grid):
    return synthesise(spectrum, grid=(grid, grid), lengths=(1.0, 1.0))


def answer(spectrum, name, grid):
    surface = rough(spectrum, grid)
    _ = surface.highest  # not of the model
    start = time.process_time()
    model = micro_model(name, surface, contact_modulus=MODULUS)
    means = patch_means(surface, WHOLE)
    states = press_along(model, APPROACHES, patches=WHOLE, mean_heights=means)
    seconds = (time.process_time() - start) / len(APPROACHES)
    return [*stacked(states, "force"), *stacked(states, "contact_area"), seconds]


# %%
def solutions():
    """Return forces, areas at all approaches and seconds; a row for each model and surface."""
    bands = [
        Spectrum(hurst=0.95, rms_slope=0.215, seed=k, **x) for x in SETS.values() for k in SEEDS
    ]
    found = [[answer(band, *model) for model in MODELS.values()] for band in bands]
    rows = np.swapaxes(found, 0, 1).reshape(-1, 9)  # surface by surface, for the cache
    text = "4 forces [N], 4 areas [mm2], seconds per approach; rows: model, surface"
    np.savetxt(choice.out / "micro_accuracy.csv", rows, "%.6g", ",", header=text)
    return rows


table = np.loadtxt(choice.data, delimiter=",") if choice.data else solutions()
table = table.reshape(len(MODELS), -1, 9)
times = dict(zip(MODELS, table[..., 8], strict=True))
solved = dict(zip(MODELS, table[..., :8].reshape(*table.shape[:2], 2, 4), strict=True))
coarse, middle, fine = (solved[key] for key in REFERENCE)  # surface, quantity, approach
fractions = fine[:, 1]
valid = (fractions > 1e-3) & (fractions < 0.08)


def rms(values):
    return np.array([np.sqrt(np.mean(values[:, i][valid] ** 2)) for i in range(2)])


rate = np.log2(rms(middle / coarse - 1) / rms(fine / middle - 1))
gain = 1 / (2 ** rate[:, None] - 1)
reference = fine + gain * (fine - middle)
own = rms((middle + gain * (middle - coarse)) / reference - 1)
errors = {key: np.array(found) / reference - 1 for key, found in solved.items()}
size = {key: rms(error) for key, error in errors.items()}

# %%  Root mean square errors over all results with 0.1 to 8 % of contact area.
print("| model | force | area | ms per approach |\n|---|---|---|---|")
shown = {key: f"{key} *" if key in REFERENCE else key for key in MODELS}
cost = {key: 1e3 * np.median(seconds) for key, seconds in times.items()}
for key, (force, area) in size.items():
    print(f"| {shown[key]} | {force:.2%} | {area:.2%} | {cost[key]:.2f} |")
print(f"| reference, rates {rate[0]:.2f} and {rate[1]:.2f} | {own[0]:.3%} | {own[1]:.3%} | |")

# %%
plain = [f"{kind}, {ASPERITY_GRID}²" for kind in KINDS]
grids = [f"half-space, {n}²" for n in CELLS if choice.quick or n < 256]  # others are of the truth
force = [100 * size[key][0] for key in (*plain, "half-space, 64²")]
said = f"64² heights have an error of {force[-1]:.0f} %, with interaction of "
said += f"{np.mean(force[2:4]):.0f} %, without of {np.mean(force[:2]):.0f} %"
draw_accuracy(
    choice.out / "micro_accuracy.png",
    fractions,
    {key: errors[key][:, 0] for key in (plain[0], plain[2], "half-space, 64²")},
    {key: (cost[key], 100 * size[key][0]) for key in (*plain, *grids)},
    100 * own[0],
    said,
)

# %% [markdown]
# Without interaction the models are far too stiff; with interaction they are too soft.

# %%
assert size["half-space, 64²"][0] < min(0.03, size[f"elliptic, {ASPERITY_GRID}²"][0])
