"""Press a surface by rank 0 for all, with a number of threads a rank; print what was found."""

import json
import os
import sys

os.environ["OMP_NUM_THREADS"] = sys.argv[1]

from mpi4py import MPI

from patchlaw.geometry import Control, PatchGrid, Spectrum, patch_means, synthesise
from patchlaw.micro import micro_model
from patchlaw.multiscale import CellContact
from patchlaw.support import cores

COMM = MPI.COMM_WORLD


class Watched:
    """A micro model that notes the cores that it may use."""

    def __init__(self, model):
        self.model, self.cores = model, 0

    def press(self, *arguments, **more):
        self.cores = cores()
        return self.model.press(*arguments, **more)


def main():
    """Press 256² cells, whose transforms are worth threads, under a force; the plane turns."""
    spectrum = Spectrum(hurst=0.9, waves=(2, 16), rms_slope=0.1, seed=3)
    surface = synthesise(spectrum, grid=(256, 256), lengths=(1.0, 1.0))
    patches = PatchGrid(grid=(4, 4), lengths=surface.lengths)
    model = Watched(micro_model("half-space", surface, contact_modulus=4000.0))
    coupling = CellContact(model, patches, patch_means(surface, patches), COMM)
    step = coupling.press(Control(force=2.0, tilt=None))
    spots = coupling.detail(coupling.latest).spots
    found = [
        step.approach_mm, *step.tilt, step.contact_area_fraction, *step.patches.pressure_MPa,
        float(spots.force.sum()), float(spots.area.sum()),
    ]  # fmt: skip
    everywhere, used = COMM.gather(found), COMM.gather(model.cores)
    if COMM.rank == 0:
        print(json.dumps({"found": everywhere, "cores": used}))


main()
