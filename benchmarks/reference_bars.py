"""Whether error bars of the reference contain the force, judged by another family of meshes.

Surfaces of the paper's two kinds are drawn anew by the clock, or from `--seed`. Two meshes from the
block's lattice, as every scene has them, give a force with its bar; two from a mesh of the cube by
gmsh with `--edges` edges along the radius of a typical contact judge it, and `concurrent` stands
beside both. Run by hand:
`.venv/bin/python benchmarks/reference_bars.py [--surfaces 8]`; about a minute a surface.
"""

import argparse
import tempfile
import time

import gmsh
import numpy as np

from patchlaw.geometry.meshes.refined_block import EDGES
from patchlaw.multiscale import Scene, make_setup, run

KINDS = {"Set 1": {"waves": [2, 10]}, "Set 2": {"waves_x": [2, 7], "waves_y": [2, 12]}}


def write_cube(path):
    """Write the paper's cube below its face ``top``, meshed by gmsh."""
    gmsh.initialize(["", "-v", "0"], readConfigFiles=False)
    gmsh.model.occ.addBox(0, 0, -1, 1, 1, 1)
    gmsh.model.occ.synchronize()
    for tag, name, height in ((1, "bottom", -1.0), (2, "top", 0.0)):
        box = (-0.1, -0.1, height - 0.1, 1.1, 1.1, height + 0.1)
        faces = [face for _, face in gmsh.model.getEntitiesInBoundingBox(*box, 2)]
        gmsh.model.addPhysicalGroup(2, faces, tag)
        gmsh.model.setPhysicalName(2, tag, name)
    gmsh.model.addPhysicalGroup(3, [1], 1)
    gmsh.option.setNumber("Mesh.MeshSizeMax", 0.37)  # divides no edge of the cube's lattice
    gmsh.model.mesh.generate(3)
    gmsh.write(path)
    gmsh.finalize()


def scene(kind, seed, coupling, mesh=None, **reference):
    """Return the paper's cube under 8 µm with a surface of its own, or its mesh in a file."""
    spectrum = {"hurst": 0.95, "rms_slope": 0.215, "seed": int(seed), **KINDS[kind]}
    material = {"young_modulus": "4 GPa", "poisson_ratio": 0.15}
    supports = [{"surface": "bottom"}]
    cube = {"block": {"height": "1 mm", **material}}
    if mesh:
        cube = {"body": {"mesh": mesh, "contact": "top", "supports": supports, **material}}
    return Scene.from_dict(
        {
            "surface": {"spectrum": spectrum, "grid": [128, 128], "lengths": ["1 mm", "1 mm"]},
            **cube,
            "coupling": {"kind": coupling},
            "load": {"approach": "8 um", "steps": 1},
            "reference": reference,
        }
    )


def force(case):
    """Return the force at mesh size zero [N], its bar, and the seconds of this process."""
    began = time.process_time()
    estimate = run(case).reference.force
    return float(estimate.value[-1]), float(estimate.error[-1]), time.process_time() - began


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--surfaces", type=int, default=8)
    parser.add_argument("--edges", type=float, default=4.5, help="of the judge, along a radius")
    parser.add_argument("--seed", type=int, default=int(time.time()))
    choice = parser.parse_args()
    rng, names = np.random.default_rng(choice.seed), list(KINDS)
    print(f"seed {choice.seed}; judged by gmsh's cube with {choice.edges:g} edges")
    inside, folder = 0, tempfile.TemporaryDirectory()
    cube = f"{folder.name}/cube.msh"
    write_cube(cube)
    for number in range(choice.surfaces):
        kind, seed = names[number % 2], rng.integers(2**31)
        meshes = make_setup(scene(kind, seed, "reference")).rough_meshes
        own, bar, seconds = force(scene(kind, seed, "reference"))
        fine = float(meshes.sizes[-1]) * EDGES / choice.edges
        judge, its_bar, more = force(scene(kind, seed, "reference", cube, fine=fine))
        concurrent = run(scene(kind, seed, "concurrent")).force_N[-1]
        inside += abs(own - judge) <= bar + its_bar
        print(
            f"{kind} {seed:10d}: {own:.4f} N ± {bar / own:.2%} ({meshes.unknowns[-1]} unknowns, "
            f"{seconds:.0f} s); judge {judge / own - 1:+.2%} ± {its_bar / judge:.2%} "
            f"({more:.0f} s); concurrent {concurrent / own - 1:+.2%}",
            flush=True,
        )
    print(f"within both bars: {inside} of {choice.surfaces}")


if __name__ == "__main__":
    main()
