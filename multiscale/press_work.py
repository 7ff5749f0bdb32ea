"""Counts the work of micro models: presses of the whole surface, and how many a run takes.

Counts are measured ones, on Set 1 of Waddad et al. 2016 and on bands of 1 to 6 and 2 to 32 waves,
64² to 512² heights, 2 to 20 µm of approach: times of single presses over the rates of the machine
that they were measured on. They hold within a factor of 1.5.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from micro import HalfSpaceModel, ScaledModel
from micro.islands import IslandModel
from multiscale.work import Work

if TYPE_CHECKING:  # which is made with what is said here
    from multiscale.stage import Stage

_LOADS = (0.25, 0.5, 0.75, 1.0)
"""Loads, relative to the largest, whose mean stands for those of a run."""

ROWS = {"cells": 56, "summits": 70}
"""Rows of a table of laws: 45 to 65, and 60 to 150 where the model sees summits."""

PRESSES = {"approach": 5.2, "force": 7.6, "free": 10.0}
"""Presses of the fine model that a load step of the concurrent coupling takes, the last one, which
sums over the patches, included: where the approach, the force, or neither tilt is prescribed."""

_MANY_STEPS = 24
"""Load steps beyond which each takes a press less, for it starts near."""


def box_cells(stage: Stage, cells: tuple[int, int]) -> float:
    """Return the cells of the box around what the plane reaches, in the mean over loads.

    That is the part of a half-space grid that is solved on.

    Args:
        stage: The scene's ingredients.
        cells: Cells of the grid in x and y.
    """
    surface, (end, tilt) = stage.surface, stage.furthest
    dx, dy = surface.x - 0.5 * surface.lengths[0], surface.y - 0.5 * surface.lengths[1]
    lean = tilt[0] * dx[:, None] + tilt[1] * dy
    overlap = end + lean - (surface.highest - surface.heights)
    deepest = float(overlap.max())
    shares = []
    for load in _LOADS:
        i, j = np.nonzero(overlap > (1.0 - load) * deepest)
        shares.append((np.ptp(i) + 1) * (np.ptp(j) + 1) if i.size else 0)
    scale = float(np.prod(cells)) / surface.heights.size
    return max(float(np.mean(shares)) * scale, 1.0)


def press_work(stage: Stage, *, sagging: bool) -> Work:
    """Return the work of one press of a scene's micro model, started from one nearby.

    Args:
        stage: The scene's ingredients.
        sagging: Whether the plane sags as the block does, and forces are gathered on rectangles.
    """
    model, heights = stage.model, stage.surface.heights.size
    if isinstance(model, HalfSpaceModel):
        cells = int(np.prod(model.surface.grid))
        padded = 4.0 * box_cells(stage, model.surface.grid)
        # 20 to 30 iterations of a product and a preconditioner, on a box of twice the sides
        solved = Work(call=12_000, passes=60.0 * cells, transform=75.0 * padded * np.log2(padded))
        return solved + Work(call=9_000, passes=50.0 * cells) * sagging
    if isinstance(model, IslandModel):
        around = Work(call=700_000, passes=2_000.0 * heights)
        return around if sagging else Work(call=60_000, passes=80.0 * heights)
    reached = int(stage.reached.sum())
    each = Work(call=4_000 + 50 * reached, function=40.0 * reached**2)
    if isinstance(model, ScaledModel):
        return Work(call=70_000) + each if sagging else Work(call=18_000) + each
    return Work(call=12_000) + each if sagging else each


def law_work(stage: Stage) -> Work:
    """Return the work of tabulating the laws of a scene.

    Args:
        stage: The scene's ingredients.
    """
    rows = ROWS["summits" if stage.by_summits else "cells"]
    if stage.scene.coupling.kind == "isolated":
        alone = press_work(stage, sagging=False)
        return (1.5 * rows * stage.reached_patches / stage.patches.count) * alone + (
            rows * stage.reached_patches
        ) * Work(call=3_000)
    decomposed = stage.scene.coupling.decomposed
    once = bent = press_work(stage, sagging=False)
    if stage.by_summits:  # rows follow each other closely
        bent = 0.5 * press_work(stage, sagging=True)
    elif decomposed:
        bent = press_work(stage, sagging=True) + Work(call=-5_000)
    # every row is pressed level, and once more by a plane that sags as the block does
    each = once + bent if decomposed else once
    return rows * (each + Work(call=15 * stage.patches.count))


def step_count(stage: Stage) -> int:
    """Return the number of load steps, as far as it is known before.

    Args:
        stage: The scene's ingredients.
    """
    programme = stage.scene.loading.programme
    steps = len(programme.targets)
    if programme.force_change is None:
        return steps
    return max(steps, int(np.ceil(len(programme.points) / programme.force_change)))


def presses(stage: Stage) -> float:
    """Return the presses of the concurrent coupling over all load steps.

    Args:
        stage: The scene's ingredients.
    """
    programme, steps = stage.scene.loading.programme, step_count(stage)
    how = "free" if programme.tilt is None else programme.quantity
    few = min(steps, _MANY_STEPS)
    return PRESSES[how] * few + (PRESSES[how] - 1.0) * (steps - few)
