"""What a run says of itself: a report to read, and its provenance for programs."""

from __future__ import annotations

import os
import platform
import sys
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from datetime import UTC, datetime
from importlib.metadata import version
from typing import Any

from pydantic_core import to_jsonable_python

from multiscale.couplings.reference import ReferenceCoupling
from multiscale.machine.nodes import peak_memory
from multiscale.planning import plan
from multiscale.results.history import History, with_error
from multiscale.results.html_page import Section, page_html
from multiscale.run import Run
from multiscale.setup.problem import ProblemSetup

LIBRARIES = "numpy scipy dolfinx petsc4py mpi4py gmsh h5py pydantic pint matplotlib".split()
"""Libraries whose versions are recorded."""


def report_html(run: Run, figures: Mapping[str, bytes]) -> str:
    """Compose the report of a run.

    Args:
        run: The run, finished or stopped.
        figures: PNG images by caption; they become part of the page.

    Returns:
        A complete HTML document.
    """
    history, setup = run.history(), run.setup
    done = (("topic", "what"), list(plan.statements(setup)))
    times = [(phase, f"{seconds:.2f}") for phase, seconds in history.seconds.items()]
    sections = [
        Section(paragraphs=[_headline(history)], warnings=list(plan.warnings(setup))),
        Section(heading="What was done", table=done, text_columns=(1,)),
        Section(heading="Force–approach curve", table=history.table(), figures=figures),
        Section(heading="What it took", table=(("phase", "wall time [s]"), times)),
        *_errors(history),
        Section(notes=history.notes),
    ]
    return page_html(f"patchlaw: {run.scene.name}", sections)


def _errors(history: History) -> Iterator[Section]:
    """Yield a section with the latest errors that were measured, by cause."""
    measured = [step for step in history if step.errors]
    if not measured:
        return
    step, causes = measured[-1], dict(measured[-1].errors)
    causes["altogether"] = sum(causes.values())
    yield Section(
        heading=f"Error of the force by cause, measured at load step {step.step}",
        table=(
            ("cause", "force [N]", "of the force [%]"),
            [
                (name, f"{error:.2g}", f"{100 * error / step.force_N:.2g}" if step.force_N else "–")
                for name, error in causes.items()
            ],
        ),
    )


def _headline(history: History) -> str:
    if not len(history):
        return "No load step was accepted."
    last, record = history.steps[-1], history.reference
    error = "" if record is None else f" Discretisation error: {record.label}."
    approach = History.approach_mm.text(last)
    force = with_error(last.force_N, last.force_error_N, shown=".5g")
    return (
        f"At an approach of {approach} µm the plane carries {force} N "
        f"({last.mean_pressure_MPa:.4g} MPa) on {last.contacts} contacts covering "
        f"{100 * last.contact_area_fraction:.3g} % of the nominal area.{error}"
    )


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
        "scene": run.scene,
        "scene_given": run.given,
        "units": "mm, N, MPa",
        "surface": {
            "source": setup.surface.source,
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
    known: dict[str, Any] = to_jsonable_python(content, inf_nan_mode="null", fallback=str)
    return known


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
        "mesh_quality": coupling.qualities,
    }


def _micro_model(setup: ProblemSetup) -> dict[str, Any] | None:
    """Return the micro model and, where it was chosen, the candidates; None without one."""
    if setup.micro is None:
        return None
    choice = setup.choice
    chosen = {} if choice is None else {"chosen": choice.taken, "candidates": choice.candidates}
    return {"name": setup.model.name, **chosen}


def _versions() -> dict[str, str]:
    """Return the versions of Python and of the libraries that took part."""
    loaded = {name: sys.modules[name] for name in LIBRARIES if name in sys.modules}
    found = {name: getattr(module, "__version__", "unknown") for name, module in loaded.items()}
    return {"python": platform.python_version(), **found}
