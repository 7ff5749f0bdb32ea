"""Work of load steps in shear against normal ones, counted in transforms and processor time.

``OMP_NUM_THREADS=1 .venv/bin/python benchmarks/shear_steps.py [cells]`` presses a rough
surface of 512² cells in steps of its force, then shears it in five steps to about sliding. A
product of the half-space is one transform forth and one back; one with tractions is two of each.
The products of the approximate inverse come on top of both, one in every iteration.
"""

import argparse
import time

import numpy as np
from json_rows import keep

from patchlaw.geometry import Material, MaterialPair, ShearControl, Spectrum, synthesise
from patchlaw.micro import FrictionModel, HalfSpaceModel

STEPS, FRICTION = 4, 0.5
PARTS = (0.4, 0.8, 1.2, 1.6, 2.0)
"""Shifts over force/stiffness times friction; sliding is at 2 to 3."""


def case(cells, *, periodic, poisson_ratio):
    """Return work and time of the normal steps after the first, and of the steps in shear."""
    spectrum = Spectrum(hurst=0.8, waves=(4, cells // 8), rms_slope=0.1, seed=3)
    surface = synthesise(spectrum, grid=(cells, cells), lengths=(1.0, 1.0))
    pair = MaterialPair(first=Material(young_modulus=1.0, poisson_ratio=poisson_ratio))
    modulus = pair.contact_modulus
    normal = HalfSpaceModel(surface=surface, contact_modulus=modulus, periodic=periodic)
    friction = FrictionModel(
        materials=pair, coefficient=FRICTION, spacing=surface.spacing, periodic=periodic
    )
    pressed, work = None, {"normal": [], "shear": []}
    for step in range(1, STEPS + 1):
        began, start = time.process_time(), None if pressed is None else pressed.guess
        pressed = normal.solve_force(0.012 * modulus * step / STEPS, start=start)
        if step > 1:
            work["normal"].append((pressed.iterations, time.process_time() - began))
    reach = FRICTION * pressed.force / normal.stiffness(pressed, turns=False).approach
    state = friction.advance(None, pressed.pressures, ShearControl(shift=(0.0, 0.0)))
    for part in PARTS:
        began = time.process_time()
        shift = ShearControl(shift=(part * reach, 0.0))
        state = friction.advance(state, pressed.pressures, shift)
        work["shear"].append((2 * state.products, time.process_time() - began))
    return work, state


def main():
    """Print a line for every case."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("cells", type=int, nargs="?", default=512)
    parser.add_argument("--json", metavar="FILE", help="append the ratios to it")
    choice = parser.parse_args()
    cells = choice.cells
    print(f"{cells}² cells: normal steps at an unchanged set-up, then steps in shear")
    for periodic in (False, True):
        for poisson_ratio in (0.0, 0.3):
            work, state = case(cells, periodic=periodic, poisson_ratio=poisson_ratio)
            normal, shear = (np.mean(work[name], axis=0) for name in ("normal", "shear"))
            slips = state.slipping.sum() / state.closed.sum()
            print(
                f"{'periodic' if periodic else 'free':8} ν = {poisson_ratio}: transforms "
                f"{normal[0]:.0f} and {shear[0]:.0f}, {shear[0] / normal[0]:.2f} times; processor "
                f"{normal[1]:.2f} s and {shear[1]:.2f} s, {shear[1] / normal[1]:.2f} times "
                f"(worst step {max(one for _, one in work['shear']) / normal[1]:.2f}); at the end "
                f"{100 * slips:.0f} % of the contact slips"
            )
            ratio = shear[1] / normal[1]
            keep(choice.json, periodic=periodic, poisson_ratio=poisson_ratio, ratio=ratio)


if __name__ == "__main__":
    main()
