# %% [markdown]
# # Running in: how a rough lining wears flat
#
# What one learns: a new brake lining rests on few spots. While it slides they wear, pressures fall,
# the contact grows and its stiffness rises, until the roughness has worn off and the volume grows
# alone.
#
#     rough map ──▶ load, then slide: 10 m … 1 km ──▶ contact, pressure, stiffness
#
# Run time: 5 s. `--quick` for fewer cells and shorter ways, `--out DIR` for the picture.

# %%
import argparse
from pathlib import Path

import numpy as np

from patchlaw import Material, Problem, Spectrum, Step, synthesise
from patchlaw.multiscale import CellContact
from patchlaw.multiscale.results.figures import style

parser = argparse.ArgumentParser()
parser.add_argument("--quick", action="store_true")
parser.add_argument("--out", type=Path, default=Path("results/running_in"))
choice = parser.parse_args()
CELLS = 48 if choice.quick else 128
SLID = [1e4, 1e5] if choice.quick else [1e4, 3e4, 1e5, 3e5, 1e6]  # [mm]
SIDE, FORCE, COEFFICIENT = 5.0, 25.0, 1e-8  # mm, N, mm²/N: 1 MPa on a lining
LINING = Material(young_modulus=1000.0, poisson_ratio=0.25)

# %% [markdown]
# A lining on a flat disc, level and periodic: pressed by 1 MPa, then slid.

# %%
band = Spectrum(hurst=0.8, waves=(2, CELLS // 8), rms_height=5e-3, seed=4)
surface = synthesise(band, grid=(CELLS, CELLS), lengths=(SIDE, SIDE))
contact = CellContact.of(surface, LINING, wear=COEFFICIENT, periodic=True, finite_slopes=False)
steps, maps, stiffness = [], [], []
for step in Problem(contact, [Step(force=FORCE, slid=far) for far in (0.0, *SLID)]).steps():
    steps.append(step)
    maps.append(contact.latest.pressure)
    stiffness.append(contact.stiffness().interface)
    print(
        f"{1e-3 * step.slid_mm:6.0f} m: {step.contact_area_fraction:6.2%} in contact, "
        f"{step.peak_pressure_MPa:6.1f} MPa at most, {1e-3 * stiffness[-1]:5.1f} kN/mm, "
        f"{1e3 * step.mean_worn_depth_mm:.2f} µm worn",
        flush=True,
    )

# %% [markdown]
# What wears off follows from force and distance alone; the rest is how the surface runs in.

# %%
volume = COEFFICIENT * FORCE * np.array([step.slid_mm for step in steps])
np.testing.assert_allclose([step.worn_volume_mm3 for step in steps], volume, rtol=1e-9)
area = np.array([step.contact_area_fraction for step in steps])
assert (np.diff(area) > 0.0).all() and (np.diff(stiffness) > 0.0).all()

# %%
style.use_style()
figure = style.new_figure(style.FULL_WIDTH, 2.3)
left, middle, right = figure.subplots(1, 3, width_ratios=(1.0, 1.0, 1.2))
later = len(steps) // 2
for axes, one in ((left, 0), (middle, later)):
    shown, look = np.ma.masked_less_equal(maps[one], 0.0), {"cmap": style.PRESSURES, "vmin": 0.0}
    drawn = style.draw_image(axes, surface.lengths, shown, largest=True, **look)
    style.colour_bar(drawn, axes, "pressure [MPa]")
    axes.set(title=f"after {1e-3 * steps[one].slid_mm:g} m" if one else "new")
slid = 1e-3 * np.array([step.slid_mm for step in steps[1:]])
curves = (100.0 * area, "contact area [%]"), (
    1e-3 * np.array(stiffness), "stiffness [kN/mm]",
)  # fmt: skip
for (values, name), color in zip(curves, ("C0", "C1"), strict=True):
    right.loglog(slid, values[1:], "o-", color=color, label=name)
    right.axhline(values[0], color=color, lw=0.8, ls=":")
right.set(xlabel="distance slid [m]", ylabel="area, stiffness", title="dotted: new")
right.legend()
choice.out.mkdir(parents=True, exist_ok=True)
figure.savefig(choice.out / "running_in.png")
