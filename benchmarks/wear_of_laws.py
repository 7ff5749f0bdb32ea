"""Roughness that runs in under laws, against cells: by depth or by distance, and on one block.

`.venv/bin/python benchmarks/wear_of_laws.py`: two minutes. Prints what surfaces that wore under
different pressures approach by at equal depth and at equal distance, and their stiffness; then
approach, contact area, mean gap and stiffness of a face under laws of a map, and of its cells.
"""

import argparse
from dataclasses import replace

import numpy as np

from patchlaw import run
from patchlaw.geometry import Control, Material, Spectrum, synthesise
from patchlaw.micro import HalfSpaceModel
from patchlaw.micro.wear import slide
from patchlaw.multiscale import History, Scene

DEPTHS, PRESSURES = (1e-3, 2e-3, 4e-3), (0.5, 1.0, 2.0)  # mm, MPa
QUANTITIES = {
    "approach": "approach_mm",
    "area fraction": "contact_area_fraction",
    "mean gap": "mean_separation_mm",
    "stiffness": "interface_stiffness_N_per_mm",
}


def depths_or_distances(cells: int) -> None:
    """Print closures and stiffnesses of surfaces worn under different pressures."""
    band = Spectrum(hurst=0.8, waves=(2, cells // 4), rms_height=3e-3, seed=4)
    surface = synthesise(band, grid=(cells, cells), lengths=(2.0, 2.0))
    modulus = Material(young_modulus=1000.0, poisson_ratio=0.25).contact_modulus
    model = HalfSpaceModel(surface, contact_modulus=modulus, periodic=True)
    for pressure in PRESSURES:
        load, before = Control(force=pressure * surface.area), 0.0
        start = model.press(load).start
        for depth in DEPTHS:
            start = slide(model, load, start, (depth - before) / pressure).state.start
            before = depth
            heights = surface.heights - start.worn_depth
            worn = replace(
                model, surface=replace(surface, heights=heights), highest=model.reference_height
            )
            found = [worn.press(Control(force=one * surface.area)) for one in PRESSURES]
            closures = [1e3 * (state.approach - depth) for state in found]
            rates = [worn.stiffness(state, turns=False).approach for state in found]
            print(
                f"worn by {1e3 * depth:g} µm under {pressure:g} MPa (k s = {depth / pressure:.1e} "
                f"mm/MPa): closures {np.round(closures, 3)} µm, stiffnesses "
                f"{np.round(rates, -2)} N/mm under {PRESSURES} MPa",
                flush=True,
            )


def worn(kind: str, cells: int = 48, slid: tuple[float, ...] = (3e3, 3e4, 3e5, 1e6)) -> History:
    """Return the run of a rough block that slides, by its cells or by laws of them.

    Args:
        kind: ``"concurrent"`` or ``"representative"``.
        cells: Cells along a side.
        slid: Distances [mm].
    """
    band = {"hurst": 0.8, "waves": [6, cells // 4], "rms_height": 3e-3, "seed": 3}
    laws = kind == "representative"
    sides = {"lengths": [4.0, 4.0], "cells": [4, 2, 2], "element": "Q2"}
    block = {"young_modulus": 1000.0, "poisson_ratio": 0.25, "height": 2.0}
    data = {
        "surface": {"spectrum": band, "grid": [cells, cells], "lengths": [4.0, 4.0]},
        "block": block | (sides if laws else {}),
        "micro": {} if laws else {"finite_slopes": False},
        "coupling": {"table_tolerance": 5e-3} if laws else {"kind": kind},
        "law": {"kind": "representative"} if laws else {},
        "wear": {"coefficient": 1e-8},
        "load": {"force": 16.0, "steps": 1, "tilt": [4e-4, 0.0], "sliding": list(slid)},
        "output": {"figures": False, "report": False, "check": "none"},
    }
    return run(Scene.from_dict(data))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--cells", type=int, default=48)
    choice = parser.parse_args()
    depths_or_distances(64)
    cells, laws = (worn(kind, choice.cells) for kind in ("concurrent", "representative"))
    for name, column in QUANTITIES.items():
        print(name, *(getattr(history, column) for history in (cells, laws)), sep="\n  ")
