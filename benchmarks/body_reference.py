"""A foot that is no cuboid, pressed: its roughness meshed, in the contact problem, and in laws.

Run by hand: `.venv/bin/python benchmarks/body_reference.py [--seeds 192 191] [--edges 4]
[--figure FILE]`; some minutes a surface on one core. The body is an L (`l_shape.py`): its face
sinks and turns with the arm that it stands on. The reference meshes the roughness three times
and extrapolates to mesh size zero, with an error bar. `concurrent` and `consistent`, with 4 × 4
patches, are scenes whose mesh is flat. A block as high as the foot says how much its shape matters.
"""

import os

os.environ["OMP_NUM_THREADS"] = "1"
os.environ["PATCHLAW_CACHE"] = "off"  # times are those of a first run

import argparse
import sys
import tempfile
import time
from pathlib import Path

import mpi4py.MPI  # noqa: F401  # isort: skip  (its library is loaded before dolfinx)
import numpy as np
from dolfinx import mesh as dmesh
from matplotlib.colors import Normalize
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from scipy.spatial import cKDTree

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.l_shape import Reference, reach, scene, write_foot
from patchlaw.geometry.face_frame import UPWARD
from patchlaw.macro import compat, contact_facets, nodal_contact
from patchlaw.multiscale import make_setup, run
from patchlaw.multiscale.results.figures import style
from patchlaw.multiscale.results.figures.style import colour_bar, map_axes

LARGEST, STEPS, EDGE = 10e-3, 4, 0.2
MAGNIFIED, ROUGH = 30, 0.2  # the face lies above −0.2 mm
BLOCK = "a block of the same height"
SMALL = {"micro": {"model": "half-space", "finite_slopes": False}}


def timed(name, work):
    """Print a result's forces and its time, and return it."""
    start = time.perf_counter()
    found = work()
    forces = " ".join(f"{force:.4f}" for force in found.force_N)
    print(f"  {name:34s} {forces} N, {time.perf_counter() - start:.0f} s", flush=True)
    return found


def pressed(reference):
    """Press the meshed roughness; return its forces with bars, and the finest body as a picture."""
    forces = []
    for shape in reference.shapes:
        start = time.perf_counter()
        problem, states = reference.solved(shape)
        forces.append([state.force for state in states])
        told = " ".join(f"{force:.4f}" for force in forces[-1])
        name = f"reference, {1e3 * shape.fine:.1f} µm, {problem.body.dofs} unknowns"
        print(f"  {name:34s} {told} N, {time.perf_counter() - start:.0f} s", flush=True)
    return reference.extrapolated(forces), shown(problem, states[-1])


def shown(problem, state):
    """Return the outer triangles, how their corners move, and the nodes in contact."""
    mesh, space = problem.body.mesh.mesh, problem.body.space
    outer = dmesh.exterior_facet_indices(mesh.topology).astype(np.int32)
    facets = contact_facets(mesh, outer, UPWARD)
    _, at = compat.reference_facets("tetrahedron")
    nodes = np.take_along_axis(compat.cell_nodes(space)[facets.cell], at[facets.side], axis=1)
    contact = nodal_contact(problem, state)
    touching = contact.region >= 0
    return {
        "corners": np.concatenate([facets.corners, -facets.depth[..., None]], axis=2)[:, :3],
        "moved": problem.body.function(state.displacement).x.array.reshape(-1, 3)[nodes],
        "spots": np.stack([contact.x, contact.y], axis=1)[touching],
    }


def draw(picture, path):
    """Draw the deformed foot with its contact spots, the face from above, and the forces."""
    style.use_style()
    figure = style.new_figure(style.FULL_WIDTH, 2.75)
    figure.set_layout_engine("none")  # axes are placed by hand
    space = figure.add_axes((-0.03, -0.08, 0.38, 1.1), projection="3d", computed_zorder=False)
    corners, moved, spots = (picture[key] for key in ("corners", "moved", "spots"))
    deformed = corners + MAGNIFIED * moved
    sunk = -1e3 * moved[..., 2].mean(axis=1)
    norm = Normalize(0.0, sunk.max())
    across = np.cross(deformed[:, 1] - deformed[:, 0], deformed[:, 2] - deformed[:, 0])
    lit = np.abs(across @ (0.3, -0.75, 0.6)) / np.linalg.norm(across, axis=1)
    colours = style.STRESSES(norm(sunk)) * np.append(np.ones(3), 0.0) * (0.55 + 0.45 * lit[:, None])
    colours[:, 3] = 1.0
    space.add_collection3d(
        Poly3DCollection(deformed, facecolors=colours, edgecolors=colours, lw=0.2, rasterized=True)
    )
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    upward = np.abs(normal[:, 2]) > 0.5 * np.linalg.norm(normal, axis=1)  # not a side of the leg
    on_top = upward & (np.abs(corners[..., 2]).max(axis=1) < ROUGH)
    nearest = cKDTree(corners[on_top][..., :2].mean(axis=1)).query(spots)[1]
    x, y, z = deformed[on_top][nearest].mean(axis=1).T
    space.scatter(x, y, z, s=2, c=style.VERMILLION, depthshade=False, zorder=3)
    space.set(xlim=(0, 1.6), ylim=(-0.3, 1.3), zlim=(-1.8, 0.1), box_aspect=(1.6, 1.6, 1.9))
    space.set_box_aspect((1.6, 1.6, 1.9), zoom=1.08)
    space.view_init(elev=38.0, azim=-62.0)
    space.set_axis_off()
    figure.text(0.02, 0.93, f"displacements × {MAGNIFIED}")
    face = figure.add_axes((0.38, 0.17, 0.2, 0.72))
    image = face.tripcolor(
        *corners[on_top][..., :2].reshape(-1, 2).T,
        np.arange(3 * on_top.sum()).reshape(-1, 3),
        -1e3 * moved[on_top][..., 2].ravel(),
        shading="gouraud", cmap=style.STRESSES, norm=norm, rasterized=True,
    )  # fmt: skip
    face.scatter(*spots.T, s=2, c=style.VERMILLION)
    map_axes(face, (1.0, 1.0))
    face.set_title("face, contact in orange")
    colour_bar(image, face, "moves down by [µm]")
    curves = figure.add_axes((0.74, 0.17, 0.25, 0.76))
    _draw_curves(curves, dict(picture["curves"]))
    forces = (picture["curves"][name][1][-1] for name in ("concurrent", BLOCK))
    answer = f"carries {np.divide(*forces):.2f} times as much"
    figure.savefig(path, pil_kwargs={"optimize": True}, metadata={"answer": answer})


def _draw_curves(axes, curves):
    """Draw forces over the approach: the reference with its bar as points, and models as lines."""
    approach, value, bar = curves.pop("reference")
    looks = {BLOCK: (style.SKY, "--", (0.08, 0.6)), "concurrent": (style.BLUE, "-", (0.52, 0.1))}
    for name, (colour, line, place) in looks.items():
        at, force = curves[name]
        axes.plot(1e3 * np.append(0.0, at), np.append(0.0, force), line, color=colour)
        axes.text(*place, name.replace(" the", "\nthe"), color=colour, transform=axes.transAxes)
    axes.errorbar(1e3 * approach, value, bar, color=style.INK, fmt="o", capsize=3)
    axes.text(0.02, 0.93, "points: roughness meshed", transform=axes.transAxes)
    axes.set(xlabel="approach [µm]", ylabel="force [N]", xlim=(0, None), ylim=(0, None))


def compare(seed, edges, foot):
    """Print the comparison of one surface; return what a figure of it shows."""
    print(f"Set 1, seed {seed}, {STEPS} steps to {1e3 * LARGEST:g} µm", flush=True)

    def go(kind, foot=foot, **sections):
        content = {"coupling": {"kind": kind}, **sections}
        return run(scene(seed, LARGEST, STEPS, foot=foot, **content))

    histories = {
        BLOCK: timed(f"{BLOCK}, concurrent", lambda: go("concurrent", None)),
        "concurrent": timed("concurrent", lambda: go("concurrent")),
        "consistent": timed("consistent, 4 × 4 patches", lambda: go("consistent")),
        "small slopes": timed("small slopes", lambda: go("concurrent", **SMALL)),
    }
    concurrent = histories["concurrent"]
    surface = make_setup(scene(seed, LARGEST, STEPS)).parts.surface
    found, picture = pressed(
        Reference(
            surface=surface,
            approaches=tuple(concurrent.approach_mm),
            plane=reach(concurrent),
            edges=edges,
        )
    )
    value, bar = found.value, found.error / found.value.max()
    forces = " ".join(f"{force:.4f}" for force in value)
    print(f"  {'reference, mesh size zero':34s} {forces} N")
    print(f"  {'its error bar':34s} " + " ".join(f"±{part:.2%}" for part in bar))
    for name, history in histories.items():
        parts = (history.force_N - value) / value.max()
        print(f"  {name + ', difference':34s} " + " ".join(f"{part:+.2%}" for part in parts))
    curves = {name: (history.approach_mm, history.force_N) for name, history in histories.items()}
    curves["reference"] = concurrent.approach_mm, value, found.error
    return {"seed": seed, "curves": curves, **picture}


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, nargs="*", default=[192, 191])
    parser.add_argument("--edges", type=float, default=4.0)
    parser.add_argument("--figure", type=Path)
    choice = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        foot = write_foot(Path(folder) / "foot.msh", EDGE)
        for seed in choice.seeds:
            last = compare(seed, choice.edges, foot)
    if choice.figure:
        draw(last, choice.figure)


if __name__ == "__main__":
    main()
