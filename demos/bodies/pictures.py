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
from typing import Any

import h5py
import numpy as np
from matplotlib.collections import LineCollection, PolyCollection
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from patchlaw.multiscale.results.figures.style import (
    FULL_WIDTH,
    PRESSURES,
    colour_bar,
    new_figure,
    use_style,
)

FACETS = {
    4: [(0, 1, 2), (0, 1, 3), (0, 2, 3), (1, 2, 3)],
    8: [(0, 1, 2, 3), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)],
}
"""Corners of the facets of tetrahedra and of hexahedra, in XDMF's order."""

VIEWS = {  # elevation and azimuth [degrees], zoom, height of the figure over its width
    "brake_pad": (42, -25, 1.02, 0.28),
    "flange": (32, -60, 1.15, 0.42),
    "seal_ring": (28, -35, 1.07, 0.42),
}
"""How the bodies are seen."""

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

    elevation, azimuth, zoom, height = VIEWS[name]
    figure = new_figure(FULL_WIDTH, height * FULL_WIDTH)
    figure.set_layout_engine("none")  # axes are placed by hand
    square = 0.52 / height  # as high as wide
    body = figure.add_axes((0.0, 0.5 - 0.5 * square, 0.52, square), projection="3d")
    plane = figure.add_axes((0.57, 0.17, 0.3, 0.76))
    open_ = load <= 0.0  # nothing is carried there: white
    spans = np.ptp(corners[face], axis=(0, 1))
    axis = [1, 0] if spans[1] > 2.0 * spans[0] else [0, 1]  # the longer side lies
    seen = corners[face][:, :, axis]
    map_ = PolyCollection(
        seen, array=np.ma.masked_where(open_, load), cmap=PRESSURES,
        edgecolors="face", lw=0.2, rasterized=True,
    )  # fmt: skip
    map_.set_clim(0.0, load.max())
    plane.add_collection(map_)
    outline(plane, seen)
    plane.autoscale_view()
    across, up = np.array(["x [mm]", "y [mm]"])[axis]
    plane.set(xlabel=across, ylabel=up, aspect="equal")
    plane.grid(False)
    long = height > 0.4  # as the bar is then
    colour_bar(map_, plane, "contact pressure [MPa]" if long else "pressure [MPa]")
    shade = 0.55 + 0.45 * np.abs(vectors @ LIGHT) / area
    colours = shade[:, None] * GREY
    colours[face] = np.where(open_[:, None], 1.0, map_.to_rgba(load)[:, :3])
    body.add_collection3d(Poly3DCollection(corners, facecolors=colours, edgecolors=colours, lw=0.2))
    lower, upper = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    body.set(xlim=(lower[0], upper[0]), ylim=(lower[1], upper[1]), zlim=(lower[2], upper[2]))
    body.set_box_aspect(upper - lower, zoom=zoom)
    body.view_init(elevation, azimuth)
    body.set_axis_off()
    figure.savefig(out / f"{name}.png", pil_kwargs={"optimize": True})


def outline(axes: Any, facets: np.ndarray) -> None:
    """Draw the edges that belong to one facet alone."""
    ends = np.stack([facets, np.roll(facets, -1, axis=1)], axis=2).reshape(-1, 2, 2)
    middles = np.round(ends.mean(axis=1), 6)
    _, first, count = np.unique(middles, axis=0, return_index=True, return_counts=True)
    axes.add_collection(LineCollection(ends[first[count == 1]], colors="0.35", lw=0.6))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--results", type=Path, default=Path("results"))
    parser.add_argument("--out", type=Path, default=Path(__file__).parent)
    choice = parser.parse_args()
    use_style()
    for name in VIEWS:
        if (choice.results / name / "fields.h5").exists():
            draw(name, choice.results / name, choice.out)


if __name__ == "__main__":
    main()
