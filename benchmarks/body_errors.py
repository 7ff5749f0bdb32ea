"""Measured errors of bodies under laws against uniformly refined meshes, on bodies drawn at random.

Run by hand: `.venv/bin/python benchmarks/body_errors.py [--bodies 20] [--first 0]`, also
under mpirun. Every body is pressed as a run presses it; its errors by elements and quadrature are
those that a run would state. The force at the same approach on the same mesh refined twice, every
cell into 64, is taken for the true one; ``rest`` is what the second refinement still changed,
relative to the true error. All errors are relative to the force.

With `--contacts` a rough rectangle of `--cells` cells a side is pressed on every body by
`concurrent`, and shifted. Its force and its shear force are compared with those on cells cut into
eight once more. Both are in 6 modes a side, whose own error is left out.

With `--read` level bodies are pressed by a force: those of `--shapes`, by default all, where
`block` is a pad of one material. Errors by elements and quadrature of the force, contact area, mean
gap and stiffness of the interface are compared with quadratic elements on every cell cut into
eight. With `--friction` bodies are sheared in part besides, every other one by a shear force, and
shear and energy lost to friction are compared, too. `--steep` takes 3 % of the slopes of the
roughness. With `--every` all load steps of a path are compared, which leads back where nothing
rubs, with `--back` under friction, too; `--most` are the degrees of freedom of the finest elements.
With `--samples` the law is the mean of as many.
"""

import os

os.environ["OMP_NUM_THREADS"] = "1"
os.environ["PATCHLAW_CACHE"] = "off"  # a body cut finer is another one

import argparse
import sys
import tempfile
import time
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
from mpi4py import MPI

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from random_bodies import (
    SHAPES,
    arrays_of,
    contact_rectangle,
    contact_scene,
    drawn,
    mesh_of,
    rough_scene,
    stated_and_true,
)

from patchlaw.macro import write_mesh
from patchlaw.macro.compliance import mesh_face
from patchlaw.macro.compliance.mesh_face import Discretised
from patchlaw.macro.contact.other_elements import refined_body
from patchlaw.macro.mesh.from_file import refined
from patchlaw.micro import BodyModes, TractionModes
from patchlaw.multiscale import Run, Scene
from patchlaw.multiscale.bodies import face_terms
from patchlaw.multiscale.models.measured_errors.faces import LawErrorProbe
from patchlaw.multiscale.models.measured_errors.shear_of_samples import LawShearProbe

COMM = MPI.COMM_WORLD
ALLOWED = 1.5  # true over stated
BY = "mesh", "quadrature"
ROUNDING = 1e-9  # of the force, to which Newton's method converges; a uniform state has no error


MOST_TRUE = 50_000  # degrees of freedom of the finest elements
MOST_SHEARED = 30_000  # degrees of freedom of the finest elements under friction
LOADS = np.array([0.25, 1.0, 0.45])  # of the load: up, and back in part
UNIFORM = 1e-6  # what is read off a uniform state, which has no error, differs less by rounding
QUIET = {"figures": False, "report": False, "check": "none", "contact": "none"}
OF = Discretised.of


def finer(body, facets):
    """Return a body with its cells cut into eight once more than in a run."""
    best = OF(body, facets)
    finest, on_it = refined_body(best.body, best.facets)
    return Discretised(finest, on_it, None, 0.0)


def pressed(scene):
    """Return the last load step of a scene."""
    run = Run(scene)
    *_, step = run.load_steps()
    run.close()
    return step


def of_contact(seed, cells, folder):
    """Press a rough rectangle on a body of few hexahedra, and shift it.

    Returns:
        The name of the body, its unknowns, and by force and shear force the error by the elements
        and the true one, over the force; None where the body is too large for the true one.
    """
    body = drawn(seed)
    sides = contact_rectangle(body)[1]
    along = float(np.random.default_rng([53, seed]).uniform(*cells))
    body = replace(body, size=min(sides) / along, hexahedra=True)
    if max(sides) > 3.0 * min(sides) or body.length > 20.0 * body.size:
        return None
    arrays = arrays_of(body)
    quadratic = 3 * 9 * len(arrays.cells)  # about, and eight times as many once cut
    times = 64 if 8 * quadratic <= mesh_face._MOST_CUT_DOFS else 8
    if times * quadratic > MOST_TRUE:
        return None
    mesh = Path(folder) / f"{seed}.xdmf"
    write_mesh(mesh_of(body, COMM), mesh)
    approach = pressed(contact_scene(body, mesh, seed, output=QUIET)).approach_mm
    load = {"approach": approach, "steps": 1, "shear_steps": 1}
    load["shear"] = [[0.1 * approach, 0.05 * approach]]  # partial slip
    keys = {"load": load, "friction": {"coefficient": 0.4}}
    step = pressed(contact_scene(body, mesh, seed, **keys))
    Discretised.of = finer
    try:
        true = pressed(contact_scene(body, mesh, seed, output=QUIET, **keys))
    finally:
        Discretised.of = OF
    of_force = dict(step.errors)["body"] / step.force_N
    one, other = (np.array([s.shear_force_x_N, s.shear_force_y_N]) for s in (step, true))
    size = float(np.hypot(*one))
    of_shear = dict(step.shear_errors)["body"] / size + of_force
    found = of_force, abs(step.force_N - true.force_N) / step.force_N
    return body.name, 3 * len(arrays.points), found, (of_shear, np.hypot(*(one - other)) / size)


def contacts(choice):
    """Compare stated and true errors by the elements of contacts on bodies of few cells."""
    face_terms._modes = lambda around, lengths, side_term: 6
    BodyModes.fewer = TractionModes.fewer = lambda self, count: self
    ratios, seed = [], choice.first - 1
    with tempfile.TemporaryDirectory() as folder:
        while len(ratios) < choice.bodies:
            found = of_contact(seed := seed + 1, choice.cells, folder)
            if found is None:
                continue
            name, unknowns, *both = found
            ratios.append([true / stated for stated, true in both])
            errors = " | ".join(f"{stated:.1e} | {true:.1e}" for stated, true in both)
            print(f"| {seed} | {name.rsplit(',', 2)[0]} | {unknowns} | {errors} |", flush=True)
    for name, some in zip(("force", "shear force"), np.transpose(ratios), strict=True):
        tell(name, some, np.sum(some <= ALLOWED))


def shape_of(body, shape):
    """Return a body of another shape, whose cells are few."""
    changes = {"shape": "pad" if shape == "block" else shape}
    if shape == "block":
        changes["materials"] = 2 * body.materials[:1]
    fewest = 3.0 if body.order == 2 else 6.0
    return replace(body, size=max(body.size, body.length / fewest), tilt=(0.0, 0.0), **changes)


def read_off(seed, folder, choice):
    """Press a rough body, and shear it in part where it rubs.

    Returns:
        Its name, its unknowns, and of every load step by quantity the stated and the true error,
        relative; None for others and large ones.
    """
    shapes, rubs = tuple(choice.shapes), choice.friction
    shape, body = shapes[seed % len(shapes)], drawn(seed)
    if shapes == SHAPES and body.tilt is not None and any(body.tilt):
        return None
    body = shape_of(body, shape)
    coarse = mesh_of(body, COMM)
    unknowns = 3 * coarse.mesh.geometry.index_map().size_global
    truth = refined(coarse)
    vertices = 3 * truth.mesh.geometry.index_map().size_global
    if 8 * vertices > choice.most:
        return None
    mesh, finer = (str(Path(folder) / f"{name}.xdmf") for name in (seed, f"{seed} finer"))
    write_mesh(coarse, mesh)
    write_mesh(truth, finer)
    rng = np.random.default_rng([5, seed])
    coefficient, share, way = map(float, rng.uniform([0.1, 0.2, 0.0], [0.6, 0.8, 2.0 * np.pi]))
    data = dict(rough_scene(body, mesh, seed, accuracy=0.05).written)
    del data["accuracy"]  # the body stays as it is
    data["surface"] = {**data["surface"], "grid": [32, 32]}
    if choice.steep:
        spectrum = data["surface"]["spectrum"]
        data["surface"]["spectrum"] = spectrum | {"rms_slope": 0.03 * spectrum["rms_slope"]}
    data["body"] = {**data["body"], "element": ("linear", "quadratic")[body.order - 1]}
    data |= {"coupling": {"table_tolerance": 0.01}}
    if choice.samples > 1:
        data["law"] = {**data["law"], "seeds": [seed + 1000 * one for one in range(choice.samples)]}
    if rubs:
        data |= {"friction": {"coefficient": coefficient}}

    def steps_of(size=0.0, key="shear", check="none", **sections):
        shear = [[size * float(np.cos(way)), size * float(np.sin(way))]]
        sections["load"] = data["load"] | ({key: shear, "shear_steps": 2} if rubs else {})
        if choice.every:
            sections["load"]["steps"] = 3
        if choice.every and (choice.back or not rubs):
            sections["load"]["pressure"] = (LOADS * body.pressure).tolist()
        sections["output"] = {**data["output"], "check": check}
        run, found = Run(Scene.from_dict(data | sections)), []
        for step in run.load_steps():
            stiffness = run.coupling.model.stiffness().interface
            found.append(replace(step, interface_stiffness_N_per_mm=stiffness))
        run.close()
        return found

    size, key = 0.0, "shear_force"
    if rubs:
        size = share * coefficient * steps_of(1e-12)[-1].force_N
        if seed % 2:  # the shift under it
            at = steps_of(size, key)[-1]
            size, key = float(np.hypot(at.shear_x_mm, at.shear_y_mm)), "shear"
    with measured() as found:
        steps = steps_of(size, key, check="all" if choice.every else "last")
    true = steps_of(size, key, body={**data["body"], "mesh": finer, "element": "quadratic"})
    last = slice(-len(found), None)
    every = [_compared(*one) for one in zip(found, steps[last], true[last], strict=True)]
    return body.name.replace("pad", shape), unknowns, every


def _compared(errors, step, true):
    """Return by quantity the stated and the true error of a load step, relative."""
    of_force, of_area, of_gap, of_stiffness = sum(errors.by_cause[c] for c in BY)[:4]
    # the error of the approach is that of the force over the stiffness against it
    force = of_force, errors.stiffness * (true.approach_mm - step.approach_mm), step.force_N
    change, own = _change(step, true, "interface_stiffness_N_per_mm")
    by_name = {
        "force": force,
        "area": (of_area, *_change(step, true, "contact_area_fraction")),
        "gap": (of_gap, *_change(step, true, "mean_separation_mm")),
        "stiffness": (of_stiffness * own, change, own),
    }
    if errors.shear:
        read = [
            f"shear_{'force_' * step.by_shift}{k}_{'N' if step.by_shift else 'mm'}" for k in "xy"
        ]
        one, other = (np.array([getattr(found, name) for name in read]) for found in (step, true))
        of_shear, of_lost = sum(errors.shear[c] for c in BY)
        by_name["shear"] = of_shear, np.hypot(*(other - one)), np.hypot(*one)
        by_name["energy lost"] = of_lost, *_change(step, true, "dissipated_mJ")
    return {
        name: np.abs([stated, err]) / (abs(of) or 1.0)
        for name, (stated, err, of) in by_name.items()
    }


def _change(step, true, name):
    """Return what a column errs by, and its size."""
    own = getattr(step, name)
    return getattr(true, name) - own, own


@contextmanager
def measured():
    """Yield a list that gets the errors that are measured under laws."""
    found, usual = [], {probe: probe.measure for probe in (LawErrorProbe, LawShearProbe)}
    for probe, measure in usual.items():
        probe.measure = lambda self, measure=measure: found.append(measure(self)) or found[-1]
    try:
        yield found
    finally:
        for probe, measure in usual.items():
            probe.measure = measure


def reading(choice):
    """Compare stated and true errors of what is read off bodies under laws."""
    ratios, seed, bodies = {}, choice.first - 1, 0
    with tempfile.TemporaryDirectory() as folder:
        while bodies < choice.bodies:
            began = time.process_time()
            found = read_off(seed := seed + 1, folder, choice)
            if found is None:
                continue
            name, unknowns, every = found
            for number, errors in enumerate(every, start=1):
                for quantity, (stated, true) in errors.items():
                    ratio = true / stated if true > UNIFORM else 0.0
                    ratios.setdefault(quantity, []).append(ratio)
                told = " | ".join(f"{stated:.1e} | {true:.1e}" for stated, true in errors.values())
                if COMM.rank == 0:
                    took = time.process_time() - began
                    row = f"| {seed}, {number} | {name} | {unknowns} | {told} | {took:.0f} s |"
                    print(row, flush=True)
            bodies += 1
    for name, some in ratios.items():
        tell(name, some, np.sum(np.array(some) <= ALLOWED))


def tell(what, ratios, kept):
    """Print how many true errors were within what is allowed of the stated ones."""
    if COMM.rank == 0:
        print(
            f"{what}: true within {ALLOWED} × stated: {kept} of {len(ratios)}; true over stated in "
            f"the median {np.median(ratios):.2f}, at most {max(ratios):.2f}"
        )


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bodies", type=int, default=20)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--contacts", action="store_true")
    parser.add_argument("--read", action="store_true")
    parser.add_argument("--friction", action="store_true")
    parser.add_argument("--steep", action="store_true")
    parser.add_argument("--every", action="store_true")
    parser.add_argument("--back", action="store_true")
    parser.add_argument("--samples", type=int, default=1)
    parser.add_argument("--most", type=int, default=MOST_SHEARED)
    parser.add_argument("--shapes", nargs="+", choices=(*SHAPES, "block"), default=SHAPES)
    parser.add_argument("--cells", type=float, nargs=2, default=[2.0, 5.0])
    choice = parser.parse_args()
    read = choice.read or choice.friction
    (contacts if choice.contacts else reading if read else under_laws)(choice)


def under_laws(choice):
    """Compare stated and true errors of bodies under laws."""
    ratios, kept = [], 0
    for seed in range(choice.first, choice.first + choice.bodies):
        body, began = drawn(seed), time.process_time()
        found = stated_and_true(body, COMM)
        once, twice = (found.forces[-2:] - found.forces[0]) / found.load
        stated = np.array([found.mesh, found.quadrature]) / found.load
        ratios.append(abs(twice) / stated.sum())
        kept += abs(twice) <= ALLOWED * stated.sum() + ROUNDING
        if COMM.rank == 0:
            print(
                f"| {seed} | {body.name} | {found.dofs[0]} | {stated[0]:.2e} | {stated[1]:.2e} | "
                f"{-twice:+.2e} | {(twice - once) / twice:.2f} | {ratios[-1]:.2f} | "
                f"{time.process_time() - began:.0f} s |",
                flush=True,
            )
    tell("force", ratios, kept)


if __name__ == "__main__":
    main()
