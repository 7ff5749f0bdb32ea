# %% [markdown]
# # A rough brake pad that wears: zones of contact wander and settle
#
# What one learns: a pad that the rim of a piston presses bends and bears in its middle alone, on
# few spots. While it slides, its profile wears where it bears, the load wanders outwards, and the
# roughness under every point runs in. In the end the pad fits the disc under its load.
#
#     pad on a law of its roughness ──▶ load, then slide: 1, 10, 100 km ──▶ pressures, zones
#
# Scene: that of `bodies/brake_pad.toml` with `[wear]`, on coarser elements. Run time: 35 s.
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
EDGE, CELLS = (14.0, 16) if choice.quick else (10.0, 24)  # of the body [mm], of the sample
SLID = ["10 km"] if choice.quick else ["1 km", "10 km", "100 km"]
FORCE, COEFFICIENT = 8e3, 1e-9  # N, mm²/N
RADIUS = 121.5  # of the middle of the piston [mm], whose axis tells zones
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
    corners, of_facets = model.facet_pressures()
    pressures.append(of_facets)
    corners = face.facets.frame.in_space(corners.reshape(-1, 2)).reshape(*corners.shape[:2], 3)
    shares.append(weight[largest][half].sum() / weight.sum())
    stiffness.append(of_zones(model.point_stiffnesses))
    depths.append(of_zones(model.point_worn_depths))
    print(
        f"{1e-6 * step.slid_mm:.0f} km, {1e3 * step.mean_worn_depth_mm:.1f} µm worn: half bears on"
    )
    print(f"  {shares[-1]:.0%} of the face; {step.contact_area_fraction:.1%} are in contact")
    for (name, mean), slope in zip(means, stiffness[-1], strict=True):
        print(f"  {name:14s} {mean:.2f} MPa, {1e-3 * slope:.2f} MPa/µm")

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
top, bottom = figure.subfigures(2, 1, height_ratios=(1.0, 1.7))
maps = top.subplots(1, len(shown), sharey=True, squeeze=False)[0]
for axes, one in zip(maps, shown, strict=True):
    at = axes, corners[..., 1::-1], np.ma.masked_less_equal(pressures[one], 0.0)
    style.draw_facets(*at, pressures[0].max(), "pressure [MPa]" if axes is maps[-1] else "")
    axes.set(title=f"after {names[one]}" if one else "new", xlabel="y [mm]", ylabel="")
maps[0].set_ylabel("x [mm]")
left, right = bottom.subplots(1, 2)
curves = (stiffness, 1e-3, "interface stiffness [MPa/µm]"), (depths, 1e3, "mean worn depth [µm]")
for axes, (values, unit, label) in zip((left, right), curves, strict=True):
    for name, curve in zip(ZONES, unit * np.array(values).T, strict=True):
        axes.plot(names, curve, "o-", label=name)
    axes.set(xlabel="distance slid", ylabel=label)
left.set_yscale("log")
right.set_yscale("symlog", linthresh=1.0)
right.set_title("logarithmic, linear below 1 µm")
left.legend(title="zones of the pad")
figure.savefig(OUT / "wearing_pad.png")
