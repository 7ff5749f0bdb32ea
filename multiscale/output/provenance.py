"""What a result was made with and from."""

from __future__ import annotations

import math
import os
import platform
import sys
from collections.abc import Mapping
from dataclasses import asdict
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import numpy
import scipy

from multiscale.couplings.reference import ReferenceCoupling
from multiscale.machine.nodes import peak_memory
from multiscale.run import Run
from multiscale.setup.problem import ProblemSetup


def provenance(run: Run, *, options: list[str]) -> dict[str, Any]:
    """Collect versions, scene, options, times and convergence of a run.

    Args:
        run: The run, finished or stopped.
        options: PETSc options given by the user.

    Returns:
        A dictionary that JSON can hold; what is not known, or infinite, is None.
    """
    history = run.history()
    content = {
        "patchlaw": version("patchlaw"),
        "written": datetime.now(UTC).isoformat(timespec="seconds"),
        "scene_file": run.scene.file,
        "scene": run.scene.model_dump(by_alias=True, mode="json"),
        "scene_given": run.given.model_dump(by_alias=True, mode="json"),
        "units": "mm, N, MPa",
        "surface": {
            "source": run.setup.surface.source,
            "heights_sha256": run.heights,
            "highest_mm": run.setup.surface.highest,
            "summits": run.setup.asperities.count,
            "summits_in_reach": int(run.setup.interfering_summits.sum()),
            "border_maxima_in_reach": run.setup.interfering_border_maxima,
        },
        "micro_model": _micro_model(run.setup),
        "ranks": 1 if run.comm is None else run.comm.size,
        "threads": os.environ.get("OMP_NUM_THREADS"),
        "petsc_options": options,
        "unknowns": run.unknowns,
        "reference": _reference(run),
        "seconds": history.seconds,
        "memory_bytes": peak_memory(),
        "errors_N": [dict(step.errors) for step in history],
        "decision": _decision(run.setup),
        "steps": len(history),
        "finished": run.finished,
        "reasons": sorted(set(history.reason)) if len(history) else [],
        "notes": list(history.notes),
        "versions": _versions(),
        "machine": platform.platform(),
    }
    return {name: _known(value) for name, value in content.items()}


def _known(value: Any) -> Any:
    """Return a value with None for what is not finite, which is no JSON."""
    if isinstance(value, Mapping):
        return {name: _known(part) for name, part in value.items()}
    if isinstance(value, list | tuple):
        return [_known(part) for part in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _decision(setup: ProblemSetup) -> dict[str, Any] | None:
    """Return what open keys became out of what, where an accuracy decided."""
    decision = setup.decision
    return None if decision is None else {**asdict(decision), "kept": decision.kept}


def _reference(run: Run) -> dict[str, Any] | None:
    """Return what a reference's meshes are and found, where there are any."""
    record, coupling = run.history().reference, run.coupling
    if record is None or not isinstance(coupling, ReferenceCoupling):
        return None
    return {
        "method": run.scene.reference.method,
        "sizes_mm": record.sizes.tolist(),
        "unknowns": record.unknowns,
        "active_sets": [step.newton_iterations for step in run.steps],
        "force_rate": record.force.rate.tolist(),
        "area_rate": record.area.rate.tolist(),
        "error": record.label,
        "mesh_quality": [asdict(quality) for quality in coupling.qualities],
    }


def _micro_model(setup: ProblemSetup) -> dict[str, Any] | None:
    """Return the micro model used and, when it was chosen, from what."""
    if setup.micro is None:
        return None
    if setup.choice is None:
        return {"name": setup.model.name}
    return {
        "name": setup.model.name,
        "chosen": asdict(setup.choice.taken),
        "candidates": [asdict(candidate) for candidate in setup.choice.candidates],
    }


def _versions() -> dict[str, str]:
    """Return the versions of what took part; compiled parts only when they were loaded."""
    found = {
        "python": platform.python_version(),
        "numpy": numpy.__version__,
        "scipy": scipy.__version__,
    }
    for name in ("dolfinx", "petsc4py", "mpi4py", "gmsh"):
        module = sys.modules.get(name)
        if module is not None:
            found[name] = str(getattr(module, "__version__", "unknown"))
    for name in ("h5py", "pydantic", "pint", "matplotlib"):
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "unknown"
    return found
