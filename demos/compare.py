# %% [markdown]
# # Which way to compute a scene?
#
# What one learns: which error remains after which time, in every sensible way to compute the
# paper's scene and a surface with many waves. `patchlaw compare` runs them all and takes
# the best one, three meshes of the roughness, as the reference. That one knows its own error; below
# it, no two ways can be ranked. Times are those that the runs state.
#
#     error of the force: the largest of the curve, over its largest force, at least the truth's own
#
# Run time: 5 min each. `--quick` for a coarse scene alone, `--out DIR` for the folder of
# figure and tables, `--data demos/data` to draw tables that a run has made again.

# %%
import argparse
import csv
from pathlib import Path

import numpy as np

from patchlaw.multiscale import Scene, compare
from patchlaw.multiscale.results.figures.style import (
    COLOURS,
    ERROR_BAND,
    FULL_WIDTH,
    MARKERS,
    new_figure,
    use_style,
)

parser = argparse.ArgumentParser()
parser.add_argument("--quick", action="store_true")
parser.add_argument("--out", type=Path, default=Path("results/compare"))
parser.add_argument("--data", type=Path)
choice = parser.parse_args()
choice.out.mkdir(parents=True, exist_ok=True)

SCENES = {"paper": "2 to 10 waves on a side", "rich": "2 to 64 waves on a side"}
COARSE = ["surface.grid=[32, 32]", "load.steps=1", "reference.fine='40 um'"]
if choice.quick:
    SCENES.popitem()
COLUMNS = ("name", "kind", "status", "is_measure", "seconds", "error_force_max")
COUPLINGS = {  # name, and where it stands beside the first curve
    "analytic": ("micro models\nalone", (0.03, 20.0), "left"),
    "isolated": ("patches on their own", (1.1, 20.0), "left"),
    "consistent": ("laws of the\nwhole surface", (4.0, 1.6), "left"),
    "concurrent": ("contacts\nand block\ntogether", (0.2, 0.28), "right"),
    "reference": ("roughness\nmeshed", (32.0, 0.4), "left"),
}


# %%
def table(name: str) -> list[dict[str, str]]:
    """Return the rows of a comparison, each by column, from a table or from a run that makes it."""
    path = (choice.data or choice.out) / f"compare_{name}.csv"
    if not choice.data:
        keys = COARSE if choice.quick else []
        scene = Scene.load(Path(__file__).parent / "scenes" / f"{name}.toml", keys)
        found = compare(scene, folder=choice.out / name)
        with path.open("w", encoding="utf-8", newline="") as file:
            writer = csv.DictWriter(file, COLUMNS, extrasaction="ignore", lineterminator="\n")
            writer.writeheader()
            writer.writerows(found.records())
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


# %% [markdown]
# Of every coupling the best that is reached after a time.

# %%
use_style()
figure = new_figure(FULL_WIDTH, 3.2)
best: dict[str, dict[str, float]] = {}
waits: dict[str, list[float]] = {}
for axes, (name, title) in zip(
    figure.subplots(1, len(SCENES), squeeze=False).flat, SCENES.items(), strict=True
):
    rows = [row for row in table(name) if row["status"] == "done" and row["error_force_max"]]
    (bar,) = (float(row["error_force_max"]) for row in rows if row["is_measure"] == "True")
    axes.axhspan(1e-4, 100 * bar, **ERROR_BAND)
    axes.text(0.03, 0.03, "error bar of the reference", color="0.4", transform=axes.transAxes)
    for kind, (text, place, side) in COUPLINGS.items():
        runs = sorted(
            (float(row["seconds"]), max(abs(float(row["error_force_max"])), bar))
            for row in rows
            if row["kind"] == kind and row["is_measure"] != "True"
        )
        lowest = np.minimum.accumulate([error for _, error in runs])
        first = np.flatnonzero(np.diff(lowest, prepend=np.inf) < 0.0)
        times, errors = np.array([runs[k][0] for k in first]), 100 * lowest[first]
        axes.loglog(times, errors, MARKERS[kind] + "-", color=COLOURS[kind], drawstyle="steps-post")
        if name == "paper":
            axes.text(*place, text, color=COLOURS[kind], ha=side)
        best.setdefault(name, {})[kind] = float(errors[-1])
        waits.setdefault(kind, []).append(times[-1])
    axes.set(title=title, xlabel="time of 8 load steps [s]", ylabel="error of the force [%]")
    axes.set(ylim=(0.06, 400.0), xlim=(0.01, 400.0))
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter("{x:g}")
    print(f"{name}: bar {bar:.2%}; " + ", ".join(f"{k} {v:.2f} %" for k, v in best[name].items()))
early, late = waits["concurrent"], waits["reference"]
answer = "after {} s".format(" and ".join(f"{time:.1f}" for time in early))
longer = (f"{mesh / time:.0f}" for mesh, time in zip(late, early, strict=True))
answer += ", a mesh takes {} times as long".format(" and ".join(longer))
figure.savefig(choice.out / "compare.png", metadata={"answer": answer})

# %% [markdown]
# Contacts and block solved together come within the bar, in a fraction of the time of a mesh.

# %%
for errors_of in best.values():
    assert errors_of["concurrent"] < (10.0 if choice.quick else 1.0)
    assert errors_of["concurrent"] < errors_of["analytic"] or choice.quick
