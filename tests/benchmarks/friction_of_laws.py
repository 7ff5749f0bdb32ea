"""How far are the springs of laws with friction from cells, on straight and on turning paths?

    .venv/bin/python tests/benchmarks/friction_of_laws.py [--surfaces N] [--seed S] [--alone]

Periodic half-spaces on 64² cells are drawn anew for every seed, pressed to a tenth, half and nine
tenths of the pressure that their law goes to. They are sheared on four kinds of paths: straight
loops, circles, random turns, and random turns under a varying load. Printed are, by kind, the
largest differences of the shear stress to that of cells, over the bound of friction, and the
differences of the energy lost. With ``--alone`` springs have no compliance in common. Run it from
the project's root.
"""

import argparse
import itertools
import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

from dataclasses import replace

import numpy as np

from patchlaw.geometry import Material, MaterialPair, ShearControl, Spectrum, synthesise
from patchlaw.geometry.sliders import Sliders
from patchlaw.micro import FrictionModel, HalfSpaceModel
from patchlaw.multiscale import representative_law

MU, LOADS = 0.4, (0.1, 0.5, 0.9)


def paths(random):
    """Yield names and paths of loads and slips, in parts of the load and of full sliding."""
    size = float(random.uniform(0.2, 0.9))
    there = np.linspace(0.0, size, 5)[1:]
    loop = np.concatenate([there, np.linspace(size, -size, 9)[1:], np.linspace(-size, size, 9)[1:]])
    yield "loop", np.stack([np.ones(20), loop, 0.0 * loop], axis=1)
    angle = np.linspace(0.0, 2.0 * np.pi, 25)
    circle = size * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    yield "circle", np.column_stack([np.ones(25), circle])
    points = np.concatenate([[[1.0, 0.0, 0.0]], random.normal(size=(6, 3)) * [0.0, size, size]])
    points[1:, 0] = 1.0
    ways = itertools.pairwise(points)
    yield "turns", np.concatenate([np.linspace(a, b, 6)[1:] for a, b in ways])
    points[1:, 0] = random.uniform(0.3, 1.0, 6)
    ways = itertools.pairwise(points)
    yield "turns, loads", np.concatenate([np.linspace(a, b, 6)[1:] for a, b in ways])


def judged(random, poisson_ratio, alone):
    """Return what springs of a random surface differ by, by kind of path and load."""
    first = int(random.integers(1, 5))
    spectrum = Spectrum(
        hurst=float(random.uniform(0.5, 0.9)),
        waves=(first, first + int(random.integers(2, 9))),
        rms_slope=float(random.uniform(0.05, 0.15)),
        seed=int(random.integers(2**31)),
    )
    surface = synthesise(spectrum, grid=(64, 64), lengths=(1.0, 1.0))
    pair = MaterialPair(first=Material(young_modulus=2e3, poisson_ratio=poisson_ratio))
    modulus = pair.contact_modulus
    largest = float(np.exp(random.uniform(*np.log([0.01, 0.12])))) * spectrum.rms_slope * modulus
    law = representative_law([surface], contact_modulus=modulus, largest_pressure=largest)
    bed = replace(law.springs, coupling=0.0) if alone else law.springs
    ratios = np.array([pair.stiffness_ratio])
    sliders = Sliders([bed], ratios, np.zeros(1, int), MU)
    closures = np.linspace(*law.range, 4000)
    normal = HalfSpaceModel(
        surface=surface, contact_modulus=modulus, periodic=True, tolerance=1e-10
    )
    cells = FrictionModel(materials=pair, coefficient=MU, spacing=surface.spacing, periodic=True)
    for load in LOADS:
        top = load * largest
        touched = float(np.interp(top, law.pressure(closures), closures)) - law.range[0]
        slides = MU * pair.stiffness_ratio * touched
        for kind, path in paths(random):
            state, before, found = None, sliders.at_rest, []
            for part, *slip in [(1.0, 0.0, 0.0), *path]:
                shift = tuple(float(slides * one) for one in slip)
                pressed = normal.solve_force(part * top)
                state = cells.advance(state, pressed.pressures, ShearControl(shift=shift))
                c = np.interp([part * top], law.pressure(closures), closures)
                now = sliders.respond(
                    before, c, np.array([shift]), law.pressure(c), law.stiffness(c)
                )
                step = sliders.step(before, now)
                before = step.after
                lost = state.dissipated_in_step, float(step.lost[0])
                found.append([*(now.stress[0] - state.force), *lost])
            off, lost = np.array(found)[:, :2], np.array(found)[:, 2:].sum(axis=0)
            yield kind, load, float(np.hypot(*off.T).max()) / (MU * top), lost[1] / lost[0] - 1.0


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--surfaces", type=int, default=12)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--poisson-ratio", type=float, default=0.0)
    parser.add_argument("--alone", action="store_true")
    given = parser.parse_args()
    random = np.random.default_rng(given.seed)
    rows = [
        row
        for _ in range(given.surfaces)
        for row in judged(random, given.poisson_ratio, given.alone)
    ]
    print("stress: median, 95 % and largest; energy: mean, smallest and largest")
    for kind in dict.fromkeys(row[0] for row in rows):
        for load in (*LOADS, None):
            own = [row[2:] for row in rows if row[0] == kind and load in (row[1], None)]
            stress, energy = np.array(own).T
            print(
                f"{kind:12s} {'all loads' if load is None else f'{load:.0%} of its load':15s} "
                f"{np.median(stress):6.2%} {np.quantile(stress, 0.95):6.2%} {stress.max():6.2%}   "
                f"{energy.mean():+6.2%} {energy.min():+6.2%} {energy.max():+6.2%}",
                flush=True,
            )


if __name__ == "__main__":
    main()
