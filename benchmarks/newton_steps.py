"""Newton steps of one load of any size on steep laws, in cases drawn at random, through both doors.

Run by hand: `.venv/bin/python benchmarks/newton_steps.py [--cases 200] [--seed 1] [--doors user
scene pair plane ring mixed] [--friction]`; also under mpirun; 200 cases take ten minutes. A block
of linear elasticity stands on its back or a part of it; its face is whole, in zones, or in patches,
each with one of a few laws of periodic roughness up to 0.95 of full contact, whose contact modulus
is 1 to 420 times the block's Young's modulus. One load, by approach, force or with free tilt, is
drawn between a ten thousandth and nine tenths of the last pressure, and starts from nothing or from
another such load. ``user`` is an `Interface` in a `ContactProblem`, ``scene`` the
`LawContactProblem` of scenes, ``pair`` an `Interface` at points between the block and another one
of half the stiffness, on other cells. ``plane`` and ``ring`` are its section under plane strain and
turned about an axis, ``mixed`` either of the two or the block in displacement and pressure of
Taylor and Hood, with Poisson's ratios up to 0.4999. With ``--friction`` the same loads, but of
rings and scenes, shift the plane or shear it.
"""

import os

os.environ["OMP_NUM_THREADS"] = "1"

import argparse
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import ufl
from mpi4py import MPI

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from dolfinx import fem
from helpers.body_meshes import HIGH, LOW, box
from helpers.faces import at
from helpers.plane_problems import mixed_space, rectangle, strain_of
from helpers.user_problems import clamped, elastic
from json_rows import keep

from patchlaw import (
    ContactProblem,
    Friction,
    Interface,
    Material,
    ShearControl,
    Spectrum,
    representative_law,
    synthesise,
)
from patchlaw.geometry import Control, PatchGrid
from patchlaw.macro import (
    LawContactProblem,
    LoadedFace,
    MeshedBody,
    Support,
    compat,
    contact_facets,
    joined_meshes,
    planar_face,
)
from patchlaw.support import NotConverged

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
    poisson: float = 0.3
    shape: str = "plane"
    friction: Friction | None = None

    def __str__(self):
        """Say what it is in a line."""
        ratio = max(law.modulus for law in self.laws) / self.young
        loads = " then ".join(map(str, self.controls))
        return (
            f"{ratio:5.1f}:1 {self.grid} {self.mode} P{self.degree} {self.cell} {self.cells}, "
            f"crown {self.radius:.3g}, {loads}, tilt {self.controls[-1].tilt}, {self.shape}, "
            f"nu {self.poisson:.4g}, mu {self.friction and self.friction.coefficient}"
        )


class Scaled:
    """A law of E* = 1 MPa at another modulus; its range is not checked, so that all cases count."""

    def __init__(self, law, modulus):
        self.law, self.modulus = law.multiplied(modulus), modulus
        self.end, self.springs = self.law.rows.pressure[-1], self.law.springs
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


def others(case, rng, *, rubs):
    """Return the case with what the doors of plane, turned and mixed problems ask for besides."""
    shape = str(rng.choice(["plane", "ring", "block"]))
    poisson = float(0.5 - 10.0 ** rng.uniform(-4.0, -0.5))
    friction, controls = None, case.controls
    if rubs:
        friction = Friction(coefficient=float(rng.uniform(0.05, 0.9)), poisson_ratio=0.3)
        shift, controls = np.zeros(2), []
        for control in case.controls:
            by_force = control.force is not None and bool(rng.integers(2))
            way = rng.normal(size=2)
            if by_force:
                share = friction.coefficient * control.force * rng.uniform(0.0, 0.9)
                way = tuple(map(float, share * way / np.hypot(*way)))
                shear = ShearControl(force=way)
            else:
                size = 10.0 ** rng.uniform(-2.0, 1.0) * case.laws[0].law.rows.closure[-1]
                shift = shift + size * way
                shear = ShearControl(shift=tuple(map(float, shift)))
            controls.append(replace(control, shear=shear))
    return replace(case, shape=shape, poisson=poisson, friction=friction, controls=controls)


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
        indenter=case.controls[0], crown=crown(case.radius), friction=case.friction,
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
        friction=case.friction,
    )  # fmt: skip
    tags = whole.facet_tags
    held = [clamped(space, tags, tag=whole.facet_tag(k)) for k in ("upper high", "under low")]
    x = ufl.SpatialCoordinate(whole.mesh)
    young = case.young * ufl.conditional(x[2] > 0.0, 1.0, 0.5)
    problem = ContactProblem(elastic(u, young, 0.3), u, held, rough)
    for control in case.controls:
        rough.indenter = control
        yield problem.solve(), rough.force


def of_shape(case, space, turned):
    """Return the face of a plane problem, the crown of x alone, patches in a row, and loads."""
    mesh, count = space.mesh, GRIDS[case.grid][0]
    depth = case.radius
    size = np.pi * 3.0 * SIDES[0] ** 2 if turned else SIDES[0]
    controls = []
    for control in case.controls:
        force = control.force and control.force * size / (SIDES[0] * SIDES[1])
        tilt, shear = control.tilt, control.shear
        if turned:
            tilt, shear = (0.0, 0.0), None
        elif tilt is not None:
            tilt = (tilt[0], 0.0)
        if shear is not None:
            x = shear.pair[0] * (1.0 if shear.force is None else 1.0 / SIDES[1])
            shear = ShearControl(**{"shift" if shear.force is None else "force": (x, 0.0)})
        controls.append(replace(control, force=force, tilt=tilt, shear=shear))
    rough = Interface(
        space, None, at(mesh, 1, SIDES[2]), laws=case.laws[:count], mode=case.mode,
        patches=PatchGrid(grid=(count, 1), lengths=(SIDES[0], 1.0)),
        indenter=controls[0], crown=lambda x, y: depth * (2.0 * x / SIDES[0] - 1.0) ** 2,
        friction=case.friction, axisymmetric=turned,
    )  # fmt: skip
    return rough, controls


def section(case, turned):
    """Return the mesh of the block's section."""
    start = SIDES[0] if turned else 0.0
    cell = {"hexahedron": "quadrilateral", "tetrahedron": "triangle"}[case.cell]
    cells = 2 * case.cells[0], 2 * case.cells[2]
    return rectangle((start, 0.0), (start + SIDES[0], SIDES[2]), cells, cell, COMM)


def held_back(space, value):
    """Return the condition that holds all displacements of a plane's facets."""
    mesh = space.mesh
    last = mesh.topology.dim - 1
    facets = at(mesh, last, value)
    if space.component():
        alone, _ = compat.collapsed(space)
        dofs = fem.locate_dofs_topological((space, alone), last, facets)
        return fem.dirichletbc(fem.Function(alone), dofs, space)
    return fem.dirichletbc(
        np.zeros(last + 1), fem.locate_dofs_topological(space, last, facets), space
    )


def plane(case, _tagged, *, turned=False):
    """Yield the numbers of Newton steps of a plane problem."""
    mesh = section(case, turned)
    space = compat.vector_space(mesh, case.degree)
    u, v = fem.Function(space), ufl.TestFunction(space)
    radius = ufl.SpatialCoordinate(mesh)[0] if turned else None
    strain, virtual = strain_of(u, radius), strain_of(v, radius)
    twice, nu = case.young / 1.3, 0.3
    trace = ufl.tr(strain) * ufl.tr(virtual)
    work = twice * (ufl.inner(strain, virtual) + nu / (1 - 2 * nu) * trace)
    inner = (2.0 * np.pi * radius if turned else 1.0) * work * ufl.dx
    rough, controls = of_shape(case, space, turned)
    problem = ContactProblem(inner, u, [held_back(space, 0.0)], rough)
    for control in controls:
        rough.indenter = control
        yield problem.solve(), rough.force


def ring(case, tagged):
    """Yield the numbers of Newton steps of an axisymmetric problem."""
    return plane(case, tagged, turned=True)


def mixed(case, tagged):
    """Yield the numbers of Newton steps in displacement and pressure of Taylor and Hood."""
    turned, solid = case.shape == "ring", case.shape == "block"
    mesh = tagged.mesh if solid else section(case, turned)
    whole = mixed_space(mesh, (2, mesh.topology.dim), (1, 1))
    space, w = whole.sub(0), fem.Function(whole)
    (u, p), (v, q) = ufl.split(w), ufl.TestFunctions(whole)
    radius = ufl.SpatialCoordinate(mesh)[0] if turned else None
    strain, virtual = strain_of(u, radius), strain_of(v, radius)
    twice, nu = case.young / (1.0 + case.poisson), case.poisson
    lame = twice * nu / (1.0 - 2.0 * nu)
    work = twice * ufl.inner(strain, virtual) - p * ufl.tr(virtual)
    work -= q * (ufl.tr(strain) + p / lame)
    inner = (2.0 * np.pi * radius if turned else 1.0) * work * ufl.dx
    if solid:
        rough = Interface(
            space, tagged.facet_tags, LOW, laws=case.laws, mode=case.mode,
            patches=PatchGrid(grid=GRIDS[case.grid], lengths=SIDES[:2]),
            indenter=case.controls[0], crown=crown(case.radius), friction=case.friction,
        )  # fmt: skip
        controls, back = case.controls, SIDES[2]
    else:
        (rough, controls), back = of_shape(case, space, turned), 0.0
    problem = ContactProblem(inner, w, [held_back(space, back)], rough)
    for control in controls:
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
    parser.add_argument("--friction", action="store_true", help="not of scenes")
    parser.add_argument("--most", type=int, default=6, help="cases that take more are listed")
    parser.add_argument("--json", metavar="FILE", help="append a row per case and door to it")
    choice = parser.parse_args()
    rng, laws = np.random.default_rng(choice.seed), laws_to_full_contact()
    doors = {"user": user, "scene": scene, "pair": pair, "plane": plane, "ring": ring}
    doors["mixed"], steps = mixed, {name: [] for name in choice.doors}
    failed = dict.fromkeys(choice.doors, 0)
    for number in range(choice.cases):
        case = drawn(rng, laws)
        if choice.only and number not in choice.only:
            continue
        case = others(case, np.random.default_rng([choice.seed, number]), rubs=choice.friction)
        tagged = box((0, 0, 0), SIDES, case.cells, case.cell, COMM)
        forces = []
        for name in choice.doors:
            found, reason, force = counts(doors[name], case, tagged)
            steps[name] += found
            forces += [force] if name in ("user", "scene") else []  # others have another
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
