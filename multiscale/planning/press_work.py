"""Counts the work of micro models: presses of the whole surface, and how many a run takes.

Counts are measured ones, on Set 1 of Waddad et al. 2016 and on bands of 1 to 6 and 2 to 32 waves,
64² to 512² heights, 2 to 20 µm of approach: times of single presses over the rates of the machine
that they were measured on. They hold within a factor of 1.5.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from geometry.surface import Surface
from micro import HalfSpaceModel, ScaledModel
from multiscale.couplings.blocks import free_sides
from multiscale.loading import Programme
from multiscale.planning.work import Work
from multiscale.stage import Stage

_LOADS = (0.25, 0.5, 0.75, 1.0)
"""Loads, relative to the largest, whose mean stands for those of a run."""

ROWS = {"cells": 56, "summits": 70}
"""Rows of a table of laws: 45 to 65, and 60 to 150 where the model sees summits."""

PRESSES = {"approach": 5.2, "force": 7.6, "free": 10.0}
"""Presses of the fine model that a load step of the concurrent coupling takes, the last one, which
sums over the patches, included: where the approach, the force, or neither tilt is prescribed."""

_BESIDE = 2.0
"""Times more work where the half-space takes free sides into account: 1.5 to 2.9 were measured."""

_MANY_STEPS = 24
"""Load steps beyond which each takes a press less, for it starts near."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Reach:
    """What a plane reaches of a surface, for the work of pressing it.

    Attributes:
        heights: Heights of the surface.
        box: Part of the surface in the box around what the plane reaches, in the mean over loads.
        summits: Summits within the largest approach.
    """

    heights: int
    box: float
    summits: int


def reach(surface: Surface, plane: tuple[float, tuple[float, float]], summits: int) -> Reach:
    """Measure what a plane reaches; the box is the part of a grid that a half-space is solved on.

    Args:
        surface: The surface.
        plane: Largest approach at the middle [mm] and slopes.
        summits: Summits within it.
    """
    end, tilt = plane
    dx, dy = surface.x - 0.5 * surface.lengths[0], surface.y - 0.5 * surface.lengths[1]
    overlap = end + tilt[0] * dx[:, None] + tilt[1] * dy - (surface.highest - surface.heights)
    deepest = float(overlap.max())
    boxes = []
    for load in _LOADS:
        i, j = np.nonzero(overlap > (1.0 - load) * deepest)
        touched = i.size and deepest > 0.0
        boxes.append(float((np.ptp(i) + 1) * (np.ptp(j) + 1)) if touched else 1.0)
    size = surface.heights.size
    return Reach(heights=size, box=float(np.mean(boxes)) / size, summits=summits)


def kind_work(kind: str, cells: int, at: Reach, *, sagging: bool) -> Work:
    """Return the work of one press of a micro model, started from one nearby.

    Args:
        kind: Its name; ``scaled`` for asperities at the scale of the contact.
        cells: Cells of its grid, for ``half-space``.
        at: What the plane reaches.
        sagging: Whether the plane sags as the block does, and forces are gathered on rectangles.
    """
    if kind == "half-space":
        padded = 4.0 * max(at.box * cells, 1.0)
        # 20 to 30 iterations of a product and a preconditioner, on a box of twice the sides
        transforms = 75.0 * padded * np.log2(padded)
        solved = Work(call=12_000, passes=60.0 * cells, transform=float(transforms))
        return solved + Work(call=9_000, passes=50.0 * cells) * sagging
    if kind == "islands":
        around = Work(call=700_000, passes=2_000.0 * at.heights)
        return around if sagging else Work(call=60_000, passes=80.0 * at.heights)
    each = Work(call=4_000 + 50 * at.summits, function=40.0 * at.summits**2)
    if kind == "scaled":
        return Work(call=70_000) + each if sagging else Work(call=18_000) + each
    return Work(call=12_000) + each if sagging else each


def press_work(stage: Stage, *, sagging: bool, alone: bool = False) -> Work:
    """Return the work of one press of a scene's micro model, started from one nearby.

    Args:
        stage: The scene's ingredients.
        sagging: Whether the plane sags as the block does, and forces are gathered on rectangles.
        alone: Whether one of the patches is pressed by itself.
    """
    model, cells = stage.model, 0
    kind = "scaled" if isinstance(model, ScaledModel) else model.name
    if isinstance(model, HalfSpaceModel):
        cells = int(np.prod(model.surface.grid))
    at = reach(stage.surface, stage.furthest, int(stage.reached.sum()))
    if alone:  # on the piece of the surface that is the patch
        cells //= stage.patches.count
        heights = at.heights // stage.patches.count
        at = replace(at, heights=heights, summits=at.summits // max(stage.reached_patches, 1))
    work = kind_work(kind, cells, at, sagging=sagging)
    return work if alone or free_sides(stage) is None else _BESIDE * work


def law_work(stage: Stage) -> Work:
    """Return the work of tabulating the laws of a scene.

    Args:
        stage: The scene's ingredients.
    """
    rows = ROWS["summits" if stage.by_summits else "cells"]
    if stage.scene.coupling.kind == "isolated":
        return rows * stage.reached_patches * press_work(stage, sagging=False, alone=True)
    decomposed = stage.scene.coupling.decomposed
    once = bent = press_work(stage, sagging=False)
    if stage.by_summits:  # rows follow each other closely
        bent = 0.5 * press_work(stage, sagging=True)
    elif decomposed:
        bent = press_work(stage, sagging=True) + Work(call=-5_000)
    # every row is pressed level, and once more by a plane that sags as the block does
    each = once + bent if decomposed else once
    return rows * (each + Work(call=15 * stage.patches.count))


def step_count(programme: Programme) -> int:
    """Return the number of load steps, as far as it is known before.

    Args:
        programme: What the plane is made to do.
    """
    steps = programme.count
    if programme.force_change is None:
        return steps
    return max(steps, int(np.ceil(len(programme.points) / programme.force_change)))


def presses(programme: Programme) -> float:
    """Return the presses of the concurrent coupling over all load steps.

    Args:
        programme: What the plane is made to do.
    """
    steps = step_count(programme)
    how = "free" if programme.tilt is None else programme.quantity
    few = min(steps, _MANY_STEPS)
    return PRESSES[how] * few + (PRESSES[how] - 1.0) * (steps - few)
