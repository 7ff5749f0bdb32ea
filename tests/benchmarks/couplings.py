"""What consistent laws, the condensed block and the concurrent coupling cost on the paper's cube.

Run by hand: `.venv/bin/python tests/benchmarks/couplings.py`. Medians of five, one thread.
"""

import os

os.environ["OMP_NUM_THREADS"] = "1"
os.environ["PATCHLAW_CACHE"] = "off"

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
    contact_spread,
    load_steps,
)

REPEATS = 5
APPROACH = 8e-3
MATERIAL = Material(young_modulus=4000.0, poisson_ratio=0.15)
LOADS = PatchGrid(grid=(16, 16), lengths=(1.0, 1.0))


def median(action):
    """Return the median time of an action [s], and what it returned last."""
    times = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        result = action()
        times.append(time.perf_counter() - start)
    return statistics.median(times), result


def correction():
    shape = BlockShape(interface=(1.0, 1.0), height=1.0, cells=(16, 16, 12))
    half_space = HalfSpace(MATERIAL.young_modulus, MATERIAL.poisson_ratio)
    return make_correction(shape, MATERIAL, "free", LOADS, half_space, MPI.COMM_SELF)


def surface_of(cells):
    spectrum = Spectrum(hurst=0.95, waves=(2, 10), rms_slope=0.215, seed=1)
    return synthesise(spectrum, grid=(cells, cells), lengths=(1.0, 1.0))


def main():
    spent, rest = median(correction)
    print(f"smooth rest of the block, 256 loads, 16 × 16 × 12 cells: {spent:.2f} s")
    surface = surface_of(256)
    model = HalfSpaceModel(surface=surface, contact_modulus=MATERIAL.contact_modulus)
    for count in (4, 16):
        patches = PatchGrid(grid=(count, count), lengths=surface.lengths)
        means = patch_means(surface, patches)
        given = {"mean_heights": means, "approach_end": 1.2 * APPROACH}
        for rows in (33, 65):
            spent, table = median(
                lambda rows=rows: consistent_laws(model, patches, most_rows=rows, **given)
            )
            used = max(law.approach.size for law in table.laws)
            print(f"laws of {count**2} patches, 256² heights, {used} rows: {spent:.2f} s")
        spread = contact_spread(model, patches, LOADS, approach_end=1.2 * APPROACH)
        under_patches = influence_matrix(patches) / (3.141592653589793 * model.contact_modulus)
        under_loads = rest.patch_compliance(LOADS) / LOADS.area
        block = SpreadLoads(under_patches, under_loads, spread)
        plain = under_patches + rest.patch_compliance(patches)
        programme = Programme(quantity="approach", points=(APPROACH,), steps=100)
        for name, yielding in (("mean over patches", plain), ("where contacts are", block)):
            spent, _ = median(
                lambda y=yielding: list(load_steps(CondensedCoupling(table, y), programme))
            )
            print(f"100 condensed load steps, {count**2} patches, rest {name}: {spent:.3f} s")
    for cells in (64, 128, 256):
        surface = surface_of(cells)
        model = HalfSpaceModel(
            surface=surface, contact_modulus=MATERIAL.contact_modulus, tolerance=1e-10
        )
        patches = PatchGrid(grid=(4, 4), lengths=surface.lengths)
        means = patch_means(surface, patches)
        alone, _ = median(lambda: model.solve(APPROACH))

        def pressed():
            coupling = ConcurrentCoupling(model, patches, means, rest)
            steps = [coupling.press(Control(approach=APPROACH * k / 8)) for k in range(1, 9)]
            return [step.newton_iterations for step in steps]

        spent, presses = median(pressed)
        print(
            f"8 concurrent load steps, {cells}² heights: {spent:.2f} s, presses {presses}; "
            f"contacts alone, one cold solution: {alone:.3f} s"
        )


if __name__ == "__main__":
    main()
