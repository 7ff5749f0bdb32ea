"""Runs a scene as in a process of its own, and measures what it takes."""

from __future__ import annotations

import math
import os
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from typing import Any

import numpy as np

from patchlaw.geometry.patches import PatchGrid
from patchlaw.multiscale.inputs.cost import MemoryLacking
from patchlaw.multiscale.readable import duration
from patchlaw.multiscale.results.history import History
from patchlaw.multiscale.scene.scene import Scene
from patchlaw.multiscale.scene_run import Run
from patchlaw.multiscale.studies.configurations import Configuration
from patchlaw.multiscale.studies.running import CaseResult, run_case
from patchlaw.support.collective import on_root
from patchlaw.support.errors import InputError, NotConverged, PatchlawError

_CACHE = "PATCHLAW_CACHE"
_SMALL = {"spectrum": {"hurst": 0.9, "waves": [2, 4], "rms_slope": 0.1}, "grid": [16, 16]}


class _OverBudget(Exception):
    """The time of a run is over."""


def measured_run(one: Configuration, comm: Any = None, seconds: float = math.inf) -> CaseResult:
    """Run a configuration from nothing: no earlier run has made anything that it takes.

    Args:
        one: The configuration.
        comm: MPI communicator; None for this process alone.
        seconds: Wall time after which the run is ended, at the next load step or, of a process on
            its own, sooner [s].

    Returns:
        The result on every rank. `CaseResult.measured` has wall time by phase [s], ``phases``;
        degrees of freedom of the block, ``unknowns``; ``finite_slopes``; processor time of all
        ranks together [s], ``cpu_s``; ``exit_code``. `CaseResult.arrays` are its curves, see
        `_described`.

    Note:
        Collective.
    """
    end, code = time.monotonic() + seconds, 0

    def check() -> None:
        if on_root(comm, lambda: time.monotonic() > end):
            raise _OverBudget

    with _fresh(one.scene, comm):
        start = time.process_time()
        try:
            result = run_case(one.scene, comm, progress=check, describe=_described)
            code = NotConverged.exit_code if result.failure else 0
        except _OverBudget:
            why = f"ended after {duration(seconds)}, which was what the budget left"
            return CaseResult(status="over budget", failure=why)
        except MemoryLacking as error:
            return CaseResult(status="not started", failure=str(error))
        except Exception as error:
            if comm is not None and not isinstance(error, PatchlawError):
                raise  # it need not be raised on all ranks
            code = getattr(error, "exit_code", 1)
            status = "refused" if isinstance(error, InputError) else "failed"
            result = CaseResult(status=status, failure=str(error) or type(error).__name__)
    cpu = time.process_time() - start
    more = {"cpu_s": cpu if comm is None else comm.allreduce(cpu), "exit_code": code}
    result = replace(result, measured={**result.measured, **more})
    return result if comm is None else comm.bcast(result, root=0)


@contextmanager
def _fresh(scene: Scene, comm: Any) -> Iterator[None]:
    """Forget what earlier runs have made, but for imports and compiled forms.

    A small scene with the same coupling brings these, so that no run waits for them.
    """
    before = os.environ.get(_CACHE)
    os.environ[_CACHE] = "off"
    ours = ("patchlaw.micro.", "patchlaw.macro.")
    for name in [name for name in sys.modules if name.startswith(ours)]:
        for one in vars(sys.modules[name]).values():
            if clear := getattr(one, "cache_clear", None):
                clear()
    try:
        with suppress(PatchlawError):  # the scene itself will report its error
            run_case(_small(scene), comm)
        yield
    finally:
        os.environ.pop(_CACHE) if before is None else os.environ.update({_CACHE: before})


def _small(scene: Scene) -> Scene:
    """Return a small scene with the same coupling, micro model and kind of meshes."""
    content = scene.to_dict(whole=False)
    return Scene.from_dict(content | {
        "surface": {**_SMALL, "lengths": [1.0, 1.0]},
        "block": content["block"] | {"height": 1.0, "cells": [4, 4, 4], "margin": 0.0},
        "patches": {"grid": [2, 2]},
        "reference": {"method": scene.reference.method, "meshes": 1},
        "load": {"approach": 1e-3, "steps": 1},
    })  # fmt: skip


def _described(run: Run, history: History) -> dict[str, Any]:
    """Return what is measured of a run, and its curves over the load steps.

    These are ``approach`` [mm], ``force`` [N], ``area`` fraction, mean ``separation`` [mm], shape
    (steps,); ``patch_pressure``, shape (steps, patches) [MPa]; ``approach_error`` and so on, NaN
    where unknown; ``patches``, their numbers along x and y. An explicit reference gives its values
    at mesh size zero, with their errors. The patch pressures are those of its finest mesh, scaled
    to the force at mesh size zero.
    """
    record, pressure = history.reference, history.patch_pressure_MPa
    assert isinstance(history.patches, PatchGrid)
    curves = {
        "approach": history.approach_mm,
        "force": history.force_N,
        "area": history.contact_area_fraction,
        "separation": history.mean_separation_mm,
        "patches": np.array(history.patches.grid),
    }
    for name in ("approach", "force", "area"):
        estimate = getattr(record, name, None)
        unknown = np.full(len(history), np.nan)
        curves[f"{name}_error"] = unknown if estimate is None else estimate.error
        curves[name] = curves[name] if estimate is None else estimate.value
    if record is not None:
        ratio = np.ones(len(history))
        np.divide(curves["force"], history.force_N, out=ratio, where=history.force_N > 0.0)
        pressure = pressure * ratio[:, None]
    finite_slopes = run.coupling.meshes_roughness or bool(run.coupling.finite_slopes)
    return {
        "measured": {
            "phases": run.clock.times,
            "unknowns": run.coupling.unknowns,
            "finite_slopes": finite_slopes,
        },
        "arrays": curves | {"patch_pressure": pressure},
    }
