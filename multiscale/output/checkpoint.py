"""The checkpoint of a run: what it needs to go on, in a checked file that is replaced whole."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

from patchlaw.geometry.contact_state import ShearState
from patchlaw.geometry.rigid_plane import Control
from patchlaw.geometry.sliders import SliderRecord, SliderState
from patchlaw.micro import RigidPlane, Start
from patchlaw.multiscale.law_solvers.loaded_patches import DenseState
from patchlaw.multiscale.laws.interpolation import LawPoint
from patchlaw.multiscale.laws.law_table import LawTable, law_bytes, read_laws
from patchlaw.multiscale.loading.leak import Leak
from patchlaw.multiscale.loading.load_step import LoadStep, PatchState
from patchlaw.multiscale.loading.stepper import LoadPosition
from patchlaw.multiscale.results.contact_record import ContactRecord
from patchlaw.multiscale.scene_run import Run
from patchlaw.support.checked_store import read_record, write_record
from patchlaw.support.collective import on_root
from patchlaw.support.errors import InputError, NotWritten
from patchlaw.support.whole_files import read_bytes, remove, remove_partial

FILE_NAME = "checkpoint.state"

LEAST_INTERVAL = 1.0
"""Least wall time between two writes [s]; a kill loses the load steps of this time."""
LEAST_RATIO = 20.0
"""Least wall time between two writes over that of a write; so writing takes 5 % at most."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Checkpoint:
    """A run between two load steps. Nothing in it depends on the number of ranks.

    Attributes:
        identity: All that the numbers of the run depend on, see `multiscale.scene.scene`.
        resolved: What the auto values of the scene became, see `resolved_sections`.
        laws: Bytes of the law file; empty without laws.
        steps: The accepted load steps.
        position: Where the load history has come to.
        state: What the coupling's next load step starts from.
        contacts: The contacts recorded so far.
        fields: What makes the states of fields so far again, as numbers of load steps and records.
    """

    identity: dict[str, Any]
    resolved: dict[str, Any]
    laws: bytes
    steps: tuple[LoadStep, ...] = ()
    position: LoadPosition
    state: Any
    contacts: tuple[ContactRecord, ...] = ()
    fields: tuple[tuple[int, Any], ...] = ()

    @property
    def table(self) -> LawTable | None:
        """The laws; None without."""
        return read_laws(BytesIO(self.laws)) if self.laws else None


_KINDS = (
    Checkpoint,
    Control,
    LoadPosition,
    LoadStep,
    ContactRecord,
    DenseState,
    LawPoint,
    Leak,
    PatchState,
    RigidPlane,
    ShearState,
    SliderRecord,
    SliderState,
    Start,
)
"""What a checkpoint may consist of: its own records, and those of the states of couplings."""


def checkpoint_of(run: Run, state: Any) -> Checkpoint:
    """Return all that is needed to go on with a run from its latest load step.

    Args:
        run: The run.
        state: What `Coupling.state` returned.
    """
    return Checkpoint(
        identity=run.identity,
        resolved=run.resolved,
        laws=b"" if run.coupling.table is None else law_bytes(run.coupling.table),
        steps=tuple(run.steps),
        position=run.position,
        state=state,
        contacts=run.contacts,
        fields=tuple(run.observers.fields.records.items()),
    )


def read_checkpoint(path: Path) -> Checkpoint:
    """Read a checkpoint.

    Args:
        path: The file.

    Raises:
        InputError: When it is none, is of another version or damaged.
    """
    try:
        found = read_record(read_bytes(path), _KINDS)
        if isinstance(found, Checkpoint):
            return found
        problem = "is no checkpoint"
    except InputError as error:
        problem = error.problem
    except OSError as error:
        problem = f"cannot be read: {error.strerror}"
    raise InputError(f"{problem}; remove it, or begin anew with --overwrite", file=str(path))


class CheckpointWriter:
    """Writes the checkpoint of a run to its results folder.

    Every accepted load step is kept in memory, and written at once unless the last write was less
    than a second or 20 times its own duration ago. What is not written yet is written when the run
    ends, by an error or a signal too. A process that is killed loses it, and the resumed run
    computes it again.

    Args:
        folder: Folder of the results.
        run: The run.
        hold: Makes the folder where it is missing and takes the lock on it, on rank 0.

    Attributes:
        path: The file.
    """

    def __init__(self, folder: Path, run: Run, hold: Callable[[], None]) -> None:
        self.path = folder / FILE_NAME
        self._run, self._hold = run, hold
        self._pending: Checkpoint | None = None
        self._due = 0.0

    def __enter__(self) -> CheckpointWriter:
        """Return the writer."""
        return self

    def __exit__(self, *error: object) -> None:
        """Write what is not written yet, on rank 0; an error that ends the run is what to tell."""
        with suppress(NotWritten, MemoryError):
            self._write_pending()

    def accept(self, step: LoadStep | None = None) -> None:
        """Keep the run after a load step, and write it if it is time; an observer of load steps.

        Args:
            step: The load step, which the run has accepted; None before the first.

        Raises:
            NotWritten: When that fails; the earlier file stays.

        Note:
            Collective.
        """
        run, state = self._run, self._run.coupling.state()

        def keep() -> None:
            self._pending = checkpoint_of(run, state)
            if time.monotonic() >= self._due:
                self._write_pending()

        on_root(run.comm, keep)

    def finish(self) -> None:
        """Write what was accepted since the last write.

        Raises:
            NotWritten: When that fails; the earlier file stays.

        Note:
            Collective.
        """
        on_root(self._run.comm, self._write_pending)

    def remove(self) -> None:
        """Remove the file and forget what is not written; the run needs it no longer.

        Note:
            Collective.
        """
        self._pending = None
        on_root(self._run.comm, lambda: remove(self.path))

    def _write_pending(self) -> None:
        if self._pending is None:
            return
        began = time.monotonic()
        try:
            self._hold()  # again, where the folder was removed in the meantime
        except InputError as error:  # the folder was good when the run began
            raise NotWritten(f"{self.path.parent}: {error.problem}") from None
        remove_partial(self.path.parent)
        write_record(self.path, self._pending)
        self._pending = None
        now = time.monotonic()
        self._due = now + max(LEAST_INTERVAL, LEAST_RATIO * (now - began))
