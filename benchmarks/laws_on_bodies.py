"""Newton steps and linear iterations of bodies under laws: parts, laws, controls.

Run by hand: `.venv/bin/python benchmarks/laws_on_bodies.py [PART …] [--scale 0.6] [--slab]`,
also under mpirun; without parts all of `body_solvers.py`. Laws grow exponentially with closure, as
those of rough surfaces do; of roughness 16 µm (soft), 1 µm (stiff), or both on halves of the face
(mixed). Every line is one load: in a single step, and along a path of four steps. ``K`` counts the
iterations to 1e-8 of the body without laws. With ``--slab`` an elastic slab of other cells is
pressed on the part in place of a rigid plane.

``--pad FILE`` takes the mesh of the demo `brake_pad.py` instead: four load steps up to 8 kN on
quadratic elements, as many times as long as one linear solution of the pad to 1e-8, by wall
seconds, CPU seconds and PETSc's count of floating-point operations (hypre counts none). The matrix
and its multigrid are there in both cases; the multigrids that follow the laws are counted apart.
With ``--friction 0.3`` they are taken with friction as well,
in CPU time, and then four steps of shear up to three quarters of what slides, and back.
"""

import os

os.environ["OMP_NUM_THREADS"] = "1"

import argparse
import sys
import time
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from petsc4py import PETSc

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from body_solvers import COMM, LINING, PARTS, iterations
from helpers.body_meshes import HIGH, LOW, box
from json_rows import keep
from machine_parts import STEEL, part_body, read_part

from patchlaw.geometry import Control, Friction, PatchGrid, ShearControl
from patchlaw.macro import (
    FacePair,
    LawContactProblem,
    LoadedFace,
    MeshedBody,
    Support,
    contact_facets,
    planar_face,
    read_mesh,
)
from patchlaw.macro.contact.newton import ContactPreconditioner
from patchlaw.support import NotConverged

PRESSURE = 10.0  # of the whole load, on average [MPa]


class ExponentialLaw:
    """p = 10 kPa (exp(c / 0.4 σ) − 1): 10 MPa at 2.8 roughnesses σ of closure."""

    def __init__(self, roughness):
        self._length = 0.4 * roughness
        self.range = 0.0, 8.0 * self._length  # to 30 MPa

    def pressure(self, closure):
        return 1e-2 * np.expm1(np.clip(closure / self._length, 0.0, 200.0))

    def stiffness(self, closure):
        grown = np.exp(np.clip(closure / self._length, 0.0, 200.0))
        return np.where(closure > 0.0, 1e-2 * grown / self._length, 0.0)


SOFT, STIFF = ExponentialLaw(16e-3), ExponentialLaw(1e-3)
LAWS = {"soft": [SOFT, SOFT], "stiff": [STIFF, STIFF], "mixed": [SOFT, STIFF]}


def pressed(face, laws, controls):
    """Return Newton steps and linear iterations of every load step, and the last state."""
    problem, counts, state = LawContactProblem(face, laws, "pointwise"), [], None
    for control in controls:
        try:
            state = problem.solve(control)
        except NotConverged as error:
            return f"{counts} {error.reason}", state
        counts.append((state.iterations, state.linear_iterations))
    newton, linear = (sum(part) for part in zip(*counts, strict=True))
    steps = " ".join(str(count) for count, _ in counts)
    return f"{steps:>9s} Newton, {linear / newton:4.1f} a solve", state


def rows(face):
    """Yield a name and the counts of every law and control."""
    force = PRESSURE * float(face.areas.sum())
    for name, laws in LAWS.items():
        for free in (False, True):
            tilt = None if free else (0.0, 0.0)
            loads = [Control(force=force * k / 4, tilt=tilt) for k in (1, 2, 3, 4)]
            one, state = pressed(face, laws, loads[3:])
            yield f"{name}, force{', free tilt' * free}", one, pressed(face, laws, loads)[0]
        if state is not None:
            at = state.approach
            loads = [Control(approach=at * k / 4) for k in (1, 2, 3, 4)]
            yield (
                f"{name}, approach",
                pressed(face, laws, loads[3:])[0],
                pressed(face, laws, loads)[0],
            )


def slab_on(face, plane, degree, size):
    """Return the face of a slab of steel that hangs over a part's face."""
    low, high = plane.frame.origin, plane.frame.origin + np.array([*plane.lengths, 10.0])
    cells = [max(2, round(length / (1.3 * size))) for length in high - low]
    tagged = box(low, high, cells, "tetrahedron" if face.body.hexahedral else "hexahedron", COMM)
    body = MeshedBody(tagged, STEEL, [Support(tag=HIGH)], order=degree, normal=(0, 0, -1))
    lower = tagged.facet_tags.find(LOW)
    facets = contact_facets(tagged.mesh, lower, plane.frame, opposed=True)
    return FacePair(face, LoadedFace(body, facets, face.patches))


def press_pad(file, friction=None, roughnesses=(16.0, 4.0, 1.0), json=None):
    """Print the time of the demo's load steps as a multiple of that of one linear solution."""
    tagged = read_mesh(file, COMM)
    names, volumes = tagged.facet_names, tagged.cell_names
    materials = {volumes["back plate"]: STEEL, volumes["lining"]: LINING}
    body = MeshedBody(tagged, materials, [Support(tag=names["piston"])], order=2)
    plane = planar_face(tagged, names["pad face"])
    facets = tagged.facet_tags.find(names["pad face"])
    patches = PatchGrid(grid=(1, 1), lengths=plane.lengths)
    face = LoadedFace(body, contact_facets(tagged.mesh, facets, plane.frame), patches)
    set_up, _ = worked(lambda: body.solver)
    one, alone = worked(lambda: iterations(body, body.solver))
    if COMM.rank == 0:
        print(f"{body.dofs} unknowns on {COMM.size} ranks; wall s, CPU s, Gflop of a rank")
        print(f"  set-up {said(set_up)}; solution {said(one)}, {alone} iterations", flush=True)
    body.solver.setTolerances(rtol=1e-10)
    if friction is not None:
        rub_pad(face, friction, roughnesses, json)
        return
    for roughness in roughnesses:
        problem = LawContactProblem(face, [ExponentialLaw(1e-3 * roughness)], "pointwise")
        loads = [Control(force=2e3 * k) for k in (1, 2, 3, 4)]
        with set_ups() as apart:
            whole, states = worked(partial(list, map(problem.solve, loads)))
        steps = whole - sum(apart)
        newton = [state.iterations for state in states]
        linear = sum(state.linear_iterations for state in states)
        if COMM.rank == 0:
            print(
                f"  {roughness:4.0f} µm: {said(steps)} are {said(steps / one)} solutions; "
                f"{len(apart)} set-ups {said(sum(apart))}; Newton {newton}, linear {linear}",
                flush=True,
            )
            solutions = dict(zip(("wall", "cpu", "flops"), steps / one, strict=True))
            counts = {"newton": sum(newton), "linear": linear}
            keep(json, unknowns=body.dofs, roughness=roughness, **counts, **solutions)


@contextmanager
def set_ups():
    """Yield a list that gets the work of every set-up of a preconditioner that follows the laws."""
    apart, usual = [], ContactPreconditioner.update

    def update(preconditioner):
        apart.append(worked(lambda: usual(preconditioner))[0])

    ContactPreconditioner.update = update
    try:
        yield apart
    finally:
        ContactPreconditioner.update = usual


def worked(work):
    """Return wall seconds, CPU seconds and Gflop of the busiest rank, and what work returns."""
    before = np.array([0.0, time.process_time(), 1e-9 * PETSc.Log.getFlops()])
    wall, found = timed(work)
    spent = np.array([wall, time.process_time(), 1e-9 * PETSc.Log.getFlops()]) - before
    return np.max(COMM.allgather(spent), axis=0), found


def said(work):
    """Return the three numbers of `worked` as text."""
    return ", ".join(f"{part:.4g}" for part in work)


def rub_pad(face, friction, roughnesses, json):
    """Print the CPU time of the pad's load steps with friction over that without, and of shear."""
    loads = [Control(force=2e3 * k) for k in (1, 2, 3, 4)]
    for roughness in roughnesses:
        law = [ExponentialLaw(1e-3 * roughness)]
        spent, counts = {}, {}
        for name in (None, friction):
            problem = LawContactProblem(face, law, "pointwise", friction=name)
            began = time.process_time()
            states = list(map(problem.solve, loads))
            spent[name], counts[name] = time.process_time() - began, work_of(states)
        most, began = friction.coefficient * 8e3, time.process_time()
        shears = [ShearControl(force=(part * most, 0.0)) for part in (0.25, 0.5, 0.75, 0.25)]
        states = [problem.solve(replace(loads[-1], shear=shear)) for shear in shears]
        sheared = time.process_time() - began
        if COMM.rank == 0:
            print(
                f"  {roughness:4.0f} µm: {spent[None]:.1f} s ({counts[None]}); with friction "
                f"{spent[friction]:.1f} s ({counts[friction]}), "
                f"{spent[friction] / spent[None]:.2f} times; "
                f"sheared {sheared:.1f} s ({work_of(states)})",
                flush=True,
            )
            keep(json, roughness=roughness, friction=spent[friction] / spent[None])


def work_of(states):
    """Return Newton steps and linear iterations of load steps, as text."""
    newton = sum(state.iterations for state in states)
    return f"{newton} Newton, {sum(state.linear_iterations for state in states)} linear"


def timed(work):
    """Return wall seconds and what work returns."""
    COMM.Barrier()
    began = time.perf_counter()
    found = work()
    COMM.Barrier()
    return time.perf_counter() - began, found


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("parts", nargs="*")
    parser.add_argument("--scale", type=float, default=0.6)
    parser.add_argument("--slab", action="store_true")
    parser.add_argument("--pad", metavar="FILE")
    parser.add_argument("--friction", type=float)
    parser.add_argument("--roughness", type=float, nargs="*", default=(16.0, 4.0, 1.0))
    parser.add_argument("--json", metavar="FILE", help="append the rows of the pad to it")
    choice = parser.parse_args()
    if choice.pad:
        mu = choice.friction
        law = mu and Friction(coefficient=mu, poisson_ratio=0.25)
        press_pad(choice.pad, law, choice.roughness, choice.json)
        return
    for name in choice.parts or PARTS:
        part, *rest = PARTS[name]
        tagged = read_part(replace(part, size=part.size / choice.scale), COMM)
        body, tag = part_body(tagged, *rest), tagged.facet_names["contact"]
        plane, facets = planar_face(tagged, tag), tagged.facet_tags.find(tag)
        patches = PatchGrid(grid=(2, 1), lengths=plane.lengths)
        face = LoadedFace(body, contact_facets(tagged.mesh, facets, plane.frame), patches)
        alone = iterations(body, body.solver)
        if choice.slab:
            face = slab_on(face, plane, rest[0], part.size / choice.scale)
        body.solver.setTolerances(rtol=1e-10)
        if COMM.rank == 0:
            print(f"{name}, {face.body.dofs} unknowns, K {alone}", flush=True)
        for row in rows(face):
            if COMM.rank == 0:
                print(f"  {row[0]:24s} {row[1]:32s} {row[2]}", flush=True)


if __name__ == "__main__":
    main()
