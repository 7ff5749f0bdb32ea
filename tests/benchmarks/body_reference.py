"""A foot that is no cuboid, pressed: its roughness meshed, in the contact problem, and in laws.

Run by hand: `.venv/bin/python tests/benchmarks/body_reference.py [--seeds 191 192] [--edges 3]
[--figure FILE]`; minutes a surface. The body is an L (`tests/l_shape.py`): its face sinks and turns
with the arm that it stands on. The reference meshes the roughness, three times, and extrapolates
to mesh size zero with an error bar; `concurrent` and the calibrated laws of 4 × 4 patches on a
plain mesh know the flat body alone. The forces of a block as high as the foot, held at its bottom,
say how much the arm matters.
"""

import os

os.environ["OMP_NUM_THREADS"] = "1"

import argparse
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from l_shape import (
    Reference,
    added_by_arm,
    embedded,
    embedded_model,
    flat_body,
    laws_on_mesh,
    moments,
    reach,
    rough,
)

APPROACHES = (2.5e-3, 5e-3, 7.5e-3, 10e-3)


def percent(forces, value):
    """Return differences to a reference, in parts of its largest force."""
    return " ".join(f"{part:+.2%}" for part in (np.array(forces) - value) / value.max())


def pressed(reference):
    """Press the meshed roughness; return its forces, its bars, and the finest problem."""
    forces = []
    for shape in reference.shapes:
        start = time.perf_counter()
        problem, states = reference.solved(shape)
        forces.append([state.force for state in states])
        print(
            f"  reference, {1e3 * shape.fine:5.2f} µm, {problem.body.dofs:6d} unknowns: "
            + " ".join(f"{force:.4f}" for force in forces[-1])
            + f" N, {time.perf_counter() - start:.0f} s",
            flush=True,
        )
    return reference.extrapolate(forces), problem, states[-1]


def compare(seed, edges, added, flat):
    """Print the comparison of one surface; return the finest reference at the largest load."""
    surface = rough(seed)
    none = np.zeros_like(added)
    cuboid = embedded(embedded_model(surface, none), APPROACHES)
    start = time.perf_counter()
    model = embedded_model(surface, added)
    concurrent = embedded(model, APPROACHES)
    spent = time.perf_counter() - start
    last = concurrent[-1]
    print(
        f"Set 1, seed {seed}: at {1e3 * last.approach:g} µm {last.force:.4f} N on the foot, "
        f"{cuboid[-1].force:.4f} N on a block; moments about y {moments(last)[0]:.4f} "
        f"and {moments(cuboid[-1])[0]:.4f} N mm; concurrent {spent:.1f} s",
        flush=True,
    )
    start = time.perf_counter()
    laws = laws_on_mesh(model, APPROACHES, 4, flat)
    print(f"  laws of 4 × 4 patches on {flat.dofs} unknowns: {time.perf_counter() - start:.1f} s")
    reference = Reference(
        surface=surface, approaches=APPROACHES, plane=reach(last, added), edges=edges
    )
    found, problem, state = pressed(reference)
    bars = found.error / found.value.max()
    print(
        "  reference  " + " ".join(f"{value:.4f}" for value in found.value) + " N ± "
        + " ".join(f"{bar:.2%}" for bar in bars)
        + "\n  concurrent " + percent([s.force for s in concurrent], found.value)
        + "\n  consistent " + percent([s.force for s in laws], found.value)
        + "\n  small slopes "
        + percent(
            [s.force for s in embedded(embedded_model(surface, added, slopes=False), APPROACHES)],
            found.value,
        ),
        flush=True,
    )
    return problem, state


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, nargs="*", default=[191, 192])
    parser.add_argument("--edges", type=float, default=3.0)
    parser.add_argument("--figure")
    choice = parser.parse_args()
    start = time.perf_counter()
    added, flat = added_by_arm(), flat_body()
    print(f"what the arm adds: {time.perf_counter() - start:.1f} s", flush=True)
    for seed in choice.seeds:
        finest = compare(seed, choice.edges, added, flat)


if __name__ == "__main__":
    main()
