# %% [markdown]
# # A rough brake pad that wears: zones of contact wander and settle
#
# What one learns: a pad that the rim of a piston presses bends and bears in its middle alone, on
# few spots. While it slides, its profile wears where it bears, the load wanders outwards, and the
# roughness under every point runs in. In the end the pad fits the disc under its load.
#
#     pad on a law of its roughness ──▶ load, then slide: 1, 10, 100 km ──▶ pressures, zones
#
# Scene: that of `bodies/brake_pad.toml` with `[wear]`, on coarser elements. Run time: ten minutes.
# `--quick` for less, `--out DIR` for mesh and picture.

# %%
import argparse
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np

from patchlaw.multiscale import Run, Scene
from patchlaw.multiscale.results.figures import style

parser = argparse.ArgumentParser()
parser.add_argument("--quick", action="store_true")
parser.add_argument("--out", type=Path, default=Path("results/wearing_pad"))
choice = parser.parse_args()
OUT, DEMOS = choice.out.absolute(), Path(__file__).parent
EDGE, CELLS, SLID = (
    (14.0, 16, ["10 km"]) if choice.quick else (10.0, 24, ["1 km", "10 km", "100 km"])
)
FORCE, COEFFICIENT = 8e3, 1e-9  # N, mm²/N
RADIUS = 121.5  # of the middle of the piston [mm]
ZONES = {"over the rim": (15.0, 22.0), "inside it": (0.0, 15.0), "outside it": (22.0, np.inf)}

# %% [markdown]
# The pad of `bodies/brake_pad.py`, and a sample of its roughness.

# %%
OUT.mkdir(parents=True, exist_ok=True)
words = [DEMOS / "bodies/brake_pad.py", "--size", str(EDGE), "--out", OUT / "pad.msh"]
subprocess.run([sys.executable, *words], check=True, capture_output=True)
band = {"hurst": 0.8, "waves": [2, CELLS // 6], "rms_height": "4 um", "seed": 1}
materials = {"lining": ("1 GPa", 0.25), "back plate": ("210 GPa", 0.3)}
names = "young_modulus", "poisson_ratio"
scene = Scene.from_dict({
    "surface": {"spectrum": band, "grid": [CELLS, CELLS], "lengths": ["4 mm", "4 mm"]},
    "body": {
        "mesh": str(OUT / "pad.msh"),
        "contact": "pad face",
        "supports": [{"surface": "piston", "displacement": ["0", "0", "0"]}],
        "materials": {one: dict(zip(names, pair, strict=True)) for one, pair in materials.items()},
    },
    "law": {"kind": "representative"},
    "coupling": {"table_tolerance": 2e-2},
    "wear": {"coefficient": f"{COEFFICIENT} mm^2/N"},
    "load": {"force": f"{FORCE} N", "steps": 1, "sliding": SLID},
    "output": {"check": "none"},
})  # fmt: skip

# %% [markdown]
# Zones of the face are told by their distance from the axis of the piston.


# %%
def of_zones(values: np.ndarray) -> np.ndarray:
    """Return means over the zones of what points of the face have."""
    return np.array([np.average(values[zone], weights=weight[zone]) for zone in zones])


run, steps, pressures, shares, stiffness, depths = Run(scene), [], [], [], [], []
for step in run.load_steps():
    model: Any = run.coupling.model  # of the face, which knows more than others
    x, y, pressure = model.face_pressures().T
    face = model.face.sides[0]
    weight = face.quadrature.weight
    places = face.facets.frame.in_space(np.column_stack([x, y]))
    away = np.hypot(places[:, 0] - RADIUS, places[:, 1])
    zones = [(away >= low) & (away < high) for low, high in ZONES.values()]
    largest = np.argsort(-pressure)
    half = np.cumsum((pressure * weight)[largest]) < 0.5 * step.force_N
    means = zip(ZONES, of_zones(pressure), strict=True)
    steps.append(step)
    pressures.append(pressure)
    shares.append(weight[largest][half].sum() / weight.sum())
    stiffness.append(of_zones(model.point_stiffnesses))
    depths.append(of_zones(model.point_worn_depths))
    print(
        f"{1e-6 * step.slid_mm:5.0f} km: {shares[-1]:.0%} of the face bears half, mean "
        + ", ".join(f"{name} {p:.2f} MPa" for name, p in means)
        + "; stiffness "
        + ", ".join(f"{1e-3 * one:.2f}" for one in stiffness[-1])
        + f" MPa/µm; {step.contact_area_fraction:.1%} in contact, "
        f"{1e3 * step.mean_worn_depth_mm:.1f} µm worn",
        flush=True,
    )

# %% [markdown]
# The volume is coefficient times force times distance. Pressures become even: more of the face
# bears half of the force, from distance to distance.

# %%
volume = COEFFICIENT * FORCE * np.array([step.slid_mm for step in steps])
np.testing.assert_allclose([step.worn_volume_mm3 for step in steps], volume, rtol=1e-10)
assert (np.diff(shares) > 0.0).all()
assert (np.diff([step.contact_area_fraction for step in steps]) > 0.0).all()

# %%
style.use_style()
figure = style.new_figure(style.FULL_WIDTH, 4.6)
names = ["new", *(f"{1e-6 * step.slid_mm:g} km" for step in steps[1:])]
shown = sorted({0, 1, len(steps) - 1})
top, bottom = figure.subfigures(2, 1)
look = {"s": 4.0, "cmap": style.PRESSURES, "vmin": 0.0, "vmax": pressures[0].max(), "linewidths": 0}
for axes, one in zip(top.subplots(1, len(shown), squeeze=False)[0], shown, strict=True):
    image = axes.scatter(*places[:, [1, 0]].T, c=pressures[one], rasterized=True, **look)
    axes.set(aspect="equal", title=f"after {names[one]}" if one else "new", xlabel="y [mm]")
    axes.set(ylabel="x [mm]" if not one else "")
    style.colour_bar(image, axes, "pressure [MPa]")
left, right = bottom.subplots(1, 2)
curves = (stiffness, 1e-3, "interface stiffness [MPa/µm]"), (depths, 1e3, "mean worn depth [µm]")
for axes, (values, unit, label) in zip((left, right), curves, strict=True):
    for name, curve in zip(ZONES, unit * np.array(values).T, strict=True):
        axes.plot(names, curve, "o-", label=name)
    axes.set(xlabel="distance slid", ylabel=label)
left.set_yscale("log")
right.set_yscale("symlog", linthresh=1.0)
left.legend(title="zones of the pad")
figure.savefig(OUT / "wearing_pad.png")
