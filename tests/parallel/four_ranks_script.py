"""Runs every coupling and writes its numbers; see `test_four_ranks.py`."""

import sys
from pathlib import Path

import numpy as np
from mpi4py import MPI

from patchlaw.multiscale import Run, Scene

PAPER = Path(__file__).parents[2] / "demos" / "scenes" / "paper.toml"
SMALL = ["surface.grid=[48, 48]", "load.steps=2", "block.cells=[4, 4, 3]", "patches.grid=[1, 2]"]
# a column falls to the ranks in slices: most own none of the interface; two patches and four ranks
# leave some without a patch whose law they would tabulate
COLUMN = ["block.height=8 mm", "block.cells=[4, 4, 32]"]
HALF_SPACE = "micro.model=half-space"
REFERENCE = [
    "coupling.kind=reference", "reference.fine='150 um'", "reference.meshes=1",
    "load.approach=30 um",
]  # fmt: skip
SCENES = {
    "isolated, pointwise": [*COLUMN, "coupling.kind=isolated", "coupling.interface=pointwise"],
    "isolated, condensed": [*COLUMN, "coupling.kind=isolated"],
    "consistent, pointwise": [
        *COLUMN, "coupling.kind=consistent", HALF_SPACE, "coupling.interface=pointwise",
    ],
    "concurrent": ["coupling.kind=concurrent", HALF_SPACE],
    "analytic, one summit": ["coupling.kind=analytic", "load.approach=0.5 um"],
    "reference, active sets": [*COLUMN, *REFERENCE],
    "reference, augmented": [*COLUMN, *REFERENCE, "reference.method=augmented-lagrangian"],
}  # fmt: skip


def main():
    """Run all scenes and save a row of numbers for every load step."""
    world, numbers = MPI.COMM_WORLD, {}
    for name, changes in SCENES.items():
        run = Run(Scene.load(PAPER, [*SMALL, *changes]), world)
        steps = list(run.load_steps())
        numbers[name] = np.array([
            [s.force_N, s.contact_area_fraction, s.mean_separation_mm, *s.patches.closure_mm,
             *s.patches.pressure_MPa, *s.patches.contact_area_fraction]
            for s in steps
        ])  # fmt: skip
        if name.endswith("pointwise"):
            counts = world.gather(len(run.coupling.model.face.quadrature.x))
            numbers["facet points"] = np.array(counts if counts else [])
    if world.rank == 0:
        np.savez(sys.argv[1], **numbers)


main()
