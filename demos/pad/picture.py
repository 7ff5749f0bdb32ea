"""The picture of the rough brake pad: a map, the pad, CalculiX beside it, and the chip."""

from pathlib import Path
from typing import Any

import numpy as np
from pad.calculix import Solution
from pad.maps import SIDE
from scipy.interpolate import LinearNDInterpolator

from patchlaw.multiscale import LoadStep
from patchlaw.multiscale.results.figures.style import (
    BLUE,
    FULL_WIDTH,
    HEIGHTS,
    INK,
    VERMILLION,
    colour_bar,
    draw_face,
    new_figure,
    use_style,
)
from patchlaw.multiscale.results.run_curves import pressure_between

POINTS = {"fmt": "o", "color": VERMILLION, "capsize": 2.0}


def pressures(model: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return pressures on the face of a pad at its latest load step; collective.

    Args:
        model: The model of the face.

    Returns:
        Pressures (x, y, p) at points, corners of the facets in space, and their mean pressures.
    """
    (corners, means), frame = model.facet_pressures(), model.face.sides[0].facets.frame
    places = frame.in_space(corners.reshape(-1, 2)).reshape(*corners.shape[:2], 3)
    return model.face_pressures(), places, means


def draw(
    path: Path,
    map_file: Path,
    pads: dict[str, tuple[LoadStep, np.ndarray, np.ndarray, np.ndarray]],
    witness: Solution | None,
    chips: dict[str, Any],
) -> None:
    """Draw what the demo found.

    Args:
        path: File to write.
        map_file: The map that is shown.
        pads: Load step, pressures (x, y, p) at points of the pad, corners of its facets and their
            mean pressures, by the kind of its elements.
        witness: What CalculiX found with linear ones; None without it.
        chips: Histories of the chip by coupling.
    """
    use_style()
    figure = new_figure(FULL_WIDTH, 5.0)
    (one, two), (three, four) = figure.subplots(2, 2)
    heights = 1e3 * np.load(map_file)
    heights -= np.nanmean(heights)
    look = {"origin": "lower", "extent": (0.0, SIDE, 0.0, SIDE), "cmap": HEIGHTS}
    image = one.imshow(heights.T, vmin=-15.0, vmax=15.0, **look)
    one.set(title="a map as delivered; white: no height", xlabel="x [mm]", ylabel="y [mm]")
    one.grid(False)
    colour_bar(image, one, "height [µm]", extend="both")
    _, _, corners, pressure = pads["quadratic"]
    draw_face(two, corners[..., 1::-1], pressure, "pressure")
    two.set(xlabel="y [mm]", ylabel="x [mm]", title="the pad at 8 kN; grey: open")
    if witness is not None:
        linear = pads["linear"][1]
        here = LinearNDInterpolator(linear[:, :2], linear[:, 2])(witness.places)
        three.plot(here, witness.pressures, ".", color=BLUE, ms=2.0)
        three.axline((0.0, 0.0), slope=1.0, color=INK, lw=0.7)
    three.set(xlabel="pressure by patchlaw [MPa]", xlim=(0, None), ylim=(0, None))
    three.set(ylabel="by CalculiX [MPa]", title="the same law at the nodes of the pad; line: equal")
    reference, embedded = chips["reference"], chips["concurrent"]
    area = embedded.patches.area * embedded.patches.count
    for _, approach, pressure in pressure_between(embedded, "approach_mm"):
        four.plot(1e3 * approach, area * pressure, color=BLUE)
    bars = 1e3 * reference.approach_error_mm
    four.errorbar(1e3 * reference.approach_mm, reference.force_N, xerr=bars, **POINTS)
    four.set(xlabel="approach [µm]", ylabel="force [N]", xlim=(0, None), ylim=(0, None))
    four.set_title("a chip of the pad; points: roughness meshed")
    figure.savefig(path, pil_kwargs={"optimize": True})
