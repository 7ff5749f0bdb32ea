"""Pictures of the three bodies: the body, and the contact pressure on its face.

    for body in brake_pad flange seal_ring; do
      .venv/bin/python demos/bodies/$body.py
      .venv/bin/patchlaw run demos/bodies/$body.toml --out results/$body
    done
    .venv/bin/python demos/bodies/pictures.py

It reads the fields of the last load step, `fields.h5`, and says what the face carries. `--results`
is the folder of the runs, `--out` that of the pictures.
"""

import argparse
from pathlib import Path

import h5py
import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

FACETS = {
    4: [(0, 1, 2), (0, 1, 3), (0, 2, 3), (1, 2, 3)],
    8: [(0, 1, 2, 3), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)],
}
"""Corners of the facets of tetrahedra and of hexahedra, in XDMF's order."""

VIEWS = {"brake_pad": (42, -60, 1.45), "flange": (32, -60, 1.3), "seal_ring": (30, -25, 1.2)}
"""Elevation and azimuth of the views [degrees], and their zoom."""

GREY, LIGHT = np.array([0.78, 0.82, 0.88]), np.array([0.35, -0.35, 0.87])


def outer_facets(folder: Path) -> tuple[np.ndarray, np.ndarray]:
    """Return the corners of the body's outer facets (n, 3 or 4, 3), and their pressures (n,)."""
    with h5py.File(folder / "fields.h5") as file:
        points, cells = (file[f"Mesh/mesh/{name}"][:] for name in ("geometry", "topology"))
        steps = file["Function/pressure"]
        pressure = steps[max(steps, key=int)][:, 0]
    facets = np.concatenate([cells[:, corners] for corners in FACETS[cells.shape[1]]])
    owner = np.tile(np.arange(len(cells)), len(facets) // len(cells))
    _, first, count = np.unique(
        np.sort(facets, axis=1), axis=0, return_index=True, return_counts=True
    )
    outer = first[count == 1]
    return points[facets[outer]], pressure[owner[outer]]


def area_vectors(corners: np.ndarray) -> np.ndarray:
    """Return the vectors across triangles or squares, as long as their areas."""
    if corners.shape[1] == 3:
        return 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return 0.5 * np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])


def draw(name: str, folder: Path, out: Path) -> None:
    """Draw the body beside the pressures of its contact face, and say what that carries."""
    corners, pressure = outer_facets(folder)
    vectors = area_vectors(corners)
    area = np.linalg.norm(vectors, axis=1)
    face = (corners[:, :, 2] > corners[:, :, 2].max() - 1e-6).all(axis=1)
    load, size = pressure[face], area[face]
    order = np.argsort(load)[::-1]
    half = np.searchsorted(np.cumsum((load * size)[order]), 0.5 * (load * size).sum())
    mean = (load * size).sum() / size.sum()
    print(
        f"{name}: mean {mean:.3g} MPa, largest of a facet {load.max():.3g} MPa; half of the force "
        f"on {size[order][: half + 1].sum() / size.sum():.1%} of the face, less than a tenth of "
        f"the mean on {size[load < 0.1 * mean].sum() / size.sum():.1%}"
    )

    figure = Figure(figsize=(9.6, 4.0), layout="constrained")
    body, plane = figure.add_subplot(1, 2, 1, projection="3d"), figure.add_subplot(1, 2, 2)
    map_ = PolyCollection(corners[face][:, :, :2], array=load, cmap="viridis", edgecolors="face")
    plane.add_collection(map_)
    plane.autoscale_view()
    plane.set(xlabel="x [mm]", ylabel="y [mm]", aspect="equal")
    figure.colorbar(map_, ax=plane, label="contact pressure [MPa]")
    shade = 0.55 + 0.45 * np.abs(vectors @ LIGHT) / area
    colours = shade[:, None] * GREY
    colours[face] = map_.to_rgba(load)[:, :3]
    body.add_collection3d(Poly3DCollection(corners, facecolors=colours, edgecolors=colours))
    lower, upper = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    body.set(xlim=(lower[0], upper[0]), ylim=(lower[1], upper[1]), zlim=(lower[2], upper[2]))
    elevation, azimuth, zoom = VIEWS[name]
    body.set_box_aspect(upper - lower, zoom=zoom)
    body.view_init(elevation, azimuth)
    body.set_axis_off()
    figure.savefig(out / f"{name}.png", dpi=90)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--results", type=Path, default=Path("results"))
    parser.add_argument("--out", type=Path, default=Path(__file__).parent)
    choice = parser.parse_args()
    for name in VIEWS:
        if (choice.results / name / "fields.h5").exists():
            draw(name, choice.results / name, choice.out)


if __name__ == "__main__":
    main()
