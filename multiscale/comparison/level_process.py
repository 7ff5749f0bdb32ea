"""Runs one level of a comparison, as a process of its own."""

from __future__ import annotations

import json
import resource
import sys
import time
from pathlib import Path
from typing import Any

from geometry.collective import on_root
from geometry.errors import PatchlawError
from multiscale.comparison.level_results import STATUS_OF_EXIT, LevelResult, curves_of, write_result
from multiscale.machine.mpi_job import world
from multiscale.run import Run
from multiscale.scene.scene import Scene

_SMALL: dict[str, Any] = {
    "surface": {
        "spectrum": {"hurst": 0.9, "waves": [2, 4], "rms_slope": 0.1},
        "grid": [16, 16],
        "lengths": [1.0, 1.0],
    },
    "patches": {"grid": [2, 2]},
    "load": {"approach": 1e-3, "steps": 1},
}


def main(request: Path) -> int:
    """Run the level that a request describes, and write its result.

    Args:
        request: JSON file with the level's scene, its key, and where the result goes.

    Returns:
        0 done, 2 refused, 3 not converged.

    Note:
        Collective over all processes of the MPI job.
    """
    asked = json.loads(request.read_text(encoding="utf-8"))
    scene = Scene.from_dict(asked["scene"])
    comm = None
    if scene.coupling.kind != "analytic":  # the micro model alone needs neither MPI nor elements
        comm = world()
    _rehearse(scene, comm)
    result = level_result(scene, comm, key=asked["key"])
    on_root(comm, lambda: write_result(Path(asked["result"]), result))
    return result.exit_code or 0


def level_result(scene: Scene, comm: Any, *, key: str) -> LevelResult:
    """Run a level in this process.

    Args:
        scene: Its scene.
        comm: MPI communicator; None for this process alone.
        key: Its hash.

    Note:
        Collective.
    """
    run, failure = None, None
    began, worked = time.perf_counter(), time.process_time()
    try:
        run = Run(scene, comm)
        for _ in run.load_steps():
            pass
    except PatchlawError as error:  # on all ranks
        failure = error
    spent, worked = time.perf_counter() - began, time.process_time() - worked
    memory = _peak_megabytes()
    code = 0 if failure is None else failure.exit_code
    return LevelResult(
        key=key,
        status=STATUS_OF_EXIT.get(code, "failed"),
        exit_code=code,
        message="" if failure is None else str(failure),
        seconds={} if run is None else dict(run.seconds),
        start_s=-spent,  # whoever started the process adds its whole wall time
        cpu_s=worked if comm is None else sum(comm.allgather(worked)),
        peak_MB=memory if comm is None else sum(comm.allgather(memory)),
        unknowns=None if run is None else run.unknowns,
        curves=None if run is None else curves_of(run.history()),
        finite_slopes=run is not None and run.setup.finite_slopes,
    )


def _rehearse(scene: Scene, comm: Any) -> None:
    """Run the same coupling in small: imports and compiled forms are no part of a level's time."""
    content = scene.model_dump(by_alias=True, mode="json", exclude_none=True)
    block = {key: value for key, value in content["block"].items() if not key.startswith("margin")}
    reference: dict[str, Any] = {"method": scene.reference.method, "meshes": 1}
    if scene.reference.hexahedral:
        reference["cells"] = [4, 4, 4]
    small = content | _SMALL | {"block": block | {"height": 1.0, "cells": [4, 4, 4]}}
    small |= {"reference": reference}
    try:
        for _ in Run(Scene.from_dict(small), comm).load_steps():
            pass
    except PatchlawError:  # the level itself will tell
        return


def _peak_megabytes() -> float:
    """Return the largest resident memory of this process so far [MB].

    Linux counts what the parent had at the fork into ``ru_maxrss``; its own high-water mark
    starts with the program.
    """
    try:
        status = Path("/proc/self/status").read_text(encoding="utf-8")
        marks = [line.split() for line in status.splitlines() if line.startswith("VmHWM")]
        return float(marks[0][1]) / 1024.0
    except (OSError, IndexError):
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        return peak / (2.0**20 if sys.platform == "darwin" else 1024.0)


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
