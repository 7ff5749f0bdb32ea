"""The checkpoint of a run: what it needs to go on, in an HDF5 file that is replaced whole."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from geometry.collective import on_root
from geometry.errors import InputError, NotWritten
from multiscale.loading.load_step import LoadStep, PatchState
from multiscale.loading.stepper import LoadPosition
from multiscale.results.contact_record import ContactRecord
from multiscale.run import Run
from multiscale.storage import (
    Arrays,
    checksummed,
    packed,
    remove_partial,
    stored_numbers,
    unpacked,
    verified,
    write_bytes,
)

FORMAT = "patchlaw checkpoint 6"
FILE_NAME = "checkpoint.h5"

LEAST_INTERVAL = 1.0
"""Least wall time between two writes [s]; a kill loses the load steps of this time."""
LEAST_RATIO = 20.0
"""Least wall time between two writes over that of a write; so writing takes 5 % at most."""

_COLUMNS = [one.name for one in fields(LoadStep) if one.name != "patches"]
_PATCH_COLUMNS = [one.name for one in fields(PatchState)]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Checkpoint:
    """A run between two load steps. Nothing in it depends on the number of ranks.

    Attributes:
        scene: The scene as it was given, as nested dictionaries.
        resolved: What the auto values of the scene became, see `resolved_sections`.
        heights: SHA-256 of the surface's heights.
        meshes: SHA-256 of the meshes of the bodies.
        laws: Bytes of the law file; empty without laws.
        steps: The accepted load steps.
        position: Where the load history has come to.
        state: What the coupling's next load step starts from.
        contacts: The contacts recorded so far.
    """

    scene: dict[str, Any]
    resolved: dict[str, Any]
    heights: str
    laws: bytes
    steps: tuple[LoadStep, ...] = ()
    position: LoadPosition
    state: Arrays
    contacts: tuple[ContactRecord, ...] = ()
    meshes: list[str] = field(default_factory=list)


def checkpoint_of(run: Run, state: Arrays) -> Checkpoint:
    """Return all that is needed to go on with a run from here.

    Args:
        run: The run.
        state: What `Run.state` returned.
    """
    return Checkpoint(
        scene=run.given.model_dump(by_alias=True, mode="json"),
        resolved=run.resolved,
        heights=run.heights,
        meshes=run.meshes,
        laws=run.law_bytes,
        steps=tuple(run.steps),
        position=run.position,
        state=state,
        contacts=run.contacts,
    )


def write_checkpoint(path: Path, checkpoint: Checkpoint) -> Path:
    """Write a checkpoint whole, or leave the earlier one.

    Args:
        path: File to write.
        checkpoint: Its content.

    Raises:
        NotWritten: When the file cannot be written.
    """
    steps = checkpoint.steps
    facts = {name: getattr(checkpoint, name) for name in ("scene", "resolved", "heights", "meshes")}
    facts["steps"] = [[getattr(step, name) for name in _COLUMNS] for step in steps]
    record = (
        json.dumps(facts, default=np.generic.item),
        np.frombuffer(checkpoint.laws, np.uint8),
        [_stacked([getattr(step.patches, name) for step in steps]) for name in _PATCH_COLUMNS],
        checkpoint.position,
        checkpoint.contacts,
    )

    def fill(file: Any) -> None:
        file.attrs["format"] = FORMAT
        for group, arrays in (("run", packed(record)), ("state", checkpoint.state)):
            for name, array in arrays.items():
                file.create_dataset(f"{group}/{name}", data=array)

    return write_bytes(path, checksummed(fill))


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
    problem = f"{found.problem}; remove it, or run without --resume to begin anew"
    raise InputError(problem, file=str(path), value=found.value, allowed=found.allowed)


def _read(path: Path) -> Checkpoint:
    with h5py.File(verified(path), "r") as file:
        form = str(file.attrs.get("format", ""))
        if form != FORMAT:
            raise InputError("was written by another patchlaw", value=form, allowed=FORMAT)
        run, state = (
            {name: stored_numbers(item) for name, item in file.get(group, {}).items()}
            for group in ("run", "state")
        )
    text, laws, patches, position, contacts = unpacked(run, (LoadPosition, ContactRecord))
    facts = json.loads(text)
    columns = zip(_PATCH_COLUMNS, patches, strict=True)
    known = {name: column for name, column in columns if column is not None}
    steps = [
        LoadStep(
            **dict(zip(_COLUMNS, map(_tuples, row), strict=True)),
            patches=PatchState(**{name: column[k] for name, column in known.items()}),
        )
        for k, row in enumerate(facts.pop("steps"))
    ]
    return Checkpoint(
        **facts,
        laws=laws.tobytes(),
        steps=tuple(steps),
        position=position,
        state=state,
        contacts=contacts,
    )


def _stacked(columns: list[Any]) -> Any:
    """Return the arrays of load steps as one; None where they have none."""
    return None if any(column is None for column in columns) else np.array(columns)


def _tuples(value: Any) -> Any:
    """Return a value read from JSON with its lists as tuples."""
    return tuple(map(_tuples, value)) if isinstance(value, list) else value


class CheckpointWriter:
    """Writes the checkpoint of a run to its results folder, as one file that is replaced whole.

    Every accepted load step is kept in memory, and written at once unless the last write was less
    than a second or 20 times its own duration ago. On 16 patches, 200 load steps take 5 ms and
    0.14 MB, and 10,000 take 0.12 s and 6.4 MB. What is not written yet is written when the run
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

    def accept(self) -> None:
        """Keep the load steps that the run has accepted so far, and write them if it is time.

        Raises:
            NotWritten: When that fails; the earlier file stays.

        Note:
            Collective.
        """
        state = self._run.state()

        def keep() -> None:
            self._pending = checkpoint_of(self._run, state)
            if time.monotonic() >= self._due:
                self._write_pending()

        on_root(self._run.comm, keep)

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
        """Remove the file and forget what is not written; the run needs it no longer.

        Note:
            Collective.
        """
        self._pending = None
        on_root(self._run.comm, lambda: self.path.unlink(missing_ok=True))

    def _write_pending(self) -> None:
        if self._pending is None:
            return
        began = time.monotonic()
        try:
            self._hold()  # again, where the folder was removed in the meantime
        except InputError as error:  # the folder was good when the run began
            raise NotWritten(f"{self.path.parent}: {error.problem}") from None
        remove_partial(self.path.parent)
        write_checkpoint(self.path, self._pending)
        self._pending = None
        now = time.monotonic()
        self._due = now + max(LEAST_INTERVAL, LEAST_RATIO * (now - began))
