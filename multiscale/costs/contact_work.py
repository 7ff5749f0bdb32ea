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
from multiscale.costs.work import Work
from multiscale.loading.stepper import LoadHistory
from multiscale.setup.problem import ProblemSetup

_LOADS = (0.25, 0.5, 0.75, 1.0)
"""Loads, relative to the largest, whose mean stands for those of a run."""

ROWS = {"cells": 56, "summits": 70}
"""Rows of a table of laws: 45 to 65, and 60 to 150 where the model sees summits."""

_CHECK = 1.5
"""Load steps that measuring the errors of one takes as long as: 0.5 to 2.5."""
_SLOPES = 2.5
"""Times more work where finite slopes are seen."""
_BODY = 1.3
"""And where the half-space has free sides and a body."""


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
    largest_interference = float(overlap.max())
    boxes = []
    for load in _LOADS:
        i, j = np.nonzero(overlap > (1.0 - load) * largest_interference)
        touched = i.size and largest_interference > 0.0
        boxes.append(float((np.ptp(i) + 1) * (np.ptp(j) + 1)) if touched else 1.0)
    size = surface.heights.size
    return Reach(heights=size, box=float(np.mean(boxes)) / size, summits=summits)


def kind_work(kind: str, cells: int, at: Reach) -> Work:
    """Return the work of one press of a micro model, started from one nearby.

    Args:
        kind: Its name; ``scaled`` for asperities at the scale of the contact.
        cells: Cells of its grid, for ``half-space``.
        at: What the plane reaches.
    """
    if kind == "half-space":
        padded = 4.0 * max(at.box * cells, 1.0)
        # 20 to 30 iterations of a product and a preconditioner, on a box of twice the sides
        transforms = 75.0 * padded * np.log2(padded)
        return Work(call=12_000, passes=60.0 * cells, transform=float(transforms))
    if kind == "islands":
        return Work(call=60_000, passes=80.0 * at.heights)
    each = Work(call=4_000 + 50 * at.summits, function=40.0 * at.summits**2)
    if kind == "scaled":
        return Work(call=18_000) + each
    return each


def press_work(setup: ProblemSetup, *, alone: bool = False) -> Work:
    """Return the work of one press of a scene's micro model, started from one nearby.

    Args:
        setup: The scene's ingredients.
        alone: Whether one of the patches is pressed by itself.
    """
    model, cells = setup.model, 0
    kind = "scaled" if isinstance(model, ScaledModel) else model.name
    if isinstance(model, HalfSpaceModel):
        cells = int(np.prod(model.surface.grid))
    at = reach(setup.surface, setup.plane_at_largest_load, int(setup.interfering_summits.sum()))
    if alone:  # on the piece of the surface that is the patch
        cells //= setup.patches.count
        heights = at.heights // setup.patches.count
        at = replace(at, heights=heights, summits=at.summits // max(setup.interfering_patches, 1))
    work = kind_work(kind, cells, at)
    if alone:
        return work
    work = _SLOPES * work if setup.finite_slopes else work
    return _BODY * work if setup.has_block and cells else work


def check_work(setup: ProblemSetup) -> Work:
    """Return the work of measuring the errors of a load step.

    Args:
        setup: The scene's ingredients.
    """
    solved = _CHECK + (1.0 if setup.uses_laws else 0.0)
    return solved * press_work(setup)


def law_work(setup: ProblemSetup) -> Work:
    """Return the work of tabulating the laws of a scene.

    Args:
        setup: The scene's ingredients.
    """
    rows = ROWS["summits" if setup.uses_summits else "cells"]
    if setup.scene.coupling.kind == "isolated":
        return rows * setup.interfering_patches * press_work(setup, alone=True)
    return rows * (press_work(setup) + Work(call=15 * setup.patches.count))


def step_count(load_history: LoadHistory) -> int:
    """Return the number of load steps, as far as it is known before.

    Args:
        load_history: What the plane is made to do.
    """
    steps = load_history.count
    if load_history.force_change is None:
        return steps
    return max(steps, int(np.ceil(len(load_history.points) / load_history.force_change)))
