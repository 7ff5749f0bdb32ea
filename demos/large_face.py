# %% [markdown]
# # A large crowned face: where does roughness change Hertz?
#
# What one learns: how a face of 20 mm gets the law of a roughness of 0.1 mm from a few periodic
# samples, how large these must be, and when the pressure under a slightly crowned face is still
# that of Hertz: where α = σ R/a² is below a twentieth (Greenwood & Tripp 1967).
#
#     samples → pressure over closure, mean and scatter → every quadrature point of a smooth face,
#     (periodic half-space)                               closure = approach − crown − displaced
#
# Run time: 20 s. `--quick` for coarser meshes, `--out DIR` for the folder of the figure.

# %%
import argparse
from pathlib import Path

import numpy as np
from matplotlib import colormaps
from mpi4py import MPI

from patchlaw.geometry import BlockShape, Control, Material, PatchGrid, Spectrum, synthesise
from patchlaw.macro import Block, LawContactProblem, LoadedFace, block_mesh
from patchlaw.multiscale import representative_law
from patchlaw.multiscale.results.figures import style

parser = argparse.ArgumentParser()
parser.add_argument("--quick", action="store_true")
parser.add_argument("--out", type=Path, default=Path("results/large_face"))
choice = parser.parse_args()

STEEL = Material(young_modulus=210e3, poisson_ratio=0.3)
ROUGHNESS = 1e-3  # rms height [mm]
LONGEST = 0.1  # longest wave [mm]
RADIUS = 2000.0  # of the crown [mm]
FACE = 20.0  # side of the face [mm]
FORCES = (30.0, 300.0, 3000.0, 20000.0)  # [N]
LARGEST = 600.0  # local pressure [MPa]
CELLS = 17 if choice.quick else 41


# %% [markdown]
# Samples as long as 1 and 4 of the longest waves; six of each.
def samples(waves):
    """Return six samples that are as long as a number of the longest waves."""
    band = (waves, 8 * waves)
    sides = (waves * LONGEST, waves * LONGEST)
    for seed in range(1, 7):
        spectrum = Spectrum(hurst=0.8, waves=band, rms_slope=0.1, seed=seed)
        surface = synthesise(spectrum, grid=(32 * waves, 32 * waves), lengths=sides)
        yield surface.scaled(ROUGHNESS / float(surface.heights.std()))


laws = {
    waves: representative_law(list(samples(waves)), STEEL.contact_modulus, largest_pressure=LARGEST)
    for waves in (1, 4)
}
for waves, law in laws.items():
    rows = law.rows
    scatter = np.interp(50.0, rows.pressure, rows.pressure_scatter) / 50.0
    print(f"samples of {waves} longest waves: {scatter:.0%} scatter of the pressure at 50 MPa")

# %% [markdown]
# The crowned face: a flat mesh, and the crown as a gap that adds to the closure. Strips across the
# face tell the force per length; Hertz' is a parabola.
shape = BlockShape(
    interface=(FACE, FACE),
    height=2.0 * FACE,
    cells=(CELLS, CELLS, CELLS // 3),
    grading=10.0,
    margin=FACE,
    margin_cells=4,
    margin_grading=4.0,
)
block = Block(block_mesh(shape, MPI.COMM_SELF), STEEL)
strips = PatchGrid(grid=(CELLS, 1), lengths=(FACE, FACE))
law = laws[4]
problem = LawContactProblem(
    LoadedFace.of_block(block, strips),
    [law] * CELLS,
    "pointwise",
    crown=lambda x, y: ((x - 0.5 * FACE) ** 2 + (y - 0.5 * FACE) ** 2) / (2.0 * RADIUS),
)
found = []
print("| force [N] | α | effective radius over Hertz' | middle line over Hertz' | Newton |")
print("|---|---|---|---|---|")
for force in FORCES:
    state = problem.solve(Control(force=force))
    line = state.patch_pressure * FACE  # force per length [N/mm]
    hertz = (0.75 * force * RADIUS / STEEL.contact_modulus) ** (1 / 3)
    alpha = ROUGHNESS * RADIUS / hertz**2
    middle = 0.75 * force / hertz  # of Hertz' parabola; its radius is (3/4) force / middle
    ratio = line[CELLS // 2] / middle
    found.append((force, alpha, hertz, middle, line))
    steps = state.iterations
    print(f"| {force:g} | {alpha:.3f} | {1 / ratio:.3f} | {ratio:.3f} | {steps} |")

# %%
style.use_style()
figure = style.new_figure(style.FULL_WIDTH, 3.0)
left, right = figure.subplots(1, 2)
LABELS = (style.ORANGE, (0.38, 0.22), "left"), (style.BLUE, (0.98, 0.95), "right")
for (waves, law), (colour, place, side) in zip(laws.items(), LABELS, strict=True):
    separation = 1e3 * (law.initial_separation - law.rows.closure)
    left.plot(separation, law.rows.pressure, color=colour)
    band = [law.rows.pressure + sign * law.rows.pressure_scatter for sign in (-1.0, 1.0)]
    left.fill_between(separation, *band, color=colour, alpha=0.2, lw=0.0)
    text = f"samples of\n{waves} longest wave{'s' if waves > 1 else ''},\nand their scatter"
    left.text(*place, text, color=colour, ha=side, va="top", transform=left.transAxes)
left.set(xlabel="mean separation / rms height", ylabel="mean pressure [MPa]")
left.set(yscale="log", ylim=(0.1, LARGEST))
along = np.linspace(-3.2, 3.2, 400)
right.plot(along, np.maximum(1.0 - along**2, 0.0), "--", color=style.INK, lw=1.0)
right.text(0.35, 1.0, "Hertz", color=style.INK)
shades = colormaps["viridis"](np.linspace(0.0, 0.85, len(found)))
for (force, alpha, hertz, middle, line), colour in zip(found, shades, strict=True):
    x, y = (strips.centres[:, 0] - 0.5 * FACE) / hertz, line / middle
    right.plot(x, y, ".-", color=colour, label=f"{alpha:.2g}  ({1e-3 * force:g} kN)")
right.set(xlabel="distance / Hertz' radius", ylabel="force per length / Hertz' largest")
right.set(xlim=(-3.2, 3.2))
right.legend(title="σR/a²", loc="upper left", handlelength=1.2)
choice.out.mkdir(parents=True, exist_ok=True)
figure.savefig(choice.out / "large_face.png")

# %%
peaks = [line[CELLS // 2] / middle for _, _, _, middle, line in found]
assert np.all(np.diff(peaks) > 0.0)  # rough faces spread the pressure, less under larger loads
assert abs(peaks[-1] - 1.0) < 0.07  # up to α = 0.05 (Greenwood, Johnson & Matsubara 1984)
