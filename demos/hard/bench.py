"""What the hard cases have in common: the scene they change, how they are counted and listed."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from patchlaw.multiscale import History, Scene, run

Array = NDArray[np.float64]

CELLS, TABLES = 32, 1e-3
BASE: dict[str, dict[str, Any]] = {
    "surface": {
        "spectrum": {"hurst": 0.8, "waves": [2, 6], "rms_slope": 0.2, "seed": 2},
        "grid": [CELLS, CELLS],
        "lengths": ["1 mm", "1 mm"],
    },
    "block": {"young_modulus": "4 GPa", "poisson_ratio": 0.15, "cells": [6, 6, 4]},
    "patches": {"grid": [4, 4]},
    "micro": {"model": "half-space"},
    "load": {"approach": "8 um", "steps": 1},
    "output": {"check": "none"},  # each case has a witness of its own
}


@dataclass(frozen=True, slots=True)
class Count:
    """Work of something that is no history: one load step each."""

    newton: int = 0
    linear: int = 0
    contact: int = 0
    steps: int = 1

    @classmethod
    def of(cls, found: Any) -> Count:
        """Count a history, the state of an asperity model or of a dense Newton's method."""
        if isinstance(found, Count):
            return found
        if isinstance(found, History):
            linear = int(found.linear_iterations.sum())
            return cls(int(found.newton_iterations.sum()), linear, steps=len(found))
        return cls(int(found.iterations))


def lawless(found: History) -> Count:
    """Count what contacts without laws took: iterations of conjugate gradients, no Newton steps."""
    return Count(contact=int(found.newton_iterations.sum()), steps=len(found))


@dataclass(frozen=True, slots=True)
class Case:
    """A hard case: its number, what is hard, what must hold, how far off it may be, and its run."""

    number: int
    hard: str
    holds: str
    bound: float
    solve: Callable[[], tuple[Any, ...]]


CASES: list[Case] = []


def case(number: int, hard: str, holds: str, bound: float) -> Callable[[Any], Any]:
    """List a function that returns the error and everything that is to be counted."""

    def listed(solve: Any) -> Any:
        CASES.append(Case(number, hard, holds, bound, solve))
        return solve

    return listed


def solved(kind: str, **changes: Any) -> History:
    """Run the scene with a coupling and other values; see `scene`."""
    return run(scene(kind, **changes))


def scene(kind: str, **changes: Any) -> Scene:
    """Return the scene with a coupling and other values of ``section__key``; None takes one out."""
    coupling = {"kind": kind} | ({"table_tolerance": TABLES} if kind == "consistent" else {})
    data = deepcopy(BASE) | {"coupling": coupling}
    for key, value in changes.items():
        section, name = key.split("__")
        data.setdefault(section, {})[name] = value
        if value is None:
            del data[section][name]
    return Scene.from_dict(data)


def of_heights(heights: Array) -> dict[str, Any]:
    """Return what to change in the scene for the surface to be these heights."""
    path = Path(tempfile.mkdtemp()) / "heights.npy"
    np.save(path, heights)
    return {"surface__spectrum": None, "surface__grid": None, "surface__file": str(path)}


def off(found: Any, right: Any) -> float:
    """Return the largest relative difference of forces, of the last ones of two histories."""
    a, b = (one.force_N[-1] if isinstance(one, History) else one for one in (found, right))
    return float(np.max(np.abs(np.asarray(a) / np.asarray(b) - 1.0)))
