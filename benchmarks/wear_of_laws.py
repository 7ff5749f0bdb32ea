"""Roughness that runs in under laws, against cells: by depth or by distance, and on one block.

`.venv/bin/python benchmarks/wear_of_laws.py`: four minutes. Prints what surfaces that wore under
different pressures approach by at equal depth and at equal distance, and their stiffness; then what
faces under laws of maps differ by from the cells of these, new and after every distance, on blocks
drawn at random (`--seeds`).
"""

import argparse
from dataclasses import replace

import numpy as np

from patchlaw import run
from patchlaw.geometry import Control, Material, Spectrum, synthesise
from patchlaw.micro import HalfSpaceModel
from patchlaw.micro.wear import slide
from patchlaw.multiscale import History, Scene
from patchlaw.support import Array

DEPTHS, PRESSURES = (1e-3, 2e-3, 4e-3), (0.5, 1.0, 2.0)  # mm, MPa
COLUMNS = (
    "approach_mm",
    "contact_area_fraction",
    "mean_separation_mm",
    "interface_stiffness_N_per_mm",
    "worn_volume_mm3",
)
WAYS = np.array([0.02, 0.15, 0.8])
"""Depths that wear off, over the rms height; contact grows to some 0.7 of the face."""


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


def worn(seed: int, kind: str, *, even: bool = False, cells: int = 48) -> History:
    """Return the run of a rough block, drawn at random, that slides under a tilted plane.

    Args:
        seed: Of all that is drawn.
        kind: ``"concurrent"``: the cells of the map; ``"representative"``: a law of it, at every
            point of the face.
        even: Whether the law is pressed evenly, as between rollers under a level plane, and the
            map is periodic. All that the two differ by is then the interpolation of the laws.
        cells: Cells along a side.
    """
    draw = np.random.default_rng(seed)
    side, rms = draw.uniform(3.0, 6.0), draw.uniform(1.5e-3, 4e-3)
    young, wear = draw.uniform(500.0, 3000.0), draw.uniform(5e-9, 2e-8)
    body = {"young_modulus": young, "poisson_ratio": draw.uniform(0.1, 0.4)}
    height, pressure = side * draw.uniform(0.3, 0.8), young * draw.uniform(5e-4, 2e-3)
    slope = draw.uniform(0.6, 1.8) * rms / side
    slid = draw.uniform(0.7, 1.4) * WAYS * rms / (wear * pressure)
    waves = [3 if even else int(draw.integers(4, 8)), cells // 4]
    band = {"hurst": draw.uniform(0.6, 0.95), "waves": waves, "rms_height": rms}
    surface = {"spectrum": band | {"seed": seed}, "grid": [cells] * 2, "lengths": [side] * 2}
    laws, few = kind == "representative", 1 if even else 4
    on_mesh = {"lengths": [side] * 2, "cells": [few, few, (few + 1) // 2], "element": "Q2"}
    rollers = {"sides": "roller"} if even else {}
    alone = even and not laws
    data = {
        "surface": surface | ({"periodic": True} if alone else {}),
        "block": body | ({} if alone else {"height": height}) | (on_mesh | rollers if laws else {}),
        "micro": {"finite_slopes": False},
        "coupling": {"table_tolerance": 5e-3} if laws else {"kind": "analytic" if even else kind},
        "law": {"kind": "representative"} if laws else {},
        "wear": {"coefficient": wear},
        "load": {"force": pressure * side**2, "steps": 1, "sliding": slid.tolist()},
        "output": {"figures": False, "report": False, "check": "none"},
    }
    data["load"] |= {} if even else {"tilt": [slope, 0.0]}
    return run(Scene.from_dict(data))


def differences(seed: int, *, even: bool = False, cells: int = 48) -> dict[str, Array]:
    """Return what a law of a map gives less than its cells, new and after every distance.

    Approaches, stiffnesses and volumes are relative to those of cells, mean gaps to that of the new
    surface; areas are parts of the face. Where loads are even approaches hold the body under laws
    alone.
    """
    kinds = "representative", "concurrent"
    found = (worn(seed, kind, even=even, cells=cells) for kind in kinds)
    laws, true = ({name: np.array(getattr(one, name)) for name in COLUMNS} for one in found)
    gap = true["mean_separation_mm"][0]
    scale = true | {"contact_area_fraction": 1.0, "mean_separation_mm": gap}
    scale["worn_volume_mm3"] = true["worn_volume_mm3"][-1]
    return {name: (laws[name] - true[name]) / scale[name] for name in COLUMNS}


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seeds", type=int, nargs="*", default=range(1, 11))
    parser.add_argument("--cells", type=int, default=48)
    choice = parser.parse_args()
    depths_or_distances(64)
    for even in (True, False):
        print("evenly pressed" if even else "on a block under a tilted plane")
        every = [differences(seed, even=even, cells=choice.cells) for seed in choice.seeds]
        for name in COLUMNS[even:]:
            each = np.abs([one[name] for one in every])
            shares = ("median", np.median(each, axis=0)), ("largest", each.max(axis=0))
            print(f"  {name}:", *(f"{word} {np.round(share, 4)}" for word, share in shares))
