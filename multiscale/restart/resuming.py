"""Writes the checkpoint of a run while it goes on, and lets a run go on from a checkpoint."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

from geometry.collective import on_root
from geometry.errors import InputError, NotWritten
from multiscale.restart.checkpoint import (
    Checkpoint,
    checkpoint_of,
    given_keys,
    read_checkpoint,
    write_checkpoint,
)
from multiscale.restart.folder_lock import FolderLock
from multiscale.run import Run
from multiscale.scene.scene import Scene
from multiscale.storage.whole_files import remove_partial

FILE_NAME = "checkpoint.h5"

LEAST_INTERVAL = 1.0
"""Least wall time between two writes [s]; a kill loses the load steps of this time."""
LEAST_RATIO = 20.0
"""Least wall time between two writes over that of a write; so writing takes 5 % at most."""


class CheckpointWriter:
    """Writes the checkpoint of a run to its results folder, as one file that is replaced whole.

    Every accepted load step is kept in memory, and written at once unless the last write was less
    than a second or 20 times its own duration ago. On 16 patches, 200 load steps take 8 ms and
    0.15 MB, and 10,000 take 0.12 s and 6.4 MB. What is not written yet is written when the run
    ends, by an error or a signal too. A process that is killed loses it, and the resumed run
    computes it again.

    Args:
        folder: Folder of the results.
        run: The run.
        lock: The lock on the folder, held by rank 0.

    Attributes:
        path: The file.
    """

    def __init__(self, folder: Path, run: Run, lock: FolderLock) -> None:
        self.path = folder / FILE_NAME
        self._run, self._lock = run, lock
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
            self._lock.hold()  # again, where the folder was removed in the meantime
        except InputError as error:  # the folder was good when the run began
            raise NotWritten(f"{self.path.parent}: {error.problem}") from None
        remove_partial(self.path.parent)
        write_checkpoint(self.path, self._pending)
        self._pending = None
        now = time.monotonic()
        self._due = now + max(LEAST_INTERVAL, LEAST_RATIO * (now - began))


def find_checkpoint(folder: Path, scene: Scene) -> Checkpoint | None:
    """Return what an interrupted run of a scene left in its results folder; None without it.

    Args:
        folder: The folder.
        scene: The present scene.

    Raises:
        InputError: When the checkpoint is damaged, or a key of the scene has changed.
    """
    path = folder / FILE_NAME
    if not path.exists():
        return None
    found = read_checkpoint(path)
    _refuse_changed_keys(folder, scene, found.scene)
    return found


def go_on(run: Run, found: Checkpoint, folder: Path) -> None:
    """Let a run go on from a checkpoint of the same scene.

    Args:
        run: The run, made with the resolved values of the checkpoint; nothing of it made yet.
        found: The checkpoint.
        folder: Folder of the results, for messages.

    Raises:
        InputError: When the heights have changed.
    """
    _refuse_changed_heights(folder, run, found.heights)
    run.resume(found.steps, found.position, found.state, found.laws)


def is_finished(folder: Path, run: Run) -> bool:
    """Tell whether the results in a folder are those of a finished run of the same scene.

    Args:
        folder: The folder.
        run: A run of the scene.
    """
    try:
        facts = json.loads((folder / "provenance.json").read_text(encoding="utf-8"))
        _refuse_changed_keys(folder, run.given, facts["scene_given"])
        _refuse_changed_heights(folder, run, facts["surface"]["heights_sha256"])
        return bool(facts["finished"])
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return False  # InputError is a ValueError


def _refuse_changed_heights(folder: Path, run: Run, heights: str) -> None:
    """Refuse to go on with heights other than those that a run began with."""
    if heights != run.heights:
        raise InputError(
            f"the heights are not those that the run in {folder} began with; restore them, or "
            "run without --resume to begin anew",
            key="surface.file",
            value=run.given.surface.file,
        )


def _refuse_changed_keys(folder: Path, now: Scene, then: dict[str, Any]) -> None:
    """Refuse to go on with a scene in which a key has changed that can matter."""
    old, new = dict(_dotted(then)), dict(_dotted(given_keys(now)))
    for key in dict.fromkeys((*new, *old)):
        if not key.startswith("output.") and old.get(key) != new.get(key):
            raise InputError(
                f"is not what the run in {folder} began with; restore it, or run without "
                "--resume to begin anew",
                key=key,
                value=new.get(key),
                allowed=repr(old.get(key)),
            )


def _dotted(scene: dict[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the keys of nested dictionaries, dotted, with their values."""
    for name, value in scene.items():
        if isinstance(value, dict):
            yield from _dotted(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", value
