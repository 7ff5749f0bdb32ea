"""The checkpoint of a run: what it needs to go on, in a checked file that is replaced whole.

The load steps so far stand in a log beside it, which grows by a line for each: what a checkpoint
writes does not grow with the run.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from multiscale.loading.load_step import LoadStep
from multiscale.loading.stepper import LoadPosition
from multiscale.restart.step_log import StepLog, read_steps
from multiscale.results.contact_record import ContactRecord
from multiscale.run import Run
from multiscale.storage import packed, remove_partial, unpacked
from support.checked_store import Arrays, Mark, read_record, write_record
from support.collective import on_root
from support.errors import InputError, NotWritten

FORMAT = "patchlaw checkpoint 8"
FILE_NAME = "checkpoint.state"
FORMER_NAME = "checkpoint.h5"
"""Name of the checkpoints of earlier versions, which nothing goes on from."""

LEAST_INTERVAL = 1.0
"""Least wall time between two writes [s]; a kill loses the load steps of this time."""
LEAST_RATIO = 20.0
"""Least wall time between two writes over that of a write; so writing takes 5 % at most."""

LOG_SUFFIX = ".steps"
"""Suffix of the log of load steps, whose name is that of the checkpoint."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Checkpoint:
    """A run between two load steps. Nothing in it depends on the number of ranks.

    Attributes:
        identity: All that the numbers of the run depend on, see `multiscale.scene.identity`.
        resolved: What the auto values of the scene became, see `resolved_sections`.
        laws: Bytes of the law file; empty without laws.
        steps: The accepted load steps.
        position: Where the load history has come to.
        state: What the coupling's next load step starts from.
        contacts: The contacts recorded so far.
    """

    identity: dict[str, Any]
    resolved: dict[str, Any]
    laws: bytes
    steps: tuple[LoadStep, ...] = ()
    position: LoadPosition
    state: Arrays
    contacts: tuple[ContactRecord, ...] = ()


def checkpoint_of(run: Run, state: Arrays) -> Checkpoint:
    """Return all that is needed to go on with a run from its latest load step.

    Args:
        run: The run.
        state: What `Run.state` returned.
    """
    return Checkpoint(
        identity=run.identity,
        resolved=run.resolved,
        laws=run.law_bytes,
        steps=tuple(run.steps),
        position=run.position,
        state=state,
        contacts=run.contacts,
    )


def write_checkpoint(path: Path, checkpoint: Checkpoint, log: StepLog | None = None) -> Path:
    """Write a checkpoint whole, or leave the earlier one.

    Args:
        path: File to write.
        checkpoint: Its content.
        log: The log of its load steps; by default it is written anew.

    Raises:
        NotWritten: When a file cannot be written.
    """
    log = log or StepLog(path.with_suffix(LOG_SUFFIX))
    log.write(checkpoint.steps)
    facts = {
        "format": FORMAT,
        "identity": checkpoint.identity,
        "resolved": checkpoint.resolved,
        "log": asdict(log.mark),
    }
    run = packed((checkpoint.position, checkpoint.contacts))
    arrays = {f"run/{name}": array for name, array in run.items()}
    arrays |= {f"state/{name}": array for name, array in checkpoint.state.items()}
    return write_record(path, facts, arrays | {"laws": np.frombuffer(checkpoint.laws, np.uint8)})


def read_checkpoint(path: Path) -> Checkpoint:
    """Read a checkpoint.

    Args:
        path: The file.

    Raises:
        InputError: When it is none, is of another format or damaged.
    """
    try:
        if not path.is_file():  # a pipe would be waited for
            raise InputError("is no file")
        return _read(path)
    except InputError as error:
        found = error
    except OSError as error:
        found = InputError(f"cannot be read: {error}")
    except Exception as error:  # the checksum fits content that this version does not know
        found = InputError(f"is not understood: {error!r}")
    problem = f"{found.problem}; remove it, or begin anew with --overwrite"
    raise InputError(problem, file=str(path), value=found.value, allowed=found.allowed)


def _read(path: Path) -> Checkpoint:
    facts, arrays = read_record(path.read_bytes())
    form = facts.get("format") if isinstance(facts, dict) else None
    if form != FORMAT:
        raise InputError("was written by another patchlaw", value=form, allowed=FORMAT)

    def group(name: str) -> Arrays:
        found = (key.partition("/") for key in arrays if key.startswith(f"{name}/"))
        return {key: arrays[f"{name}/{key}"] for _, _, key in found}

    position, contacts = unpacked(group("run"), (LoadPosition, ContactRecord))
    return Checkpoint(
        identity=facts["identity"],
        resolved=facts["resolved"],
        laws=arrays["laws"].tobytes(),
        steps=read_steps(path.with_suffix(LOG_SUFFIX), Mark(**facts["log"])),
        position=position,
        state=group("state"),
        contacts=contacts,
    )


class _Accepted(NamedTuple):
    """A run after a load step; the steps and contacts in it do not change any more."""

    position: LoadPosition
    state: Arrays
    steps: int
    contacts: int

    def checkpoint(self, run: Run) -> Checkpoint:
        return replace(
            checkpoint_of(run, self.state),
            position=self.position,
            steps=tuple(run.steps[: self.steps]),
            contacts=run.contacts[: self.contacts],
        )


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
        self._log = StepLog(self.path.with_suffix(LOG_SUFFIX))
        self._pending: _Accepted | None = None
        self._due = 0.0

    def __enter__(self) -> CheckpointWriter:
        """Return the writer."""
        return self

    def __exit__(self, *error: object) -> None:
        """Write what is not written yet, on rank 0; an error that ends the run is what to tell."""
        with suppress(NotWritten, MemoryError):
            self._write_pending()

    def accept(self) -> None:
        """Keep the load steps that the run has accepted so far, and write them if it is time.

        Raises:
            NotWritten: When that fails; the earlier file stays.

        Note:
            Collective.
        """
        run, state = self._run, self._run.state()

        def keep() -> None:
            self._pending = _Accepted(run.position, state, len(run.steps), len(run.contacts))
            if time.monotonic() >= self._due:
                self._write_pending()

        on_root(run.comm, keep)

    def write(self) -> None:
        """Write the run as it is now, like `accept`, but at once."""
        self._due = 0.0
        self.accept()

    def write_pending(self) -> None:
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
            for path in (self.path, self._log.path):
                path.unlink(missing_ok=True)

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
        write_checkpoint(self.path, self._pending.checkpoint(self._run), self._log)
        self.path.with_name(FORMER_NAME).unlink(missing_ok=True)
        self._pending = None
        now = time.monotonic()
        self._due = now + max(LEAST_INTERVAL, LEAST_RATIO * (now - began))
