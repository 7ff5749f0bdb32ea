"""Newton steps of one load of any size on steep laws, in cases drawn at random, through both doors.

Run by hand: `.venv/bin/python benchmarks/newton_steps.py [--cases 200] [--seed 1] [--doors user
scene pair]`; also under mpirun; 200 cases take ten minutes. A block of linear elasticity stands on
its back or a part of it; its face is whole, in zones, or in patches, each with one of a few laws of
periodic roughness up to 0.95 of full contact, whose contact modulus is 1 to 420 times the block's
Young's modulus. One load, by approach, force or with free tilt, is drawn between a ten thousandth
and nine tenths of the last pressure, and starts from nothing or from another such load. ``user`` is
an `Interface` in a `ContactProblem`, ``scene`` the `LawContactProblem` of scenes, ``pair`` an
`Interface` at points between the block and another one of half the stiffness, on other cells.
"""

import os

os.environ["OMP_NUM_THREADS"] = "1"

import argparse
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import ufl
from mpi4py import MPI

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from dolfinx import fem
from helpers.body_meshes import HIGH, LOW, box
from helpers.user_problems import clamped, elastic
from json_rows import keep

from patchlaw import ContactProblem, Interface, Material, Spectrum, representative_law, synthesise
from patchlaw.geometry import Control, PatchGrid
from patchlaw.macro import (
    LawContactProblem,
    LoadedFace,
    MeshedBody,
    Support,
    compat,
    joined_meshes,
)
from patchlaw.macro.mesh.contact_face import contact_facets
from patchlaw.macro.mesh.tagged import planar_face
from patchlaw.support.errors import NotConverged

COMM = MPI.COMM_WORLD
SIDES = (20.0, 10.0, 5.0)
FULL = 0.95  # contact area fraction of the last row
GRIDS = {"one": (1, 1), "zones": (3, 1), "patches": (4, 4)}


def laws_to_full_contact(count=8):
    """Return laws for E* = 1 MPa and the pressures at their ends, to which they are tables."""
    laws = []
    for seed in range(count):
        spectrum = Spectrum(
            hurst=(0.8, 0.5, 0.95)[seed % 3], waves=(2, 12), rms_slope=0.05 + 0.02 * seed, seed=seed
        )
        sample = synthesise(spectrum, grid=(64, 64), lengths=(1.0, 1.0))
        law = representative_law([sample], contact_modulus=1.0, largest_pressure=10.0)
        rows = law.rows
        end = float(np.interp(FULL, rows.contact_area_fraction, rows.pressure))
        laws.append(representative_law([sample], contact_modulus=1.0, largest_pressure=end))
    return laws


@dataclass(frozen=True)
class Case:
    """A drawn case; the closures and pressures of loads are those of its first law on the block."""

    young: float
    grid: str
    mode: str
    laws: list
    degree: int
    cell: str
    cells: tuple
    radius: float
    controls: list

    def __str__(self):
        """Say what it is in a line."""
        ratio = max(law.modulus for law in self.laws) / self.young
        loads = " then ".join(map(str, self.controls))
        return (
            f"{ratio:5.1f}:1 {self.grid} {self.mode} P{self.degree} {self.cell} {self.cells}, "
            f"crown {self.radius:.3g}, {loads}, tilt {self.controls[-1].tilt}"
        )


class Scaled:
    """A law of E* = 1 MPa at another modulus; its range is not checked, so that all cases count."""

    def __init__(self, law, modulus):
        self.law, self.modulus = law.multiplied(modulus), modulus
        self.end = self.law.rows.pressure[-1]
        self.pressure, self.stiffness = self.law.pressure, self.law.stiffness


def drawn(rng, laws):
    """Draw a case."""
    young, ratio = 10.0 ** rng.uniform(2.7, 5.3), 420.0 ** rng.uniform(0.0, 1.0)
    grid = str(rng.choice(list(GRIDS)))
    count = int(np.prod(GRIDS[grid]))
    mode = "patchwise" if grid == "patches" else "pointwise"
    which = rng.integers(len(laws), size=min(count, 3))
    chosen = [Scaled(laws[which[k % len(which)]], ratio * young) for k in range(count)]
    law = min(chosen, key=lambda one: one.end)
    rows = law.law.rows
    tall, roughness = bool(rng.integers(2)), rows.closure[-1]
    kind, controls = rng.choice(["approach", "tilted", "force", "free"]), []
    for _ in range(rng.integers(1, 3)):
        pressure = law.end * 10.0 ** rng.uniform(-4.0, np.log10(0.9))
        closure = float(np.interp(pressure, rows.pressure, rows.closure))
        approach = closure + SIDES[2] * pressure / young
        force = pressure * SIDES[0] * SIDES[1]
        tilt = tuple(map(float, rng.normal(0.0, 0.3 * approach / SIDES[0], 2).clip(-1.0, 1.0)))
        controls.append(
            {
                "approach": Control(approach=approach),
                "tilted": Control(approach=approach, tilt=tilt),
                "force": Control(force=force),
                "free": Control(force=force, tilt=None),
            }[kind]
        )
    crown = rng.choice([0.0, 10.0 ** rng.uniform(-1.0, 1.0)]) * roughness
    return Case(
        young=young,
        grid=grid,
        mode=mode,
        laws=chosen,
        degree=int(rng.choice([1, 1, 2])),
        cell=str(rng.choice(["hexahedron", "tetrahedron"])),
        cells=(8, 4, 3) if tall else (12, 6, 4),
        radius=float(crown),
        controls=controls,
    )


def crown(depth):
    """Return the depth over the face of a crown that is as deep at its corners."""
    half = 0.25 * (SIDES[0] ** 2 + SIDES[1] ** 2)
    return lambda x, y: depth * ((x - SIDES[0] / 2) ** 2 + (y - SIDES[1] / 2) ** 2) / half


def user(case, tagged):
    """Yield the numbers of Newton steps of an `Interface` in a user's problem."""
    space = compat.vector_space(tagged.mesh, case.degree)
    u = fem.Function(space)
    patches = PatchGrid(grid=GRIDS[case.grid], lengths=SIDES[:2])
    rough = Interface(
        space, tagged.facet_tags, LOW, laws=case.laws, patches=patches, mode=case.mode,
        indenter=case.controls[0], crown=crown(case.radius),
    )  # fmt: skip
    held = clamped(space, tagged.facet_tags, tag=HIGH)
    problem = ContactProblem(elastic(u, case.young, 0.3), u, [held], rough)
    for control in case.controls:
        rough.indenter = control
        yield problem.solve(), rough.force


def pair(case, tagged):
    """Yield the numbers of Newton steps of an `Interface` between two bodies."""
    count = tuple(max(1, n - 1) for n in case.cells)
    under = box((0, 0, -SIDES[2]), (*SIDES[:2], 0), count, case.cell, COMM)
    whole = joined_meshes({"upper": tagged, "under": under})
    space = compat.vector_space(whole.mesh, case.degree)
    u, patches = fem.Function(space), PatchGrid(grid=GRIDS[case.grid], lengths=SIDES[:2])
    rough = Interface(
        space, whole, "upper low", opposite="under high", laws=case.laws, patches=patches,
        mode="pointwise", indenter=case.controls[0], crown=crown(case.radius),
    )  # fmt: skip
    tags = whole.facet_tags
    held = [clamped(space, tags, tag=whole.facet_tag(k)) for k in ("upper high", "under low")]
    x = ufl.SpatialCoordinate(whole.mesh)
    young = case.young * ufl.conditional(x[2] > 0.0, 1.0, 0.5)
    problem = ContactProblem(elastic(u, young, 0.3), u, held, rough)
    for control in case.controls:
        rough.indenter = control
        yield problem.solve(), rough.force


def scene(case, tagged):
    """Yield the numbers of Newton steps of the problem of scenes."""
    material = Material(young_modulus=case.young, poisson_ratio=0.3)
    body = MeshedBody(tagged, material, [Support(tag=HIGH)], order=case.degree, normal=(0, 0, -1))
    plane, lower = planar_face(tagged, LOW), tagged.facet_tags.find(LOW)
    patches = PatchGrid(grid=GRIDS[case.grid], lengths=plane.lengths)
    face = LoadedFace(body, contact_facets(tagged.mesh, lower, plane.frame), patches)
    problem = LawContactProblem(face, case.laws, case.mode, crown=crown(case.radius))
    for control in case.controls:
        state = problem.solve(control)
        yield state.iterations, state.force


def counts(door, case, tagged):
    """Return the Newton steps of every load and the force of the last, or why it failed."""
    found, last = [], np.nan
    try:
        for steps, force in door(case, tagged):
            found, last = [*found, steps], force
    except NotConverged as error:
        return found, error.reason, np.nan
    return found, "", last


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=200)
    parser.add_argument("--only", type=int, nargs="*")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--doors", nargs="+", default=["user", "scene"])
    parser.add_argument("--most", type=int, default=6, help="cases that take more are listed")
    parser.add_argument("--json", metavar="FILE", help="append a row per case and door to it")
    choice = parser.parse_args()
    rng, laws = np.random.default_rng(choice.seed), laws_to_full_contact()
    doors, steps = {"user": user, "scene": scene, "pair": pair}, {name: [] for name in choice.doors}
    failed = dict.fromkeys(choice.doors, 0)
    for number in range(choice.cases):
        case = drawn(rng, laws)
        if choice.only and number not in choice.only:
            continue
        tagged = box((0, 0, 0), SIDES, case.cells, case.cell, COMM)
        forces = []
        for name in choice.doors:
            found, reason, force = counts(doors[name], case, tagged)
            steps[name] += found
            forces += [force] if name != "pair" else []  # two bodies have another
            failed[name] += bool(reason)
            keep(choice.json, case=number, door=name, steps=found, reason=reason)
            if COMM.rank == 0 and (reason or max(found) > choice.most or choice.only):
                print(f"{number:4d} {name:5s} {found} {reason}: {case}", flush=True)
        if forces and np.ptp(forces) > 1e-6 * max(forces) and COMM.rank == 0:
            print(f"{number:4d} forces differ: {forces}", flush=True)
    for name, found in steps.items():
        if COMM.rank == 0:
            shares = np.percentile(found, [50, 90, 99, 100], method="higher")
            over = sum(one > choice.most for one in found)
            print(
                f"{name}: {len(found)} loads, {failed[name]} failed; Newton steps: median, 90 %, "
                f"99 %, most {shares}; {over} take more than {choice.most}"
            )


if __name__ == "__main__":
    main()
