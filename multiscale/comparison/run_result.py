"""The result of one configuration: how its run ended, its curves, times and memory; its file.

The module is also the program of the process that a configuration is run in.
"""

from __future__ import annotations

import hashlib
import json
import resource
import sys
import time
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np

from geometry.collective import on_root
from geometry.errors import PatchlawError
from geometry.patches import PatchGrid
from multiscale.comparison.configuration import Configuration
from multiscale.comparison.error_measures import Curves
from multiscale.machine import world
from multiscale.results.history import History
from multiscale.run import Run
from multiscale.scene.scene import Scene
from multiscale.storage import write_json

Status = Literal["done", "not converged", "refused", "failed", "over budget", "not started"]

STATUS_OF_EXIT: dict[int, Status] = {0: "done", 2: "refused", 3: "not converged"}
"""Status by exit code of the process; every other exit code means ``failed``."""

_SMALL: dict[str, Any] = {
    "surface": {
        "spectrum": {"hurst": 0.9, "waves": [2, 4], "rms_slope": 0.1},
        "grid": [16, 16],
        "lengths": [1.0, 1.0],
    },
    "patches": {"grid": [2, 2]},
    "load": {"approach": 1e-3, "steps": 1},
}


@dataclass(frozen=True, kw_only=True)
class RunResult:
    """The result of one configuration, finished or not.

    Attributes:
        configuration: The configuration.
        status: How the run ended.
        exit_code: Exit code of its process; None when it was killed or never started.
        message: The text of the error; empty without one.
        seconds: Wall time of each phase [s].
        start_s: Wall time of everything else in the process: interpreter, imports, compiled
            forms [s].
        cpu_s: Processor time of the phases, of all ranks together [s].
        peak_MB: Largest memory in use, of all ranks together [MB]; NaN when unknown.
        unknowns: Degrees of freedom of the block that was pressed, where there is one.
        curves: The accepted load steps; None when there are none.
        finite_slopes: Whether the micro model, if any, accounts for finite slopes.
    """

    configuration: Configuration
    status: Status
    exit_code: int | None = None
    message: str = ""
    seconds: dict[str, float] = field(default_factory=dict)
    start_s: float = float("nan")
    cpu_s: float = float("nan")
    peak_MB: float = float("nan")
    unknowns: int | None = None
    curves: Curves | None = None
    finite_slopes: bool = False

    @property
    def done(self) -> bool:
        """Whether the whole load was run."""
        return self.status == "done" and self.curves is not None

    @property
    def is_repeatable(self) -> bool:
        """Whether running the configuration again would end in the same way."""
        return self.status in ("done", "refused", "not converged")


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
    run, failure = None, None
    start, start_cpu = time.perf_counter(), time.process_time()
    try:
        run = Run(configuration.scene, comm)
        for _ in run.load_steps():
            pass
    except PatchlawError as error:  # It is raised on all ranks.
        failure = error
    spent, cpu = time.perf_counter() - start, time.process_time() - start_cpu
    memory = _peak_megabytes()
    code = 0 if failure is None else failure.exit_code
    return RunResult(
        configuration=configuration,
        status=STATUS_OF_EXIT.get(code, "failed"),
        exit_code=code,
        message="" if failure is None else str(failure),
        seconds={} if run is None else dict(run.seconds),
        start_s=-spent,
        cpu_s=cpu if comm is None else sum(comm.allgather(cpu)),
        peak_MB=memory if comm is None else sum(comm.allgather(memory)),
        unknowns=None if run is None else run.unknowns,
        curves=None if run is None else _curves(run.history(), configuration.scale),
        finite_slopes=run is not None and run.setup.finite_slopes,
    )


def _curves(history: History, scale: float) -> Curves | None:
    """Return the curves of a history for comparison; None when it has no load step.

    An explicit reference gives its values at mesh size zero, with their errors. The patch pressures
    are those of its finest mesh, scaled to the force at mesh size zero.

    Args:
        history: The history.
        scale: Heights and load relative to those of the compared scene.
    """
    if not len(history):
        return None
    force, pressure = history.force_N, history.patch_pressure_MPa
    columns = {"approach": history.approach_mm, "force": force}
    columns["area"] = history.contact_area_fraction
    errors = dict.fromkeys(columns, np.full(len(history), np.nan))
    record = history.reference
    if record is not None:
        errors = {name: getattr(record, name).error for name in columns}
        columns = {name: getattr(record, name).value for name in columns}
        ones = np.ones_like(force)
        ratio = np.divide(columns["force"], force, out=ones, where=force > 0.0)
        pressure = pressure * ratio[:, None]
    curves = Curves(
        patches=history.patches,
        separation=history.mean_separation_mm,
        patch_pressure=pressure,
        **columns,
        **{f"{name}_error": error for name, error in errors.items()},
    )
    return curves.divided(scale)


def write_result(path: Path, result: RunResult) -> Path:
    """Write a result without its configuration as JSON, whole or not at all, with a checksum.

    Args:
        path: The file.
        result: The result.
    """
    content = {name: value for name, value in vars(result).items() if name != "configuration"}
    if result.curves is not None:
        curves = asdict(result.curves)
        patches = curves.pop("patches")
        content["curves"] = {name: array.tolist() for name, array in curves.items()}
        content["curves"]["patches"] = patches
    return write_json(path, {"sha256": _digest(content), "result": content})


def read_result(path: Path, configuration: Configuration) -> RunResult | None:
    """Read the result of a configuration; None when the file is missing or damaged.

    Args:
        path: The file.
        configuration: The configuration that it is the result of.
    """
    try:
        stored = json.loads(path.read_text(encoding="utf-8"))
        content = stored["result"]
        if stored["sha256"] != _digest(content):
            return None
        if content["curves"] is not None:
            grid = {name: tuple(value) for name, value in content["curves"].pop("patches").items()}
            arrays = {name: np.array(values, float) for name, values in content["curves"].items()}
            content["curves"] = Curves(patches=PatchGrid(**grid), **arrays)
        return RunResult(configuration=configuration, **content)
    except (OSError, ValueError, KeyError, TypeError, RecursionError, PatchlawError):
        return None


def _digest(content: Any) -> str:
    """Return the SHA-256 of what JSON can hold; numbers are the same after reading a file."""
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def main(request: Path) -> int:
    """Run the configuration that a request describes, and write its result.

    Args:
        request: JSON file with the fields of the configuration and the path of the result.

    Returns:
        0 done, 2 refused, 3 not converged.

    Note:
        Collective over all processes of the MPI job.
    """
    fields = json.loads(request.read_text(encoding="utf-8"))
    path = Path(fields.pop("path"))
    configuration = Configuration(**fields)
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
    content = scene.model_dump(by_alias=True, mode="json", exclude_none=True)
    block = {key: value for key, value in content["block"].items() if not key.startswith("margin")}
    reference: dict[str, Any] = {"method": scene.reference.method, "meshes": 1}
    if scene.reference.hexahedral:
        reference["cells"] = [4, 4, 4]
    block |= {"height": 1.0, "cells": [4, 4, 4]}
    try:
        small = Scene.from_dict(content | _SMALL | {"block": block, "reference": reference})
        for _ in Run(small, comm).load_steps():
            pass
    except PatchlawError:  # The configuration itself will report its error.
        return


def _peak_megabytes() -> float:
    """Return the largest resident memory of this process so far [MB].

    Linux counts the memory of the parent at the fork into ``ru_maxrss``. The high-water mark of
    the process itself starts with the program.
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
