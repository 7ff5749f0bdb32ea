"""The provenance of a result: versions, scene, options, times and convergence."""

from __future__ import annotations

import math
import os
import platform
import sys
from collections.abc import Mapping
from dataclasses import asdict
from datetime import UTC, datetime
from importlib.metadata import version
from typing import Any

from multiscale.couplings.reference import ReferenceCoupling
from multiscale.machine import peak_memory
from multiscale.run import Run
from multiscale.setup.problem import ProblemSetup

LIBRARIES = (
    "numpy", "scipy", "dolfinx", "petsc4py", "mpi4py", "gmsh", "h5py", "pydantic", "pint",
    "matplotlib",
)  # fmt: skip
"""Libraries whose versions are recorded."""


def provenance(run: Run, *, options: list[str]) -> dict[str, Any]:
    """Collect versions, scene, options, times and convergence of a run.

    Args:
        run: The run, finished or stopped.
        options: PETSc options given by the user.

    Returns:
        A dictionary that JSON can hold; what is unknown or infinite is None.
    """
    history, setup = run.history(), run.setup
    content = {
        "patchlaw": version("patchlaw"),
        "written": datetime.now(UTC).isoformat(timespec="seconds"),
        "scene_file": run.scene.file,
        "scene": run.scene.model_dump(by_alias=True, mode="json"),
        "scene_given": run.given.model_dump(by_alias=True, mode="json"),
        "units": "mm, N, MPa",
        "surface": {
            "source": setup.surface.source,
            "notes": list(setup.surface.notes),
            "heights_sha256": run.heights,
            "highest_mm": setup.surface.highest,
            "summits": setup.asperities.count,
            "summits_in_reach": int(setup.interfering_summits.sum()),
            "border_maxima_in_reach": setup.interfering_border_maxima,
        },
        "micro_model": _micro_model(setup),
        "ranks": 1 if run.comm is None else run.comm.size,
        "threads": os.environ.get("OMP_NUM_THREADS"),
        "petsc_options": options,
        "unknowns": run.unknowns,
        "reference": _reference(run),
        "seconds": history.seconds,
        "memory_bytes": peak_memory(),
        "errors_N": [dict(step.errors) for step in history],
        "decision": setup.decision and {**asdict(setup.decision), "kept": setup.decision.kept},
        "steps": len(history),
        "finished": run.finished,
        "reasons": sorted({step.reason for step in history}),
        "notes": list(history.notes),
        "versions": _versions(),
        "machine": platform.platform(),
    }
    return {name: _for_json(value) for name, value in content.items()}


def _for_json(value: Any) -> Any:
    """Return a value with None for every number that is not finite, which JSON cannot hold."""
    if isinstance(value, Mapping):
        return {name: _for_json(part) for name, part in value.items()}
    if isinstance(value, list | tuple):
        return [_for_json(part) for part in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _reference(run: Run) -> dict[str, Any] | None:
    """Return the meshes of a reference and its errors; None with other couplings."""
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
    """Return the micro model and, where it was chosen, the candidates; None without one."""
    if setup.micro is None:
        return None
    name, choice = {"name": setup.model.name}, setup.choice
    if choice is None:
        return name
    candidates = [asdict(candidate) for candidate in choice.candidates]
    return {**name, "chosen": asdict(choice.taken), "candidates": candidates}


def _versions() -> dict[str, str]:
    """Return the versions of Python and of the libraries that took part."""
    loaded = {name: sys.modules[name] for name in LIBRARIES if name in sys.modules}
    found = {name: getattr(module, "__version__", "unknown") for name, module in loaded.items()}
    return {"python": platform.python_version(), **found}
