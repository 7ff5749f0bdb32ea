"""The checkpoint of a run: what it needs to go on, in a checked file that is replaced whole.

The load steps so far stand in a log beside it, which grows by a record for each: what a checkpoint
writes grows with the run only by contacts and fields that are kept of many load steps. The
checkpoint says which records of the log belong to it. What a killed run wrote behind them does not
count, and is overwritten when the run goes on.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from io import BytesIO
from pathlib import Path
from typing import Any

from patchlaw.geometry.contact_state import ShearState
from patchlaw.geometry.rigid_plane import Control
from patchlaw.geometry.sliders import SliderRecord, SliderState
from patchlaw.micro import RigidPlane, Start
from patchlaw.multiscale.law_solvers.loaded_patches import DenseState
from patchlaw.multiscale.laws.interpolation import LawPoint
from patchlaw.multiscale.laws.law_file import law_bytes, read_laws
from patchlaw.multiscale.laws.law_table import LawTable
from patchlaw.multiscale.loading.leak import Leak
from patchlaw.multiscale.loading.load_step import LoadStep, PatchState
from patchlaw.multiscale.loading.stepper import LoadPosition
from patchlaw.multiscale.results.contact_record import ContactRecord
from patchlaw.multiscale.scene_run import Run
from patchlaw.support.checked_store import START, Mark, append, read_record, unsealed, write_record
from patchlaw.support.collective import on_root
from patchlaw.support.errors import InputError, NotWritten
from patchlaw.support.whole_files import read_bytes, remove, remove_partial

FILE_NAME = "checkpoint.state"

LEAST_INTERVAL = 1.0
"""Least wall time between two writes [s]; a kill loses the load steps of this time."""
LEAST_RATIO = 20.0
"""Least wall time between two writes over that of a write; so writing takes 5 % at most."""

LOG_SUFFIX = ".steps"
"""Suffix of the log of load steps, whose name is that of the checkpoint."""

LOG_NAME = f"checkpoint{LOG_SUFFIX}"
"""Name of the log."""


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
        log: How far the log beside the file belongs to it.
    """

    identity: dict[str, Any]
    resolved: dict[str, Any]
    laws: bytes
    steps: tuple[LoadStep, ...] = ()
    position: LoadPosition
    state: Any
    contacts: tuple[ContactRecord, ...] = ()
    fields: tuple[tuple[int, Any], ...] = ()
    log: Mark = START

    @property
    def table(self) -> LawTable | None:
        """The laws; None without."""
        return read_laws(BytesIO(self.laws)) if self.laws else None


_KINDS = (
    Checkpoint,
    Control,
    Mark,
    LoadPosition,
    ContactRecord,
    DenseState,
    LawPoint,
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


def write_checkpoint(path: Path, checkpoint: Checkpoint) -> Path:
    """Write a checkpoint whole, or leave the earlier one, with a new log of its load steps.

    Args:
        path: File to write.
        checkpoint: Its content.

    Raises:
        NotWritten: When a file cannot be written.
    """
    _write(path, checkpoint, START)
    return path


def read_checkpoint(path: Path) -> Checkpoint:
    """Read a checkpoint.

    Args:
        path: The file.

    Raises:
        InputError: When it is none, is of another version or damaged.
    """
    try:
        found = read_record(read_bytes(path), _KINDS)
        if not isinstance(found, Checkpoint):
            raise InputError("is no checkpoint")
        return replace(found, steps=read_steps(path.with_suffix(LOG_SUFFIX), found.log))
    except InputError as error:
        problem = error.problem
    except OSError as error:
        where = Path(error.filename or path).name
        problem = f"cannot be read: {where}: {error.strerror}"
    raise InputError(f"{problem}; remove it, or begin anew with --overwrite", file=str(path))


def write_steps(path: Path, steps: Sequence[LoadStep], mark: Mark = START) -> Mark:
    """Write those load steps to a log that are not in it yet.

    Args:
        path: The file.
        steps: All load steps so far. Where the file has gone, or is another run's, all are written
            again.
        mark: How far the file is written.

    Returns:
        How far it is written now.

    Raises:
        NotWritten: When the file cannot be written; what was in it counts as before.
    """
    here = path.stat().st_size if path.is_file() else 0
    mark = mark if here >= mark.size else START
    new = steps[mark.records :]
    return append(path, new, mark) if new else mark


def read_steps(path: Path, mark: Mark) -> tuple[LoadStep, ...]:
    """Read the load steps of a log.

    Args:
        path: The file.
        mark: How far it is to be read.

    Raises:
        InputError: When bytes are missing, or are not those that were written.
    """
    if mark == START:
        return ()
    steps = []
    with suppress(InputError):
        for step, here in unsealed(read_bytes(path)[: mark.size], (LoadStep, PatchState, Leak)):
            steps.append(step)
            if here == mark:
                return tuple(steps)
    raise InputError(f"is damaged: {path.name} beside it does not have the bytes it had")


class CheckpointWriter:
    """Writes the checkpoint of a run to its results folder, with the log of its load steps.

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
        self._log = START
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
        """Remove the files and forget what is not written; the run needs them no longer.

        Note:
            Collective.
        """
        self._pending = None

        def unlink() -> None:
            for path in (self.path, self.path.with_suffix(LOG_SUFFIX)):
                remove(path)

        on_root(self._run.comm, unlink)

    def _write_pending(self) -> None:
        if self._pending is None:
            return
        began = time.monotonic()
        try:
            self._hold()  # again, where the folder was removed in the meantime
        except InputError as error:  # the folder was good when the run began
            raise NotWritten(f"{self.path.parent}: {error.problem}") from None
        remove_partial(self.path.parent)
        self._log = _write(self.path, self._pending, self._log)
        self._pending = None
        now = time.monotonic()
        self._due = now + max(LEAST_INTERVAL, LEAST_RATIO * (now - began))


def _write(path: Path, checkpoint: Checkpoint, mark: Mark) -> Mark:
    """Write a checkpoint, and its load steps behind a mark of their log; return the new mark."""
    mark = write_steps(path.with_suffix(LOG_SUFFIX), checkpoint.steps, mark)
    write_record(path, replace(checkpoint, steps=(), log=mark))
    return mark
