"""What consistent laws, the condensed block and the concurrent coupling cost on the paper's cube.

Run by hand: `.venv/bin/python benchmarks/couplings.py [--json FILE]`. Medians of five, one
thread.
"""

import os

os.environ["OMP_NUM_THREADS"] = "1"
os.environ["PATCHLAW_CACHE"] = "off"

import argparse
import statistics
import time
from dataclasses import replace

from json_rows import keep
from mpi4py import MPI

from patchlaw.geometry import BlockShape, Control, PatchGrid, Spectrum, patch_means, synthesise
from patchlaw.macro import Material
from patchlaw.micro import FreeSides, HalfSpaceModel
from patchlaw.multiscale import CellContact, LoadHistory, PatchContact, Problem, consistent_laws
from patchlaw.multiscale.bodies.face_terms import FaceTerms, block_term

REPEATS = 5
APPROACH = 8e-3
MATERIAL = Material(young_modulus=4000.0, poisson_ratio=0.15)


def median(action, *given, **options):
    """Return the median time of an action [s], and what it returned last."""
    times = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        result = action(*given, **options)
        times.append(time.perf_counter() - start)
    return statistics.median(times), result


def block():
    """Return the compliance of the cube's top in modes."""
    shape = BlockShape(interface=(1.0, 1.0), height=1.0, cells=(1, 1, 1))
    sides = FreeSides(lengths=(1.0, 1.0), poisson_ratio=MATERIAL.poisson_ratio, decay_length=0.25)
    body = FaceTerms((block_term(shape, MATERIAL, "free", sides),))
    return body, body.face(MPI.COMM_SELF)


def models(cells, body, face):
    """Return the contact problems of a surface on a half-space and on the cube."""
    alone = HalfSpaceModel(
        surface=surface_of(cells), contact_modulus=MATERIAL.contact_modulus, tolerance=1e-10
    )
    return alone, replace(alone, sides=body.side_term, body=body.term(face))


def surface_of(cells):
    spectrum = Spectrum(hurst=0.95, waves=(2, 10), rms_slope=0.215, seed=1)
    return synthesise(spectrum, grid=(cells, cells), lengths=(1.0, 1.0))


def condensed(table, compliance):
    """Press a hundred steps."""
    load_history = LoadHistory(approach=(APPROACH,), steps=100)
    return list(Problem(PatchContact(table, compliance), load_history).steps())


def by_laws(body, face, count, json):
    """Print the times of laws and of load steps with them."""
    _, model = models(256, body, face)
    patches = PatchGrid(grid=(count, count), lengths=model.surface.lengths)
    compliance = body.patch_compliance(patches, MPI.COMM_SELF)
    for rows in (33, 65):
        spent, table = median(
            consistent_laws,
            model,
            patches,
            mean_heights=patch_means(model.surface, patches),
            largest=Control(approach=APPROACH),
            displacements=lambda pressures: pressures @ compliance.T,
            most_rows=rows,
        )
        used = max(len(law.rows) for law in table.laws)
        print(f"laws of {count**2} patches on the block, 256², {used} rows: {spent:.2f} s")
        keep(json, patches=count**2, most_rows=rows, rows=used, seconds=spent)
    spent, _ = median(condensed, table, compliance)
    print(f"100 condensed load steps, {count**2} patches: {spent:.3f} s")
    keep(json, patches=count**2, steps=100, seconds=spent)


def together(model):
    """Press eight steps."""
    patches = PatchGrid(grid=(4, 4), lengths=model.surface.lengths)
    coupling = CellContact(model, patches, patch_means(model.surface, patches))
    return [coupling.press(Control(approach=APPROACH * k / 8)) for k in range(1, 9)]


def by_contacts(body, face, cells):
    """Print the times of load steps on the half-space and on the block."""
    alone, block = (median(together, model)[0] for model in models(cells, body, face))
    print(
        f"8 load steps, {cells}² heights: analytic {alone:.2f} s, concurrent {block:.2f} s, "
        f"{block / alone:.2f} times as much"
    )


def main():
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--json", metavar="FILE", help="append the times of laws to it")
    json = parser.parse_args().json
    spent, (body, face) = median(block)
    print(f"compliance of the block's top: {spent:.2f} s")
    for count in (4, 16):
        by_laws(body, face, count, json)
    for cells in (64, 128, 256):
        by_contacts(body, face, cells)


if __name__ == "__main__":
    main()
