"""Weak scaling of a body under a law on quadratic tetrahedra, and what it means for 256 ranks.

Run by hand: ``.venv/bin/python benchmarks/body_scaling.py [--unknowns 3e4] [--ranks 1 2 4]
[--parts 8 16]``. The pad of `body_solvers.py` has as many unknowns for every rank. Ranks may share
cores, so that nothing is told of wall time: iterations, Newton steps, PETSc's counts (operations,
messages and bytes of the products), user CPU seconds, and what the partition cuts. ``--parts`` adds
ranks that only divide the mesh. The last table is a plan: the time of an iteration on 256 ranks of
a usual cluster, by the numbers measured before. By ``--rank`` one rank measures.
"""

import argparse
import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from helpers.mpi_environment import BESIDE_OTHERS
from scaling_model import Machine

HERE = Path(__file__).parent
AT = 1.6e4
"""Unknowns of the pad with the cells of `body_solvers.py` at a scale of 0.6, about."""
MANY, NEIGHBOURS = 256, 14
"""Ranks of the plan, and the neighbours that a part of an unstructured mesh has, about."""
BYTES = 8.4 / 4.0
"""Of a product for an operation: an entry above the diagonal and its share of a column number are
read once for two multiplications and additions. hypre's operations are not counted."""
EXCHANGES = 2
"""Of a product: half of a symmetric matrix needs the ghosts' numbers, and sends theirs back."""


def measure(unknowns, *, solves):
    """Return what this rank and all others measure of a pad with so many unknowns in all."""
    import numpy as np
    from body_solvers import COMM, PARTS, iterations
    from laws_on_bodies import ExponentialLaw
    from machine_parts import part_body, read_part
    from mpi4py import MPI
    from petsc4py import PETSc

    from patchlaw.geometry import Control, PatchGrid
    from patchlaw.macro import LawContactProblem, LoadedFace, contact_facets, planar_face
    from patchlaw.macro.linear_solvers import selection

    selection.FACTORISED_VERTICES = 0  # as on large bodies
    part, *rest = PARTS["pad, P2"]
    scale = 0.6 * (unknowns / AT) ** (1.0 / 3.0)
    tagged = read_part(replace(part, size=part.size / scale), COMM)
    body, tag = part_body(tagged, *rest), tagged.facet_names["contact"]
    plane, facets = planar_face(tagged, tag), tagged.facet_tags.find(tag)
    patches = PatchGrid(grid=(1, 1), lengths=plane.lengths)
    face = LoadedFace(body, contact_facets(tagged.mesh, facets, plane.frame), patches)
    nodes = body.space.dofmap.index_map
    own = [nodes.size_local, nodes.num_ghosts, len(face.pointwise.weight)]
    owned, ghosts, samples = np.array(COMM.allgather(own)).T
    facts = {
        "ranks": COMM.size,
        "unknowns": body.dofs,
        "imbalance": float(owned.max() / owned.mean()),
        "ghosts": float((ghosts / owned).max()),
        "cut": float((ghosts / owned ** (2.0 / 3.0)).max()),
        "samples": int(samples.sum()),
        "most_samples": float(samples.max() / samples.mean()),
        "without": int((samples == 0).sum()),
    }
    if not solves:
        return facts

    def spent(work):
        began = os.times().user, PETSc.Log.getFlops()
        found = work()
        ended = os.times().user, PETSc.Log.getFlops()
        return found, *(
            COMM.allreduce(b - a) / body.dofs for a, b in zip(began, ended, strict=True)
        )

    def product(matrix):
        x, y = matrix.createVecs()
        matrix.mult(x, y)  # the first one sets up its messages
        before = PETSc.Log.Event("MatMult").getPerfInfo()
        matrix.mult(x, y)
        after = PETSc.Log.Event("MatMult").getPerfInfo()
        sent = [0.5 * (after[key] - before[key]) for key in ("numMessages", "messageLength")]
        return [COMM.allreduce(part, op=MPI.MAX) for part in sent]

    solver = body.solver
    facts["messages"], facts["bytes"] = product(body.stiffness)
    facts["iterations"], facts["cpu"], facts["flops"] = spent(lambda: iterations(body, solver))
    solver.setTolerances(rtol=1e-10)
    problem = LawContactProblem(face, [ExponentialLaw(4e-3)], "pointwise")
    force = 10.0 * float(face.areas.sum())
    states, facts["steps_cpu"], facts["steps_flops"] = spent(
        lambda: [problem.solve(Control(force=force * k / 4)) for k in (1, 2, 3, 4)]
    )
    facts["newton"] = sum(state.iterations for state in states)
    facts["linear"] = sum(state.linear_iterations for state in states)
    facts["approach"] = states[-1].approach
    return facts


def start(ranks, unknowns, *, solves):
    """Measure on a number of ranks."""
    words = ["mpirun", "-n", str(ranks), sys.executable, __file__, "--rank", str(unknowns)]
    done = subprocess.run(
        words + ["--solves"] * solves,
        env=os.environ | BESIDE_OTHERS | {"PYTHONPATH": str(HERE.parent)},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    if done.returncode:
        sys.exit(done.stderr)
    return json.loads(done.stdout.splitlines()[-1])


def show(facts):
    """Print the counts of all ranks."""
    print("ranks unknowns | largest part, ghosts of owned nodes, per owned^(2/3) | points of the ")
    print("law, largest part, ranks without | messages and kB of a product, busiest rank")
    for one in facts:
        print(
            f"{one['ranks']:5d} {one['unknowns']:8d} | {one['imbalance']:.2f} {one['ghosts']:6.1%} "
            f"{one['cut']:5.2f} | {one['samples']:6d} {one['most_samples']:5.2f} "
            f"{one['without']:3d} | {one.get('messages', 0):.0f} {one.get('bytes', 0) / 1e3:.1f}"
        )
    print("ranks | one solution: iterations, user CPU µs and operations per unknown and iteration")
    print("      | four load steps: Newton, linear, user CPU µs and operations per unknown")
    for one in facts:
        if "iterations" in one:
            n = one["iterations"]
            print(
                f"{one['ranks']:5d} | {n:3d} {1e6 * one['cpu'] / n:6.2f} {one['flops'] / n:6.0f} | "
                f"{one['newton']:3d} {one['linear']:4d} {1e6 * one['steps_cpu']:7.1f} "
                f"{one['steps_flops']:8.0f}   approach {one['approach']:.12e} mm"
            )


def plan(facts, on=Machine()):  # noqa: B008
    """Print the time of an iteration on many ranks."""
    solved = [one for one in facts if "iterations" in one]
    operations = max(one["flops"] / one["iterations"] for one in solved)
    work = operations / (on.memory / BYTES)
    cut = max(one["cut"] for one in facts)
    products = 5  # of an iteration: one of conjugate gradients, four of the cycle
    print(
        f"plan for {MANY} ranks: {1e6 * work:.2f} µs per unknown and iteration, {cut:.1f} n^(2/3)"
    )
    print("ghosts of n nodes; unknowns each, ghosts of owned nodes, kB of a product, work and")
    print("messages of an iteration [ms], share of work")
    for each in (1e4, 3e4, 1e5):
        nodes = each / 3.0
        ghosts = cut * nodes ** (2.0 / 3.0)
        sent = EXCHANGES * 24.0 * ghosts
        exchange = EXCHANGES * (on.latency + NEIGHBOURS * on.overhead)
        waits = products * (exchange + sent / on.network) + 3 * on.latency * 8
        print(
            f"{each:8.0f} {ghosts / nodes:6.1%} {sent / 1e3:7.1f} {1e3 * each * work:7.2f} "
            f"{1e3 * waits:7.2f} {each * work / (each * work + waits):6.0%}"
        )


def main():
    """Measure and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--unknowns", type=float, default=3e4, help="of a rank")
    parser.add_argument("--ranks", type=int, nargs="*", default=[1, 2, 4])
    parser.add_argument("--parts", type=int, nargs="*", default=[8, 16])
    parser.add_argument("--rank", type=float)
    parser.add_argument("--solves", action="store_true")
    choice = parser.parse_args()
    if choice.rank:
        from mpi4py import MPI
        from petsc4py import PETSc

        PETSc.Log.begin()
        facts = measure(choice.rank, solves=choice.solves)
        if MPI.COMM_WORLD.rank == 0:
            print(json.dumps(facts))
        return
    n = choice.unknowns
    facts = [start(ranks, n * ranks, solves=True) for ranks in choice.ranks]
    facts += [start(ranks, n * ranks, solves=False) for ranks in choice.parts]
    show(facts)
    plan(facts)


if __name__ == "__main__":
    main()
