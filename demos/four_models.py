# %% [markdown]
# # Four discrete models on one rough surface
#
# What one learns: how much interaction between asperities and the elliptic shape of contacts
# matter for the pressure, the contact area and the separation of a rough surface pressed by a
# rigid plane. This is Fig. 7 of Waddad et al. 2016 (doi 10.1016/j.triboint.2015.12.023).
#
#      rigid plane, approach δ counted from the first touch of the highest point z_M
#     ═══════════════════════════════════════
#        ╱╲        ╱╲     summit k asks for the displacement d_k = <δ − (z_M − z_k)>
#     ──╱  ╲──╱╲──╱  ╲──  and gets w_k = Σ_i G_i(r_ik) with interaction, w_k = d_k without
#
# Run time: 2 s. `--quick` for fewer points, `--out DIR` for the folder of the figures.

# %%
import argparse
from pathlib import Path

import numpy as np

from patchlaw.geometry import (
    Material,
    PatchGrid,
    Spectrum,
    find_asperities,
    patch_means,
    roughness,
    stacked,
    synthesise,
)
from patchlaw.micro import MODELS, AsperityModel, press_along
from patchlaw.multiscale.results.figures.style import FULL_WIDTH, new_figure, use_style
from patchlaw.multiscale.results.figures.style import MODELS as LOOKS

parser = argparse.ArgumentParser()
parser.add_argument("--quick", action="store_true")
parser.add_argument("--out", type=Path, default=Path("results/four_models"))
choice = parser.parse_args()
choice.out.mkdir(parents=True, exist_ok=True)

# %% [markdown]
# Set 1 of the paper's Table 1: isotropic, two to ten waves per side, Hurst exponent 0.95; the
# amplitude is fixed by the rms gradient, which reproduces the paper's pressures.

# %%
spectrum = Spectrum(hurst=0.95, waves=(2, 10), rms_slope=0.215, seed=1)
surface = synthesise(spectrum, grid=(256, 256), lengths=(1.0, 1.0))
asperities = find_asperities(surface)
whole = PatchGrid(grid=(1, 1), lengths=surface.lengths)

# %% [markdown]
# One curve per model over the approach, from first touch to 16 µm.

# %%
MODULUS = Material(young_modulus=4000.0, poisson_ratio=0.15).contact_modulus
approaches = np.linspace(0.0, 16e-3, 9 if choice.quick else 81)[1:]
curves = {
    name: press_along(
        AsperityModel(name, asperities, contact_modulus=MODULUS),
        approaches,
        patches=whole,
        mean_heights=patch_means(surface, whole),
    )
    for name in MODELS
}


# %%
def at(axes):
    """Return that places are shares of the axes."""
    return {"transform": axes.transAxes}


use_style()
figure = new_figure(FULL_WIDTH, 2.9)
motion, area = figure.subplots(1, 2)
height, modulus = 1e3 * roughness(surface).sq, 1e3 / MODULUS
for name, states in curves.items():
    look = {"color": LOOKS[name]["color"], "ls": LOOKS[name]["ls"]}
    if name.startswith("circular"):  # nearly the same: dots on the lines
        look |= {"ls": "", "marker": "o", "ms": 3.5, "markevery": 5, "mfc": LOOKS[name].get("mfc")}
    pressure = modulus * stacked(states, "mean_pressure")
    motion.plot(1e3 * stacked(states, "approach") / height, pressure, **look)
    area.plot(pressure, 100 * stacked(states, "contact_area_fraction"), **look)
motion.set(xlabel="approach / rms height", ylabel="mean pressure / E* [10⁻³]")
area.set(xlabel="mean pressure / E* [10⁻³]", ylabel="contact area [% of the face]")
motion.text(
    0.02, 0.93, "lines: elliptic contacts\ncircles: circular contacts", va="top", **at(motion)
)
motion.text(0.74, 0.66, "without\ninteraction", ha="right", **at(motion))
motion.text(0.98, 0.3, "with interaction", ha="right", **at(motion))
area.text(0.02, 0.93, "all four models", va="top", **at(area))
less = 1.0 - stacked(curves["elliptic"], "mean_pressure") / stacked(
    curves["elliptic-independent"], "mean_pressure"
)
about = {"answer": f"by up to {100.0 * less.max():.0f} %"}
figure.savefig(choice.out / "four_models.png", metadata=about)
# %%
print("mean pressure [MPa] and contact area [%] at an approach of 16 µm")
for name, states in curves.items():
    pressure, area = states[-1].mean_pressure, 100 * states[-1].contact_area_fraction
    print(f"  {name:22s} {pressure:7.3f} {area:7.3f}")

# %% [markdown]
# Interaction always softens: a plane needs less force for the same approach when contacts push
# each other's summits down. The shape of the contacts changes the force by a few per cent only.

# %%
pressures = {name: states[-1].mean_pressure for name, states in curves.items()}
assert pressures["elliptic"] < 0.9 * pressures["elliptic-independent"]
assert abs(pressures["elliptic"] / pressures["circular"] - 1) < 0.05
