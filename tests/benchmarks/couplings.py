"""What consistent laws, the condensed block and the concurrent coupling cost on the paper's cube.

Run by hand: `.venv/bin/python tests/benchmarks/couplings.py`. Medians of five, one thread.
"""

import os

os.environ["OMP_NUM_THREADS"] = "1"
os.environ["PATCHLAW_CACHE"] = "off"

import math
import statistics
import time

from mpi4py import MPI

from geometry import BlockShape, Control, PatchGrid, Spectrum, patch_means, synthesise
from macro import Material, make_correction
from micro import HalfSpace, HalfSpaceModel, influence_matrix
from multiscale import (
    ConcurrentCoupling,
    CondensedCoupling,
    Programme,
    SpreadLoads,
    consistent_laws,
    load_steps,
)

REPEATS = 5
APPROACH = 8e-3
MATERIAL = Material(young_modulus=4000.0, poisson_ratio=0.15)
LOADS = PatchGrid(grid=(16, 16), lengths=(1.0, 1.0))


def median(action, *given, **options):
    """Return the median time of an action [s], and what it returned last."""
    times = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        result = action(*given, **options)
        times.append(time.perf_counter() - start)
    return statistics.median(times), result


def correction():
    shape = BlockShape(interface=(1.0, 1.0), height=1.0, cells=(16, 16, 12))
    half_space = HalfSpace(MATERIAL.young_modulus, MATERIAL.poisson_ratio)
    return make_correction(shape, MATERIAL, "free", LOADS, half_space, MPI.COMM_SELF)


def surface_of(cells):
    spectrum = Spectrum(hurst=0.95, waves=(2, 10), rms_slope=0.215, seed=1)
    return synthesise(spectrum, grid=(cells, cells), lengths=(1.0, 1.0))


def condensed(table, yielding):
    """Press a hundred steps."""
    programme = Programme(quantity="approach", points=(APPROACH,), steps=100)
    return list(load_steps(CondensedCoupling(table, yielding), programme))


def by_laws(rest, count):
    """Print the times of laws and of load steps with them."""
    surface = surface_of(256)
    model = HalfSpaceModel(surface=surface, contact_modulus=MATERIAL.contact_modulus)
    patches = PatchGrid(grid=(count, count), lengths=surface.lengths)
    given = {"mean_heights": patch_means(surface, patches), "approach_end": 1.2 * APPROACH}
    for block, where in ((None, "half-space"), (rest, "block")):
        for rows in (33, 65):
            more = given | {"most_rows": rows, "sinking": block}
            spent, table = median(consistent_laws, model, patches, **more)
            used = max(law.approach.size for law in table.laws)
            print(f"laws of {count**2} patches on a {where}, 256², {used} rows: {spent:.2f} s")
    table = consistent_laws(model, patches, **given)
    under_patches = influence_matrix(patches) / (math.pi * model.contact_modulus)
    on_block = consistent_laws(model, patches, sinking=rest, **given)
    for name, laws, yielding in (
        ("mean over patches", table, under_patches + rest.patch_compliance(patches)),
        ("where contacts are", on_block, SpreadLoads(under_patches, on_block.spread)),
    ):
        spent, _ = median(condensed, laws, yielding)
        print(f"100 condensed load steps, {count**2} patches, rest {name}: {spent:.3f} s")


def together(rest, model, patches, means):
    """Press eight steps; return how often contacts were solved for in each."""
    coupling = ConcurrentCoupling(model, patches, means, rest)
    steps = [coupling.press(Control(approach=APPROACH * k / 8)) for k in range(1, 9)]
    return [step.newton_iterations for step in steps]


def by_contacts(rest, cells):
    """Print the times of the concurrent coupling, and of its contacts alone."""
    surface, patches = surface_of(cells), PatchGrid(grid=(4, 4), lengths=(1.0, 1.0))
    modulus = MATERIAL.contact_modulus
    model = HalfSpaceModel(surface=surface, contact_modulus=modulus, tolerance=1e-10)
    alone, _ = median(model.solve, APPROACH)
    spent, presses = median(together, rest, model, patches, patch_means(surface, patches))
    print(
        f"8 concurrent load steps, {cells}² heights: {spent:.2f} s, presses {presses}; "
        f"contacts alone, one cold solution: {alone:.3f} s"
    )


def main():
    spent, rest = median(correction)
    print(f"smooth rest of the block, 256 loads, 16 × 16 × 12 cells: {spent:.2f} s")
    for count in (4, 16):
        by_laws(rest, count)
    for cells in (64, 128, 256):
        by_contacts(rest, cells)


if __name__ == "__main__":
    main()
