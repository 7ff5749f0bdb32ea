"""Work of the contact problems of a run: solutions, laws and measured errors.

One solution costs what `micro.choice.cost` says. The constants here were measured on Set 1 of
Waddad et al. 2016 and on bands of 1 to 6 and 2 to 32 waves, on 64² to 512² heights.
"""

from __future__ import annotations

import numpy as np

from micro import HalfSpaceModel, ScaledModel
from micro.choice.cost import contact_box_share, solution_seconds
from multiscale.costs.work import Work
from multiscale.loading.stepper import LoadHistory
from multiscale.setup.problem import ProblemSetup

ROWS = {"cells": 56, "summits": 70}
"""Rows of a table of laws. Models of cells took 45 to 65, models of summits 60 to 150."""
_ERROR_CHECK = 1.5
"""Solutions that measuring the errors of a load step is worth; 0.5 to 2.5 were measured."""
_FINITE_SLOPES = 2.5
"""Factor of the work where finite slopes are taken into account."""
_BLOCK = 1.3
"""Factor of the work where the half-space has free sides and the correction of a body."""
_PATCH_SUMS = 4e-6
"""Time of a patch's sums in a row of consistent laws [s]."""


def solution_work(setup: ProblemSetup, *, one_patch: bool = False) -> Work:
    """Return the work of one solution of a scene's micro model, started from one nearby.

    Args:
        setup: The problem.
        one_patch: Whether only the surface of one patch is solved for.
    """
    model, cells = setup.model, setup.surface.heights.size
    if isinstance(model, HalfSpaceModel):
        cells = model.surface.heights.size
    summits = int(setup.interfering_summits.sum())
    if one_patch:
        cells //= setup.patches.count
        summits //= max(setup.interfering_patches, 1)
    kind = "scaled" if isinstance(model, ScaledModel) else model.name
    box = contact_box_share(setup.cell_interference)
    work = Work(arrays=solution_seconds(kind, cells, box=box, summits=summits))
    if one_patch or not isinstance(model, HalfSpaceModel):
        return work
    slopes = _FINITE_SLOPES if setup.finite_slopes else 1.0
    return slopes * (_BLOCK if setup.has_block else 1.0) * work


def law_work(setup: ProblemSetup) -> Work:
    """Return the work of tabulating the laws of a scene.

    Args:
        setup: The problem.
    """
    rows = ROWS["summits" if setup.uses_summits else "cells"]
    if setup.scene.coupling.kind == "isolated":
        return rows * setup.interfering_patches * solution_work(setup, one_patch=True)
    return rows * (solution_work(setup) + Work(arrays=_PATCH_SUMS * setup.patches.count))


def error_check_work(setup: ProblemSetup) -> Work:
    """Return the work of measuring the errors of one load step.

    Args:
        setup: The problem.
    """
    return (_ERROR_CHECK + float(setup.uses_laws)) * solution_work(setup)


def step_count(load_history: LoadHistory) -> int:
    """Return the number of load steps, as far as it is known before the run.

    Args:
        load_history: The loads, whose steps may be halved by a largest change of the force.
    """
    if load_history.force_change is None:
        return load_history.count
    halved = int(np.ceil(len(load_history.points) / load_history.force_change))
    return max(load_history.count, halved)
