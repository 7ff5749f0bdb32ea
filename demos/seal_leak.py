# %% [markdown]
# # A seal ring: what force, and what finish, make it tight
#
# What one learns: lapping twice as fine saves more closing force than three times the force does,
# because the tilted ring seals on its inner edge alone.
#
#          fluid, 10 bar ──▶  rim ▁▁▁▁▁▁▁ bore ──▶  none
#                            ╱ nose       │      T(p) of the samples at every point of the face,
#                           │ ring        │      ∇·(T/(12 η) ∇P) = 0 from rim to bore
#
# A quarter of the ring of `bodies/seal_ring.py` is pressed with up to 135 N, for three finishes of
# the same pattern of roughness. Error bars: elements of the face, cells, rows of T, and the scatter
# among three samples.
#
# Run time: 4 min. `--quick` for a coarse mesh and small samples, `--out DIR` for the figure.

# %%
import argparse
import subprocess
import sys
from pathlib import Path

import numpy as np

from patchlaw.multiscale import Scene, run
from patchlaw.multiscale.results.figures.style import (
    BLUE,
    GREEN,
    ONE_COLUMN,
    VERMILLION,
    new_figure,
    use_style,
)

parser = argparse.ArgumentParser()
parser.add_argument("--quick", action="store_true")
parser.add_argument("--out", type=Path, default=Path("results/seal_leak"))
choice = parser.parse_args()
choice.out.mkdir(parents=True, exist_ok=True)
BODIES = Path(__file__).parent / "bodies"
HEIGHTS = {"0.05 um": BLUE, "0.1 um": GREEN, "0.2 um": VERMILLION}
SIZE, STEPS = ("2", 2) if choice.quick else ("0.5", 9)
FEW = {"surface.grid": [16, 16], "surface.spectrum.waves": [2, 4], "law.seeds": [1, 2]}
FEW["coupling.table_tolerance"] = 2e-2
SMALL = FEW if choice.quick else {}

# %%
mesh = choice.out / "seal_ring.msh"
words = [sys.executable, BODIES / "seal_ring.py", "--size", SIZE, "--out", mesh]
subprocess.run(words, check=True, capture_output=True)
scene = Scene.load(BODIES / "seal_ring.toml").with_(
    {
        "body.mesh": str(mesh.absolute()),
        "load.force": "135 N",
        "load.steps": STEPS,
        "output.fields": False,
        "output.check": "all",
        **SMALL,
    }
)


# %%
def leaks(height: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return forces [N], flow rates and their errors [mm³/s] of a finish."""
    history = run(scene.with_({"surface.spectrum.rms_height": height}))
    found = [step.leak("face") for step in history]
    print(f"\n{height} rms")
    for step, leak in zip(history, found, strict=True):
        causes = ", ".join(f"{cause} {100 * e / leak.rate:.1f} %" for cause, e in leak.causes)
        print(f"{step.force_N:6.1f} N  {leak.rate:.3e} ± {leak.error:.1e} mm³/s  ({causes})")
    columns = zip(*((leak.rate, leak.error) for leak in found), strict=True)
    return history.force_N, *(np.array(column) for column in columns)


curves = {height: leaks(height) for height in HEIGHTS}

# %%
assert all((np.diff(rate) < 0.0).all() for _, rate, _ in curves.values())
(forces, finest, _), (_, finer, _), _ = curves.values()
third = int(np.argmin(np.abs(forces - (67.5 if choice.quick else 45.0))))
share = finest[third] / finer[-1]
print(f"\n0.05 µm at {forces[third]:.1f} N leaks {share:.2f} of what 0.1 µm leaks at 135 N")
assert share < 1.0

# %%
use_style()
figure = new_figure(ONE_COLUMN, 2.8)
axes = figure.add_subplot()
for (height, colour), (force, rate, error) in zip(HEIGHTS.items(), curves.values(), strict=True):
    look = {"ms": 3.0, "color": colour, "elinewidth": 0.8, "label": height.replace("um", "µm")}
    axes.errorbar(force, rate, error, fmt="o-", **look)
    zero = force[error >= rate]  # a logarithmic axis ends above it
    axes.plot(zero, 0.0 * zero, "v", ms=4.0, color=colour, transform=axes.get_xaxis_transform())
axes.set(yscale="log", xlabel="closing force [N]", ylabel="leak of the quarter [mm³/s]")
lowest = min(rate.min() for _, rate, _ in curves.values())
axes.set(xlim=(0.0, None), ylim=(0.1 * lowest, 10.0), title="triangles: bars that reach 0")
axes.legend(loc="upper right", title="rms height", ncols=3)
answer = f"leaks {share:.2f} times as much under {forces[third]:.0f} N"
figure.savefig(choice.out / "seal_leak.png", metadata={"answer": answer})
