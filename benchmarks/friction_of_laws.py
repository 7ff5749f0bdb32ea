"""How far are the springs of laws with friction from cells, on straight and on turning paths?

    .venv/bin/python benchmarks/friction_of_laws.py [--surfaces N] [--seed S] [--alone]
        [--poisson-ratio NU]

Periodic half-spaces on 32² to 48² cells are drawn anew for every seed, rough ones and, one in four,
ellipsoids, with any Poisson's ratio up to 0.45. They are sheared on five kinds of paths, each under
5 to 95 % of the pressure that their law goes to: straight loops, circles, squares, random turns,
and random turns under a varying load. Printed are, by kind, the largest differences of the shear
stress to that of cells along the path, over the bound of friction, how many of them are within
1.5 × the error that the law states, and the differences of the energy lost. With ``--alone``
springs have no compliance in common. Run it from the project's root.
"""

import argparse
import itertools
import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

from dataclasses import replace

import numpy as np

from patchlaw.geometry import Material, MaterialPair, ShearControl, Spectrum, Surface, synthesise
from patchlaw.geometry.sliders import Sliders
from patchlaw.micro import FrictionModel, HalfSpaceModel
from patchlaw.multiscale import representative_law

MU, ALLOWED = 0.4, 1.5


def paths(random):
    """Yield names and paths of loads and slips, in parts of the load and of full sliding."""
    size = float(random.uniform(0.1, 1.0))
    there = np.linspace(0.0, size, 5)[1:]
    loop = np.concatenate([there, np.linspace(size, -size, 9)[1:], np.linspace(-size, size, 9)[1:]])
    yield "loop", np.stack([np.ones(20), loop, 0.0 * loop], axis=1)
    angle = np.linspace(0.0, 2.0 * np.pi, 25)
    circle = size * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    yield "circle", np.column_stack([np.ones(25), circle])
    corners = np.concatenate([[[0.0, 0.0]], circle[::6]])
    ways = [np.linspace(a, b, 6)[1:] for a, b in itertools.pairwise(corners)]
    yield "square", np.column_stack([np.ones(25), np.concatenate(ways)])
    points = np.concatenate([[[1.0, 0.0, 0.0]], random.normal(size=(6, 3)) * [0.0, size, size]])
    points[1:, 0] = 1.0
    ways = itertools.pairwise(points)
    yield "turns", np.concatenate([np.linspace(a, b, 6)[1:] for a, b in ways])
    points[1:, 0] = random.uniform(0.3, 1.0, 6)
    ways = itertools.pairwise(points)
    yield "turns, loads", np.concatenate([np.linspace(a, b, 6)[1:] for a, b in ways])


def surface_of(random):
    """Return a periodic surface, and the mean pressure over E* that its law goes to."""
    cells = int(random.choice([32, 40, 48]))
    if random.random() < 0.25:
        x, longer = (np.arange(cells) + 0.5) / cells - 0.5, random.uniform(1.0, 3.0)
        radius, reach = random.uniform(2.0, 6.0), random.uniform(0.2, 0.7)
        heights = -(x[:, None] ** 2 + longer * x**2) / (2.0 * radius)
        surface = Surface(heights=heights, lengths=(1.0, 1.0), periodic=True)
        return surface, 0.3 * float(reach**3 / radius)
    first = int(random.integers(1, 5))
    spectrum = Spectrum(
        hurst=float(random.uniform(0.5, 0.9)),
        waves=(first, first + int(random.integers(1, 6))),
        rms_slope=float(random.uniform(0.05, 0.15)),
        seed=int(random.integers(2**31)),
    )
    surface = synthesise(spectrum, grid=(cells, cells), lengths=(1.0, 1.0))
    return surface, float(np.exp(random.uniform(*np.log([0.01, 0.12])))) * spectrum.rms_slope


def judged(random, poisson_ratio, alone):
    """Yield what springs of a random surface differ by, by kind of path, and what they state."""
    surface, part = surface_of(random)
    if poisson_ratio is None:
        poisson_ratio = float(random.uniform(0.0, 0.45))
    pair = MaterialPair(first=Material(young_modulus=2e3, poisson_ratio=poisson_ratio))
    modulus = pair.contact_modulus
    largest = part * modulus
    law = representative_law([surface], contact_modulus=modulus, largest_pressure=largest)
    bed = replace(law.springs, coupling=0.0) if alone else law.springs
    ratios = np.array([pair.stiffness_ratio])
    sliders = Sliders([bed], ratios, np.zeros(1, int), MU)
    closures = np.linspace(*law.range, 4000)
    normal = HalfSpaceModel(
        surface=surface, contact_modulus=modulus, periodic=True, tolerance=1e-10
    )
    cells = FrictionModel(materials=pair, coefficient=MU, spacing=surface.spacing, periodic=True)
    for kind, path in paths(random):
        top = float(random.uniform(0.05, 0.95)) * largest
        touched = float(np.interp(top, law.pressure(closures), closures)) - law.range[0]
        slides = MU * pair.stiffness_ratio * touched
        state, before, found = None, sliders.at_rest, []
        for load, *slip in [(1.0, 0.0, 0.0), *path]:
            shift = tuple(float(slides * one) for one in slip)
            pressed = normal.solve_force(load * top)
            state = cells.advance(state, pressed.pressures, ShearControl(shift=shift))
            c = np.interp([load * top], law.pressure(closures), closures)
            now = sliders.respond(before, c, np.array([shift]), law.pressure(c), law.stiffness(c))
            step = sliders.step(before, now)
            before = step.after
            lost = state.dissipated_in_step, float(step.lost[0])
            found.append([*(now.stress[0] - state.force), *lost])
        off, lost = np.array(found)[:, :2], np.array(found)[:, 2:].sum(axis=0)
        stated = bed.path_error(pair.stiffness_ratio)
        yield (
            kind,
            float(np.hypot(*off.T).max()) / (MU * top),
            stated,
            lost[1] / (lost[0] or np.nan) - 1.0,
        )


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--surfaces", type=int, default=12)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--poisson-ratio", type=float, help="drawn without")
    parser.add_argument("--alone", action="store_true")
    given = parser.parse_args()
    rows = [
        row
        for number in range(given.surfaces)
        for row in judged(
            np.random.default_rng([given.seed, number]), given.poisson_ratio, given.alone
        )
    ]
    print("stress: median, 95 % and largest; energy: median, 5 and 95 %")
    for kind in [*dict.fromkeys(row[0] for row in rows), "turning"]:
        turning = kind == "turning"
        own = [row[1:] for row in rows if row[0] == kind or (turning and row[0] != "loop")]
        stress, stated, energy = np.array(own).T
        held = int((stress <= ALLOWED * stated).sum())
        print(
            f"{kind:12s} {np.median(stress):6.2%} {np.quantile(stress, 0.95):6.2%} "
            f"{stress.max():6.2%}, within {ALLOWED} × stated on {held} of {len(own)}, stated over "
            f"true in the median {np.median(stated / stress):.1f}   {np.nanmedian(energy):+6.2%} "
            f"{np.nanquantile(energy, 0.05):+6.2%} {np.nanquantile(energy, 0.95):+6.2%}",
            flush=True,
        )


if __name__ == "__main__":
    main()
