"""The program of the process that a configuration is run in."""

from __future__ import annotations

import sys
import time
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from geometry.patches import PatchGrid
from multiscale.comparison.configuration import (
    Configuration,
    Curves,
    RunResult,
    Status,
    read_result,
    write_result,
)
from multiscale.comparison.scene_content import content_of
from multiscale.machine import peak_memory, world
from multiscale.results.history import History
from multiscale.run import Run
from multiscale.scene.scene import Scene
from support.collective import on_root
from support.errors import PatchlawError

STATUS_OF_EXIT: dict[int, Status] = {0: "done", 2: "refused", 3: "not converged"}
"""Status by exit code of the process; every other exit code means ``failed``."""


def main(path: Path) -> int:
    """Run a configuration, and write its result.

    Args:
        path: File of a result, of which only the configuration is read, and which is replaced.

    Returns:
        0 done, 1 for a damaged file, 2 refused, 3 not converged.

    Note:
        Collective over all processes of the MPI job.
    """
    request = read_result(path)
    if request is None:
        return 1
    configuration = request.configuration
    # The micro model alone needs neither MPI nor finite elements.
    comm = None if configuration.kind == "analytic" else world()
    _warm_up(configuration.scene, comm)
    result = run_here(configuration, comm)
    on_root(comm, lambda: write_result(path, result))
    return result.exit_code or 0


def _warm_up(scene: Scene, comm: Any) -> None:
    """Run a small scene with the same coupling.

    The time of a configuration shall contain neither imports nor the compilation of forms.
    """
    content, cells = content_of(scene), [4, 4, 4]
    hexahedra = {"cells": cells} if scene.reference.hexahedral else {}
    content |= {
        "surface": {
            "spectrum": {"hurst": 0.9, "waves": [2, 4], "rms_slope": 0.1},
            "grid": [16, 16],
            "lengths": [1.0, 1.0],
        },
        "block": content["block"] | {"height": 1.0, "cells": cells, "margin": 0.0},
        "patches": {"grid": [2, 2]},
        "reference": {"method": scene.reference.method, "meshes": 1} | hexahedra,
        "load": {"approach": 1e-3, "steps": 1},
    }
    with suppress(PatchlawError):  # The configuration itself will report its error.
        for _ in Run(Scene.from_dict(content), comm).load_steps():
            pass


def run_here(configuration: Configuration, comm: Any = None) -> RunResult:
    """Run a configuration in this process.

    Args:
        configuration: The configuration.
        comm: MPI communicator; None for this process alone.

    Returns:
        The result; its `start_s` is minus the time of the run, as the caller adds the wall time
        of the whole process.

    Note:
        Collective.
    """
    run, code, message = None, 0, ""
    start, start_cpu = time.perf_counter(), time.process_time()
    try:
        run = Run(configuration.scene, comm)
        for _ in run.load_steps():
            pass
    except PatchlawError as error:  # It is raised on all ranks.
        code, message = error.exit_code, str(error)
    spent, own = time.perf_counter() - start, (time.process_time() - start_cpu, peak_memory())
    cpu, memory = own if comm is None else map(comm.allreduce, own)
    result = RunResult(
        configuration=configuration,
        status=STATUS_OF_EXIT.get(code, "failed"),
        exit_code=code,
        message=message,
        start_s=-spent,
        cpu_s=cpu,
        peak_MB=memory / 1e6,
    )
    if run is None:
        return result
    return replace(
        result,
        phases=run.clock.times,
        unknowns=run.unknowns,
        curves=_curves(run.history(), configuration.scale),
        finite_slopes=configuration.kind == "reference" or run.coupling.finite_slopes,
    )


def _curves(history: History, scale: float) -> Curves:
    """Return the curves of a history for comparison.

    An explicit reference gives its values at mesh size zero, with their errors. The patch pressures
    are those of its finest mesh, scaled to the force at mesh size zero.

    Args:
        history: The history.
        scale: Heights and load relative to those of the compared scene.
    """
    record, pressure = history.reference, history.patch_pressure_MPa
    names, unknown = ("approach", "force", "area"), np.full(len(history), np.nan)
    if record is None:
        values = history.approach_mm, history.force_N, history.contact_area_fraction
        errors = unknown, unknown, unknown
    else:
        estimates = record.approach, record.force, record.area
        values, errors = zip(*((one.value, one.error) for one in estimates), strict=True)
        finest, ratio = history.force_N, np.ones(len(history))
        np.divide(values[1], finest, out=ratio, where=finest > 0.0)
        pressure = pressure * ratio[:, None]
    assert isinstance(history.patches, PatchGrid)
    curves = Curves(
        patches=history.patches,
        separation=history.mean_separation_mm,
        patch_pressure=pressure,
        **dict(zip(names, values, strict=True)),
        **{f"{name}_error": error for name, error in zip(names, errors, strict=True)},
    )
    return curves.divided(scale)


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
