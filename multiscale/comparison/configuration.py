"""One way to compute a scene, and the result of its run with the file that keeps it."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass, field, fields, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import PlainSerializer, PlainValidator, TypeAdapter

from geometry.patches import PatchGrid
from multiscale.comparison.scene_content import Content, Grid
from multiscale.scene.identity import identity
from multiscale.scene.scene import Scene
from support.checked_store import read_record, write_record
from support.errors import PatchlawError

Array = Annotated[
    NDArray[np.float64],
    PlainValidator(partial(np.array, dtype=float)),
    PlainSerializer(np.ndarray.tolist),
]
"""An array of numbers, which JSON holds as lists."""
Status = Literal["done", "not converged", "refused", "failed", "over budget", "not started"]

OWN = "the scene as it is"
"""Beginning of the name of the configuration that runs the scene as its file states it."""


@dataclass(frozen=True, kw_only=True)
class Configuration:
    """One way to compute a scene.

    Attributes:
        name: A unique name, for tables and legends.
        content: The complete scene, as `Scene.from_dict` takes it.
        cost: Predicted wall time [s].
        ranks: Number of processes.
        scale: Heights and load relative to those of the compared scene; results are divided by it.
        refusal: Why it cannot be run; empty where it can.
    """

    name: str
    content: Content
    cost: float = float("inf")
    ranks: int = 1
    scale: float = 1.0
    refusal: str = ""

    @cached_property
    def scene(self) -> Scene:
        """The scene of this configuration."""
        return Scene.from_dict(self.content)

    @property
    def is_own(self) -> bool:
        """Whether this is the scene as its file states it."""
        return self.name.startswith(OWN)

    @property
    def kind(self) -> str:
        """The coupling."""
        return str(self.content["coupling"]["kind"])

    @property
    def model(self) -> str:
        """The micro model; empty for an explicit reference."""
        if self.kind == "reference":
            return ""
        return str(self.content["micro"].get("model", "half-space"))

    @property
    def heights(self) -> Grid:
        """Grid of the surface."""
        nx, ny = self.content["surface"]["grid"]
        return nx, ny

    @cached_property
    def key(self) -> str:
        """Hash of everything that the results depend on."""
        parts = {"scene": identity(self.scene), "ranks": self.ranks}
        return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()[:20]


_none, _ONE_PATCH = partial(np.empty, 0), PatchGrid(grid=(1, 1), lengths=(1.0, 1.0))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Curves:
    """The results of a run that are compared: m load steps, by default none, and N patches.

    Attributes:
        patches: The partition of the interface.
        approach: Approach of the plane at the middle, shape (m,) [mm].
        force: Force, shape (m,) [N].
        area: Contact area fraction, shape (m,).
        separation: Mean separation, shape (m,) [mm].
        patch_pressure: Mean pressure of each patch, shape (m, N) [MPa].
        approach_error: The run's own error bar of the approach, shape (m,) [mm]; NaN where unknown.
        force_error: Error bar of the force, shape (m,) [N].
        area_error: Error bar of the area fraction, shape (m,).
    """

    patches: PatchGrid = _ONE_PATCH
    approach: Array = field(default_factory=_none)
    force: Array = field(default_factory=_none)
    area: Array = field(default_factory=_none)
    separation: Array = field(default_factory=_none)
    patch_pressure: Array = field(default_factory=_none)
    approach_error: Array = field(default_factory=_none)
    force_error: Array = field(default_factory=_none)
    area_error: Array = field(default_factory=_none)

    def divided(self, scale: float) -> Curves:
        """Return the curves for heights and a load that are larger by 1 / scale, at small slopes.

        Areas stay as they are; forces, pressures and lengths normal to the surface are divided.
        """
        names = {field.name for field in fields(self)} - {"patches", "area", "area_error"}
        return replace(self, **{name: getattr(self, name) / scale for name in names})


@dataclass(frozen=True, kw_only=True)
class RunResult:
    """The result of one configuration, finished or not.

    Attributes:
        configuration: The configuration.
        status: How the run ended.
        exit_code: Exit code of its process; None when it was killed or never started.
        message: The text of the error; empty without one.
        phases: Wall time of each phase [s].
        start_s: Wall time of everything else in the process: interpreter, imports, compiled
            forms [s].
        cpu_s: Processor time of the phases, of all ranks together [s].
        peak_MB: Largest memory in use, of all ranks together [MB]; NaN when unknown.
        unknowns: Degrees of freedom of the block that was pressed, where there is one.
        curves: The accepted load steps.
        finite_slopes: Whether it accounts for finite slopes.
    """

    configuration: Configuration
    status: Status
    exit_code: int | None = None
    message: str = ""
    phases: dict[str, float] = field(default_factory=dict)
    start_s: float = float("nan")
    cpu_s: float = float("nan")
    peak_MB: float = float("nan")
    unknowns: int | None = None
    curves: Curves = field(default_factory=Curves)
    finite_slopes: bool = False

    @property
    def name(self) -> str:
        """Name of the configuration."""
        return self.configuration.name

    @property
    def kind(self) -> str:
        """Coupling of the configuration."""
        return self.configuration.kind

    @property
    def model(self) -> str:
        """Micro model of the configuration; empty for an explicit reference."""
        return self.configuration.model

    @property
    def seconds(self) -> float:
        """Wall time of all phases [s]; NaN where none was begun."""
        return sum(self.phases.values()) if self.phases else float("nan")

    @property
    def steps(self) -> int:
        """Number of accepted load steps."""
        return self.curves.force.size

    def last(self, name: str) -> float:
        """Return a value at the last accepted load step; NaN without any.

        Args:
            name: Name of one of the curves.
        """
        return float(getattr(self.curves, name)[-1]) if self.steps else float("nan")


_RESULTS = TypeAdapter(RunResult)


def write_result(path: Path, result: RunResult) -> Path:
    """Write a result, checked, whole or not at all.

    Args:
        path: The file.
        result: The result.
    """
    return write_record(path, _RESULTS.dump_python(result, mode="json"))


def read_result(path: Path) -> RunResult | None:
    """Read the result of a configuration; None when the file is missing or damaged.

    Args:
        path: The file.
    """
    try:
        return _RESULTS.validate_python(read_record(path.read_bytes()))
    except (OSError, ValueError, PatchlawError):
        return None
