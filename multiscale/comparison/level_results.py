"""What a level of a comparison leaves behind, and its file."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np

from geometry.errors import PatchlawError
from geometry.patches import PatchGrid
from multiscale.comparison.measures import Curves
from multiscale.results.history import History
from multiscale.storage.whole_files import write_json

Status = Literal["done", "not converged", "refused", "failed", "over budget", "not started"]

STATUS_OF_EXIT: dict[int, Status] = {0: "done", 2: "refused", 3: "not converged"}
"""What exit codes of a level's process mean; every other one is ``failed``."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LevelResult:
    """The outcome of one level, finished or not.

    Attributes:
        key: Hash of what was run, see `levels.Level`.
        status: How it ended.
        exit_code: That of its process; None when it was killed or never started.
        message: The error's text; empty without one.
        seconds: Wall time of each phase [s].
        start_s: Wall time of everything else in its process: interpreter, imports, compiled
            forms [s].
        cpu_s: Processor time of the phases, of all ranks together [s].
        peak_MB: Largest memory in use, of all ranks together [MB]; NaN when unknown.
        unknowns: Degrees of freedom of the block that was pressed, where one was.
        curves: The load steps accepted; None when there are none.
        finite_slopes: Whether its micro model, if any, sees that slopes are finite.
    """

    key: str
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
    def settled(self) -> bool:
        """Whether running the level again would give the same."""
        return self.status in ("done", "refused", "not converged")


def curves_of(history: History) -> Curves | None:
    """Return what is compared of a history; None when it has no load step.

    A history of an explicit reference gives its values at mesh size zero with their errors; the
    patch pressures of its finest mesh are scaled to the force there.
    """
    if not len(history):
        return None
    force, pressure = history.force_N, history.patch_pressure_MPa
    columns = {"approach": history.approach_mm, "force": force}
    columns["area"] = history.contact_area_fraction
    errors = dict.fromkeys(columns, np.full(len(history), np.nan))
    record = history.reference
    if record is not None:
        found = {name: getattr(record, name) for name in columns}
        columns = {name: estimate.value for name, estimate in found.items()}
        errors = {name: estimate.error for name, estimate in found.items()}
        ones = np.ones_like(force)
        scale = np.divide(columns["force"], force, out=ones, where=force > 0.0)
        pressure = pressure * scale[:, None]
    return Curves(
        patches=history.patches,
        separation=history.mean_separation_mm,
        patch_pressure=pressure,
        **columns,
        **{f"{name}_error": error for name, error in errors.items()},
    )


def write_result(path: Path, result: LevelResult) -> Path:
    """Write a result as JSON, whole or not at all, with a checksum."""
    content = {name: getattr(result, name) for name in result.__slots__}
    if result.curves is not None:
        content["curves"] = _content(result.curves)
    return write_json(path, {"sha256": _digest(content), "result": content})


def read_result(path: Path) -> LevelResult | None:
    """Read a result; None when there is none that can be read, or it is damaged."""
    try:
        kept = json.loads(path.read_text(encoding="utf-8"))
        content = kept["result"]
        if kept["sha256"] != _digest(content):
            return None
        if content["curves"] is not None:
            content["curves"] = _curves(content["curves"])
        return LevelResult(**content)
    except (OSError, ValueError, KeyError, TypeError, RecursionError, PatchlawError):
        return None


def _digest(content: Any) -> str:
    """Return the SHA-256 of what JSON can hold; numbers come back from a file as they were."""
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def _content(curves: Curves) -> dict[str, Any]:
    columns = {name: getattr(curves, name) for name in curves.__slots__ if name != "patches"}
    listed: dict[str, Any] = {name: np.asarray(values).tolist() for name, values in columns.items()}
    return listed | {"patches": asdict(curves.patches)}


def _curves(content: dict[str, Any]) -> Curves:
    grid = {name: tuple(value) for name, value in content.pop("patches").items()}
    columns = {name: np.asarray(values, dtype=np.float64) for name, values in content.items()}
    return Curves(patches=PatchGrid(**grid), **columns)
