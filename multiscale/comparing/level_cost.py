"""Predicts roughly what a level of a comparison costs: the cheapest are run first."""

from __future__ import annotations

import math

from multiscale.planning.micro_choice import SOLUTIONS_OF_LAWS
from multiscale.scene import Scene
from multiscale.stage_checks import block_cells, patch_grid

START = 0.05
"""Seconds for a surface and its summits."""

SUMMITS = 3e-3
"""Seconds of a solution by summits."""

CELL = 7e-7
"""Seconds of a half-space's solution, or one by islands, per height."""

ASSEMBLY = 1.5e-5
"""Seconds to mesh and assemble a block and its multigrid, per unknown."""

SOLUTION = 2.5e-6
"""Seconds of a load step, or of the compliance of a patch, per unknown."""

CORRECTION = 0.4
"""Seconds for the loads of the smooth rest of a block, with the fewest of them."""

FEWEST_LOADS = 16
"""Rectangles of load along a side, at least."""

FACTORISATION = 9e-7
"""Seconds to factorise and solve the smooth rest, per unknown to the power 3/2."""

REFERENCE = 2.5
"""Seconds of a load step on the finest mesh of the roughness, with the typical edge."""

TYPICAL_EDGE = 0.01
"""Edge of the finest tetrahedra that this was measured with [mm]."""

COARSER = 0.35
"""What each further mesh of the roughness costs, relative to the finest."""


def predicted_seconds(scene: Scene, heights: tuple[int, int]) -> float:
    """Return a rough wall time [s], good for an order of levels.

    Args:
        scene: The scene of the level.
        heights: Heights of its surface.
    """
    kind, model = scene.coupling.kind, scene.micro.model
    steps = scene.loading.programme.count
    if kind == "reference":
        fine = TYPICAL_EDGE / (scene.reference.fine or TYPICAL_EDGE)
        return REFERENCE * steps * fine**2 * (1.0 + COARSER * (scene.reference.meshes - 1))
    by_cells = model in ("half-space", "islands", "auto")
    whole = CELL * math.prod(heights) if by_cells else SUMMITS
    if kind == "analytic":
        return START + steps * whole
    unknowns = 3.0 * math.prod(count + 1 for count in block_cells(scene))
    if scene.coupling.decomposed:
        solutions = 8 * steps if kind == "concurrent" else 2 * SOLUTIONS_OF_LAWS
        sides = (count * -(-FEWEST_LOADS // count) for count in patch_grid(scene))
        loads = CORRECTION * (math.prod(sides) / FEWEST_LOADS**2) ** 2
        return START + loads + FACTORISATION * unknowns**1.5 + solutions * whole
    count = math.prod(patch_grid(scene))
    laws = SOLUTIONS_OF_LAWS * (whole if by_cells or kind == "consistent" else whole * count)
    return START + laws + unknowns * (ASSEMBLY + SOLUTION * min(count, steps))
