# %% [markdown]
# # The paper's figures, 1: one asperity and one surface (Figures 3, 5 and 6)
#
# What one learns: what the shape of a contact does to its force, area and surroundings, how good
# the approximate eccentricity is, and what a surface of Set 1 looks like. Waddad et al. 2016
# (doi 10.1016/j.triboint.2015.12.023); `index.html` puts their claims beside what this run finds.
# `paper_figures_models.py` (7, 8, 9) and `paper_figures_block.py` (14, 15, times) add theirs.
#
# Run time: 3 s. `--quick` for a coarser surface, `--out DIR` for the folder.

# %%
import argparse
from pathlib import Path

import numpy as np
from paper.page import Page

from patchlaw.geometry import Material, Spectrum, find_asperities, power_spectrum, synthesise
from patchlaw.micro import HertzContact
from patchlaw.micro.closed_forms import factors_at, shape_factors
from patchlaw.multiscale.results.figures.style import (
    BLUE,
    FULL_WIDTH,
    GREEN,
    HEIGHTS,
    colour_bar,
    new_figure,
    use_style,
)
from patchlaw.multiscale.results.figures.style import VERMILLION as RED
from patchlaw.multiscale.results.figures.surface import draw_surface

parser = argparse.ArgumentParser()
parser.add_argument("--quick", action="store_true")
parser.add_argument("--out", type=Path, default=Path("results/paper_figures"))
choice = parser.parse_args()
page, grid = Page(choice.out), 2 * (64 if choice.quick else 256,)
MODULUS = Material(young_modulus=4000.0, poisson_ratio=0.15).contact_modulus
use_style()

# %% [markdown]
# Figure 3. The limits are Johnson's: 1 for spheres, and with K → Λ = ln(4a/b), E → 1 for slender
# contacts F1 → (π/√2) sqrt(a/b) (Λ − 1)^(1/4) Λ^(−3/2).

# %%
ratio = np.geomspace(1.0, 100.0, 200)
exact, paper = shape_factors(ratio, 1.0), factors_at(np.sqrt(1.0 - ratio ** (-4.0 / 3.0)))
figure = new_figure(FULL_WIDTH, 2.9)
over_ratio, over_e = figure.subplots(1, 2)
for shape, name, style in ((exact, "exact", "-"), (paper, "paper's eq. 2", "--")):
    over_ratio.semilogx(ratio, shape.force, style, color=BLUE, label=f"F1, {name}")
    over_ratio.semilogx(ratio, shape.area, style, color=RED, label=f"A1, {name}")
e = np.linspace(0.0, 0.999, 500)
over_e.plot(e, factors_at(e).force, color=BLUE, label="F1")
over_e.plot(e, factors_at(e).area, color=RED, label="A1")
over_ratio.set(xlabel="radius ratio R'/R'' [-]", ylabel="F1, A1 [-]")
over_e.set(xlabel="eccentricity e [-]", ylabel="F1, A1 [-]")
(f, a), (f2, a2) = ((shape.force, shape.area) for shape in (exact, paper))
ten = np.searchsorted(ratio, 10.0)
for axes in (over_ratio, over_e):
    axes.legend()
found = f"at R'/R'' = 10: F1 = {f[ten]:.3f}, A1 = {a[ten]:.3f}; the approximate eccentricity of "
found += f"eq. 2 changes them by {f2[ten] / f[ten] - 1:+.2%} and {a2[ten] / a[ten] - 1:+.2%}."
claim = "circles overestimate the area and underestimate the force where e is high."
page.add("Figure 3", "factors of an elliptic contact", figure, claim, found)
thin, log = 1e-6, np.log(4.0 / 1e-6)
slender = np.pi / np.sqrt(2.0 * thin) * (log - 1.0) ** 0.25 * log**-1.5
assert abs(factors_at(np.sqrt(1 - thin**2)).force / slender - 1) < 1e-3
assert abs(f[0] - 1) + abs(a[0] - 1) < 1e-12 and f[ten] > 1.0 > a[ten]

# %% [markdown]
# Figure 5. One contact of R'/R'' = 4, and a circular one of equal R and indentation.

# %%
depth, major, minor = 1e-3, 0.2, 0.05  # mm
ellipse, circle = (
    HertzContact(contact_modulus=MODULUS, radius_major=R1, radius_minor=R2, indentation=depth)
    for R1, R2 in ((major, minor), (0.1, 0.1))
)
a, b = float(ellipse.semi_major), float(ellipse.semi_minor)
r = np.linspace(0.0, 5.0 * a, 401)
along, across = ellipse.displacement(r, 0), ellipse.displacement(0, r)
figure = new_figure(FULL_WIDTH, 2.9)
field, cut = figure.subplots(1, 2)
span = np.linspace(-3 * a, 3 * a, 201)
levels = np.linspace(0.0, 1e3 * depth, 11)
field_map = 1e3 * ellipse.displacement(span[None, :], span[:, None])
image = field.contourf(1e3 * span, 1e3 * span, field_map, levels, cmap=HEIGHTS)
field.contour(1e3 * span, 1e3 * span, np.hypot(span / a, span[:, None] / b), [1.0], colors="w")
field.set(xlabel="x [µm]", ylabel="y [µm]", aspect="equal", title="white: border of the contact")
colour_bar(image, field, "normal displacement [µm]")
curves = {"major axis": along, "minor axis": across, "circular": circle.displacement(r, 0)}
for (name, u), look in zip(curves.items(), ("-", "--", ":"), strict=True):
    cut.plot(1e3 * r, 1e3 * u, look, color={"-": BLUE, "--": RED, ":": GREEN}[look], label=name)
cut.set(xlabel="distance from the centre [µm]", ylabel="normal displacement [µm]")
cut.legend()
apart = (along - across) / across
found = f"displacement on the major axis against that on the minor one: {apart[80]:+.0%} at r = a, "
found += f"{apart[160]:+.1%} at 2a, {apart[-1]:+.2%} at 5a (R'/R'' = 4)."
claim = "the difference is largest along the major axis and fades far from the contact."
page.add("Figure 5", "displacement by an elliptic contact", figure, claim, found)
inside = r < b
parabola = depth - r[inside] ** 2 / (2 * minor)
assert np.allclose(across[inside], parabola, rtol=0, atol=1e-12)  # the plane touches there
assert abs(along[-1] / (ellipse.force / (np.pi * MODULUS * r[-1])) - 1) < 0.03  # a point force

# %% [markdown]
# Figure 6. Set 1: two to ten waves per side, Hurst exponent 0.95. The paper gives the amplitude in
# a figure only; a rms gradient of 0.215 reproduces its pressures.

# %%
spectrum = Spectrum(hurst=0.95, waves=(2, 10), rms_slope=0.215, seed=1)
surface = synthesise(spectrum, grid=grid, lengths=(1.0, 1.0))
density = power_spectrum(surface)
band = (density.wavenumber > 5 * np.pi) & (density.wavenumber < 19 * np.pi)  # whole rings
q, S = density.wavenumber[band], density.density[band]
slope, start = np.polyfit(np.log(q), np.log(S), 1)
figure = new_figure(FULL_WIDTH, 3.0)
spectral, heights = figure.subplots(1, 2)
spectral.loglog(q, S, "o", color=BLUE, label="this surface, by rings")
spectral.loglog(q, np.exp(start) * q**slope, "--", color=RED, label=f"slope {slope:.2f}")
spectral.set(xlabel="angular wavenumber [rad/mm]", ylabel="spectral density [mm⁴]")
summits = find_asperities(surface)
draw_surface(heights, surface, summits)
spectral.legend()
height = 1e3 * density.variance**0.5
found = f"slope {slope:.2f}, rms height {height:.1f} µm, {len(summits)} summits."
claim = "S ∝ |k|^(−2(H + 1)) = |k|^(−3.9) between 2 and 10 waves per side."
page.add("Figure 6", "spectrum and surface", figure, claim, found)
assert abs(slope + 3.9) < 0.1
