# %% [markdown]
# # A rough block, pressed
#
# What one learns: what this package is about, in one picture. A rigid plane presses a rough
# block. It is in contact on a few spots only, and the stresses below them spread into the block.
# Patch laws carry the same force on a flat block, whose mesh does not resolve the roughness.
#
#      δ │ rigid plane                    rough: p ≥ 0, gap ≥ 0, p · gap = 0 in every cell of the
#     ═══╧══════════════                  surface, on the block (concurrent)
#     ┌/\_/\/\__/\_/\/\┐
#     │     block      │                  flat: p_i(c_i) on patch i, laws made from such contact
#     └────────────────┘  clamped         problems (consistent), finite elements below
#
# Run time: 15 s. `--quick` for a coarse surface, `--out DIR` for the folder of the figure; works
# under `mpirun -n N` as well.

# %%
import argparse
from pathlib import Path

import numpy as np
from matplotlib.cm import ScalarMappable
from mpi4py import MPI

from patchlaw.multiscale import Scene, make_setup, run
from patchlaw.multiscale.results.figures import style
from patchlaw.multiscale.results.figures.surface import BlockView

parser = argparse.ArgumentParser()
parser.add_argument("--quick", action="store_true")
parser.add_argument("--out", type=Path, default=Path("results/rough_block"))
choice = parser.parse_args()

COMM = MPI.COMM_WORLD
GRID, WAVES, PATCHES, CELLS = (64, 12, 4, 12) if choice.quick else (256, 32, 8, 32)
SCENE = {
    "surface": {
        "spectrum": {"hurst": 0.8, "waves": [2, WAVES], "rms_slope": 0.05, "seed": 1},
        "grid": [GRID, GRID],
        "lengths": ["0.5 mm", "0.5 mm"],
    },
    "block": {"young_modulus": "4 GPa", "poisson_ratio": 0.15, "cells": [CELLS, CELLS, CELLS // 2]},
    "patches": {"grid": [PATCHES, PATCHES]},
    "micro": {"model": "half-space"},
    "load": {"force": "1.5 N", "steps": 1},
    "output": {"check": "none"},
}

# %% [markdown]
# The block with its roughness, then the flat one with a law per patch, on a plain mesh. The
# stresses that are drawn are those of a half-space under the pressures of the rough one.

# %%
LAWS = {"kind": "consistent"}
rough = Scene.from_dict(SCENE | {"coupling": {"kind": "concurrent"}})
flat = Scene.from_dict(
    SCENE | {"coupling": LAWS | {"table_tolerance": 1e-2 if choice.quick else 1e-3}}
)
pressed, embedded = run(rough, COMM), run(flat, COMM)
contact, patches = pressed.contact, embedded.patches
if COMM.rank == 0:
    area = 100 * pressed.contact_area_fraction[-1]
    print(f"{pressed.force_N[-1]:g} N on {len(contact.spots)} spots, {area:.1f} % of the face")
    for name, history in (("rough block", pressed), (f"{patches.count} laws", embedded)):
        print(f"  {name:12s} approach {1e3 * history.approach_mm[-1]:.4f} µm")


# %%
def draw_plane(axes, view):
    """Draw the rigid plane, lifted off the part of the block that is shown, and its load."""
    (lx, ly), near = view.size, view.y[view.row]
    high = view.relief.max() + 0.36 * lx
    corners = [(0, near, high), (lx, near, high), (lx, ly, high), (0, ly, high)]
    axes.fill(*view.seen(*np.transpose(corners)), fc="#56b4e9", ec="0.3", lw=0.9, alpha=0.13)
    arrow = {"arrowstyle": "-|>", "color": "0.25", "shrinkA": 0.0, "shrinkB": 0.0}
    for x in (0.25 * lx, 0.5 * lx, 0.75 * lx):
        foot = view.seen(x, 0.5 * (near + ly), high)
        axes.annotate("", foot, (foot[0], foot[1] + 0.16 * lx), arrowprops=arrow)
    axes.text(
        foot[0] + 0.03 * lx,
        foot[1] + 0.1 * lx,
        f"rigid plane,\n{SCENE['load']['force']}",
        va="center",
    )


if COMM.rank == 0:
    style.use_style()
    parts = make_setup(rough).parts
    view = BlockView(parts.surface, contact.pressure_MPa, parts.materials.first.poisson_ratio)
    figure = style.new_figure(style.FULL_WIDTH, 4.25)
    figure.set_layout_engine("none")  # axes are placed by hand
    block = figure.add_axes((0.005, 0.13, 0.635, 0.85))
    view.draw(block)
    draw_plane(block, view)
    bar = figure.add_axes((0.14, 0.11, 0.34, 0.02))
    bar.grid(False)
    stresses = ScalarMappable(view.stresses, style.STRESSES)
    label = f"von Mises stress [MPa] on the cut (dashed line; heights × {view.exaggeration:g})"
    figure.colorbar(stresses, cax=bar, orientation="horizontal", label=label)
    bar.set_xticks([0, 25, 50, 100, 150])
    above, below = (figure.add_axes((0.71, low, 0.19, 0.322)) for low in (0.61, 0.11))
    style.map_axes(above, contact.lengths_mm)
    shown = np.ma.masked_less_equal(contact.pressure_MPa, 0.0).T
    extent = (*above.get_xlim(), *above.get_ylim())
    look = {"origin": "lower", "extent": extent, "cmap": style.PRESSURES, "norm": view.pressures}
    spots = above.imshow(shown, **look)
    style.draw_patch_borders(above, patches)
    above.axhline(view.y[view.row], color="0.2", lw=0.8, ls=(0, (5, 3)))
    above.set(title=f"{len(contact.spots)} contact spots from above", xlabel="")
    style.colour_bar(spots, above, "contact pressure [MPa]")
    style.draw_pressures(below, patches, embedded.patch_pressure_MPa[-1], label="mean pressure")
    below.set(title=f"what {patches.count} patch laws carry")
    choice.out.mkdir(parents=True, exist_ok=True)
    answer = f"on {len(contact.spots)} spots, {area:.0f} % of its face"
    path, about = choice.out / "rough_block.png", {"answer": answer}
    figure.savefig(path, metadata=about, pil_kwargs={"optimize": True})

# %% [markdown]
# The same force at the same approach, and each patch carries what its spots carry.

# %%
laws, spots = embedded.patch_pressure_MPa[-1], pressed.patch_pressure_MPa[-1]
assert abs(embedded.approach_mm[-1] / pressed.approach_mm[-1] - 1) < 1e-2
assert np.abs(laws - spots).max() < 1e-2 * spots.max()
