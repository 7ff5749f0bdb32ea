# %% [markdown]
# # A bolted flange: bolts leave a path
#
# What one learns: a narrow ring at the rim alone holds the fluid back, and two thirds of the leak
# leave through the third of it that lies half-way between bolts, where it is pressed least.
#
#         bolt          bolt
#          ▼  raised face ▼       outlet: rim, no pressure
#       ▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔▔    ∇·(T/(12 η) ∇P) = 0, T of the samples at the gap of every point
#              pipe               inlet: bore, 10 bar
#
# The flange of `bodies/flange.py` under the pull of its four bolts, water inside.
#
# Run time: 2 min. `--quick` for a coarse mesh and a small sample, `--out DIR` for the figure.

# %%
import argparse
import subprocess
import sys
from pathlib import Path

import numpy as np
from matplotlib.tri import Triangulation

from patchlaw.multiscale import Run, Scene
from patchlaw.multiscale.results.figures.style import (
    BLUE,
    FULL_WIDTH,
    VERMILLION,
    colour_bar,
    new_figure,
    use_style,
)

parser = argparse.ArgumentParser()
parser.add_argument("--quick", action="store_true")
parser.add_argument("--out", type=Path, default=Path("results/flange_leak"))
choice = parser.parse_args()
choice.out.mkdir(parents=True, exist_ok=True)
BODIES = Path(__file__).parent / "bodies"
SIZE = "6" if choice.quick else "4"
SMALL = {"surface.grid": [32, 32], "surface.spectrum.waves": [2, 8]} if choice.quick else {}

# %%
mesh = choice.out / "flange.msh"
words = [sys.executable, BODIES / "flange.py", "--size", SIZE, "--out", mesh]
subprocess.run(words, check=True, capture_output=True)
pull = [{"name": "bolts", "body": {"pretension": [{"surface": "washers", "pull": "120 kN"}]}}]
water = {"viscosity": "1 mPa s", "pressures": ["10 bar", "0 bar"]}
scene = Scene.load(BODIES / "flange.toml").with_(
    {
        "body.mesh": str(mesh.absolute()),
        "body.element": "linear",
        "law.seeds": [1],
        "load.stage": pull,
        "leak": water | {"inlet": "bore", "outlet": "rim"},
        "output.fields": False,
        **SMALL,
    }
)
done = Run(scene)
*_, step = done.load_steps()
fluid = done.fluid
contact = done.coupling.model.face_pressures()  # columns x, y [mm] and pressure [MPa]
leak = step.leak("face")
errors = ", ".join(f"{cause} {error:.2g}" for cause, error in leak.causes)
print(f"{step.force_N / 1e3:.1f} kN: {leak.rate:.3g} ± {leak.error:.2g} mm³/s ({errors})")

# %% [markdown]
# By the angle from the nearest bolt: what leaves the face at the rim, and what presses there.

# %%
middle = 0.5 * (fluid.triangles.min(axis=(0, 1)) + fluid.triangles.max(axis=(0, 1)))


def from_bolt(places: np.ndarray) -> np.ndarray:
    """Return the angles of places (n, 2) from the nearest bolt, which lie at 45°, 135°, …"""
    x, y = (places - middle).T
    return np.abs(np.degrees(np.arctan2(y, x)) % 90.0 - 45.0)


borders = np.linspace(0.0, 45.0, 4 if choice.quick else 7)
angle = from_bolt(fluid.triangles.mean(axis=1))
share = np.histogram(angle, borders, weights=fluid.leaving_mm3_per_s / leak.rate)[0]
rim = np.hypot(*(contact[:, :2] - middle).T) > 48.5
pressed = np.histogram(from_bolt(contact[rim, :2]), borders, weights=contact[rim, 2])[0]
pressed /= np.histogram(from_bolt(contact[rim, :2]), borders)[0]
for place, (leaves, presses) in enumerate(zip(share, pressed, strict=True)):
    ends = f"{borders[place]:4.1f}° to {borders[place + 1]:4.1f}°"
    print(f"{ends} from a bolt: {100 * leaves:4.1f} % of the leak, {presses:5.0f} MPa")
assert abs(share.sum() - 1.0) < 1e-6
assert share[-1] > share[0] and pressed[-1] < pressed[0]

# %%
use_style()
figure = new_figure(FULL_WIDTH, 2.7)
left, right = figure.subplots(1, 2)
points, values = fluid.triangles.reshape(-1, 2) - middle, 10.0 * fluid.pressure_MPa.ravel()
net = Triangulation(*points.T, np.arange(len(points)).reshape(-1, 3))
image = left.tripcolor(net, values, cmap="Blues", shading="gouraud", rasterized=True)
colour_bar(image, left, "fluid pressure [bar]")
bolt = 62.5 * np.sqrt(0.5)
left.plot(bolt, bolt, "o", color=VERMILLION, ms=9.0)
left.text(0.0, 0.0, "  bore", va="bottom")
left.text(bolt - 4.0, bolt, "bolt", ha="right", va="center")
left.set(aspect="equal", xlabel="x [mm]", ylabel="y [mm]", xlim=(0.0, 52.0), ylim=(0.0, 52.0))
left.set_title(f"a quarter; the whole leaks {leak.rate:.2g} ± {leak.error:.2g} mm³/s")
left.grid(False)
right.stairs(100.0 * share, borders, color=BLUE, fill=True, alpha=0.5)
right.set(xlabel="angle from the nearest bolt [°]", ylabel="share of the leak [%]")
other = right.twinx()
other.plot(0.5 * (borders[1:] + borders[:-1]), pressed, "o-", ms=3.0, color=VERMILLION)
other.set_ylabel("contact pressure at the rim [MPa]", color=VERMILLION)
other.set_ylim(0.0, None)
other.grid(False)
far = 100.0 * share[-(len(share) // 3) :].sum()
figure.savefig(choice.out / "flange_leak.png", metadata={"answer": f"{far:.0f} % of the leak"})
done.close()
