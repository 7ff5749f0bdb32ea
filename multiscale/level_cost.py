"""Predicts roughly what a level of a comparison costs: the cheapest are run first."""

from __future__ import annotations

import math

from multiscale.micro_choice import SOLUTIONS_OF_LAWS
from multiscale.scene import Scene
from multiscale.stage_checks import block_cells

START = 0.1
"""Seconds for a surface and its summits."""

SUMMITS = 5e-3
"""Seconds of a solution by summits, islands included."""

CELL = 3e-6
"""Seconds of a half-space's solution per cell."""

BLOCK = 5e-5
"""Seconds to assemble, and to solve once, per unknown of a block on the mesh."""

FACTORISATION = 4.5e-7
"""Seconds to factorise the smooth rest, per unknown to the power 3/2."""


def predicted_seconds(scene: Scene, heights: tuple[int, int]) -> float:
    """Return a rough wall time [s], good for an order of levels.

    Args:
        scene: The scene of the level.
        heights: Heights of its surface.
    """
    steps = len(scene.loading.programme.targets)
    whole = CELL * math.prod(heights) if scene.micro.model in ("half-space", "auto") else SUMMITS
    kind = scene.coupling.kind
    if kind == "analytic":
        return START + steps * whole
    if kind == "reference":
        return 100.0 * steps * scene.model_dump().get("reference", {}).get("meshes", 1)
    cells = block_cells(scene)
    if scene.coupling.decomposed:
        unknowns = 3.0 * math.prod(count + 1 for count in cells)
        solutions = 8 * steps if kind == "concurrent" else 2 * SOLUTIONS_OF_LAWS
        block = 10.0 * FACTORISATION * unknowns**1.5
        return START + block + solutions * whole
    unknowns = 3.0 * math.prod(count + 1 for count in cells)
    count = math.prod(scene.patches.grid)
    laws = SOLUTIONS_OF_LAWS * (SUMMITS * count if whole == SUMMITS else whole)
    return START + laws + BLOCK * unknowns * (1 + min(count, steps))
