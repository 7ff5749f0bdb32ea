"""Make laws on all ranks; print how many contact problems of consistent ones each solved.

Those at the larger approach are shared by the ranks; those at the smaller one are quick.
"""

import hashlib
from dataclasses import replace

from helpers.on_ranks import tell
from mpi4py import MPI

from patchlaw.geometry import Control, PatchGrid, Spectrum, patch_means, synthesise
from patchlaw.micro import micro_model
from patchlaw.multiscale import consistent_laws, representative_laws
from patchlaw.multiscale.laws.law_table import law_bytes

COMM = MPI.COMM_WORLD


class Counted:
    """A micro model that counts what it solves on this rank."""

    def __init__(self, model):
        self.model, self.solved = model, 0

    def __getattr__(self, name):
        return getattr(self.model, name)

    def quick_up_to(self, control, error, **options):
        quick = self.model.quick_up_to(control, error, **options)
        if quick is None:
            return None
        self.model = quick
        return self

    def press(self, *arguments, **more):
        self.solved += 1
        return self.model.press(*arguments, **more)


def main():
    """Tabulate the laws of sixteen patches of a small surface, and of two regions of a face."""
    spectrum = Spectrum(hurst=0.95, waves=(2, 10), rms_slope=0.215, seed=3)
    surface = synthesise(spectrum, grid=(64, 64), lengths=(1.0, 1.0))
    patches = PatchGrid(grid=(4, 4), lengths=surface.lengths)
    solved, hashes = [], []
    for approach in (30e-3, 8e-3):
        model = Counted(micro_model("half-space", surface, contact_modulus=4000.0))
        table = consistent_laws(
            model, patches, mean_heights=patch_means(surface, patches),
            largest=Control(approach=approach, tilt=(0.0, 0.0)), comm=COMM,
        )  # fmt: skip
        solved.append(model.solved)
        hashes.append(hashlib.sha256(law_bytes(table)).hexdigest())
    samples = [
        synthesise(replace(spectrum, waves=(2, 5), seed=k), grid=(16, 16), lengths=(1.0, 1.0))
        for k in (1, 2, 3)
    ]
    regions = {"inner": samples[:1], "outer": samples}
    table = representative_laws(regions, 4000.0, largest_pressure=1500.0, comm=COMM)
    representative = hashlib.sha256(law_bytes(table)).hexdigest()
    found = COMM.gather((*solved, *hashes, representative))
    tell(found)


main()
