# %% [markdown]
# # A worn surface against a new one
#
# What one learns: what running-in does to a rough contact, and how to compare two runs with their
# errors. A map of ground steel is pressed as it is, and again after its highest tenth has been worn
# down to a tenth of its height. Both are pressed by the same forces.
#
#       new  ╱╲    ╱╲          worn  ──    ──   the highest tenth of the area, flattened:
#      ─────╱──╲╱╲╱──╲─       ──────╱──╲╱╲╱──╲─   z → z₁₀ + (z − z₁₀)/10 above z₁₀
#
# Ratios of the second run over the first are at equal mean pressure, and their errors are the sums
# of what both runs measured of themselves. From the shell, with the folders of two runs, this is
# `patchlaw compare results/new results/worn`.
#
# Run time: 30 s on one core. `--quick` for coarser maps, `--out DIR` for the folder of
# figure and table.

# %%
import argparse
from pathlib import Path

import numpy as np

from patchlaw.multiscale import Scene, difference, make_setup, run
from patchlaw.multiscale.results.figures.style import BLUE, VERMILLION, panels, use_style

parser = argparse.ArgumentParser()
parser.add_argument("--quick", action="store_true")
parser.add_argument("--out", type=Path, default=Path("results/worn"))
choice = parser.parse_args()
choice.out.mkdir(parents=True, exist_ok=True)
STEPS = 3 if choice.quick else 6

# %% [markdown]
# The map is prepared once, as `patchlaw run` does it: leveled, filtered, without specks of dust.
# From then on both maps are arrays. The steel is hardened: no pressure exceeds 7 GPa.

# %%
SCENE = Path(__file__).parent / "scenes" / "my_surface.toml"
words = ["surface.resample=[64, 64]"] if choice.quick else []
surface = make_setup(Scene.load(SCENE, words)).parts.surface
heights = surface.heights
level = np.quantile(heights, 0.9)
worn = np.where(heights > level, level + 0.1 * (heights - level), heights)


def pressed(heights):
    """Return the history of a map under a force of up to 20 N."""
    return run(
        Scene.from_dict(
            {
                "surface": {"heights": heights, "lengths": list(surface.lengths)},
                "block": {"young_modulus": "210 GPa", "poisson_ratio": 0.3},
                "micro": {"hardness": "7 GPa"},
                "coupling": {"kind": "concurrent"},
                "load": {"force": "20 N", "steps": STEPS},
                "output": {"check": "all"},
            }
        )
    )


both = difference(pressed(heights), pressed(worn), names=("new", "worn"))

# %% [markdown]
# Every quantity of both runs at the largest load, and their ratio.

# %%
headings, rows = both.table()
for row in (headings, *rows):
    print("".join(f"{cell:>26s}" for cell in row))
with (choice.out / "worn.csv").open("w", encoding="utf-8") as file:
    records = list(both.records())
    print(*records[0], sep=",", file=file)
    for record in records:
        print(*record.values(), sep=",", file=file)

# %%
use_style()
figure, (profile, force, ratios) = panels(1, 3, 2.5)
row = int(np.argmax(heights.max(axis=0)))
for one, name, colour, history in zip(
    (heights, worn), both.names, (BLUE, VERMILLION), both.histories, strict=True
):
    profile.plot(1e3 * surface.x, 1e3 * (one[:, row] - level), color=colour, lw=0.9)
    look = {"color": colour, "marker": "o", "ms": 3.0, "label": name}
    force.plot(1e3 * history.approach_mm, history.mean_pressure_MPa, **look)
profile.set(xlabel="x [µm]", ylabel="height over z₁₀ [µm]", title="through the highest summit")
force.set(xlabel="approach [µm]", ylabel="mean pressure [MPa]")
force.legend()
for quantity, label, place in (
    ("contact_area_fraction", "contact area", (0.55, 0.9)),
    ("interface_stiffness_MPa_per_mm", "stiffness", (0.1, 0.5)),
    ("approach_mm", "approach", (0.1, 0.35)),
    ("peak_pressure_MPa", "peak pressure", (0.35, 0.08)),
):
    found = both.of(quantity)
    known = np.where(np.isfinite(found.error), found.error, 0.0)
    (line, *_) = ratios.errorbar(both.loads, found.ratio, known, marker="o", ms=3.0, capsize=2.0)
    ratios.text(*place, label, color=line.get_color(), transform=ratios.transAxes)
ratios.axhline(1.0, color="0.7", lw=0.8)
ratios.set(xlabel="mean pressure [MPa]", ylabel="worn over new", yscale="log", ylim=(0.15, 12.0))
ratios.set(yticks=[0.2, 0.5, 1, 2, 5, 10], yticklabels=["0.2", "0.5", "1", "2", "5", "10"])
ratios.minorticks_off()

# %% [markdown]
# The worn surface begins where the new one has its broad contacts already: it approaches half as
# far, on more area and at half the peak pressure, and is stiffer by more than the error of both.
# On coarser maps the ratio of the approaches is another one, and its error bar says by how much.

# %%
approach, stiffness = both.of("approach_mm"), both.of("interface_stiffness_MPa_per_mm")
area, peak = (both.of(name).ratio[-1] for name in ("contact_area_fraction", "peak_pressure_MPa"))
answer = f"{approach.ratio[-1]:.2f} times as far, {area:.1f} times the contact area"
answer += f", {peak:.2f} times the peak pressure"
figure.savefig(choice.out / "worn.png", metadata={"answer": answer})
assert abs(approach.ratio[-1] - (0.71 if choice.quick else 0.48)) < 0.02
assert area > 2.0
assert stiffness.ratio[-1] > 1.0
