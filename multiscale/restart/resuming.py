"""Keeps a run's checkpoint while it goes on, and lets it go on from there."""

from __future__ import annotations

import json
import secrets
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from geometry.collective import on_root
from geometry.errors import InputError, NotWritten
from multiscale.loading.load_step import LoadStep
from multiscale.loading.stepper import LoadPosition
from multiscale.restart.checkpoint import Checkpoint, read_checkpoint, write_checkpoint
from multiscale.restart.folder_lock import FolderLock
from multiscale.restart.journal import Journal, journalled
from multiscale.run import Run
from multiscale.scene.scene import Scene
from multiscale.storage.serialisation import Arrays
from multiscale.storage.whole_files import remove_partial

CHECKPOINT, JOURNAL = "checkpoint.h5", "checkpoint.journal"
_SOONEST = 1.0  # between two checkpoints [s]; the journal holds the load steps in between
_RATHER = 20.0  # likewise, times what writing one takes


class CheckpointWriter:
    """Writes what is needed to resume a run after every load step, at a cost that does not grow.

    The checkpoint is written whole at most every second, and less often where that takes long; the
    load steps since are appended to a journal beside it.

    Args:
        folder: Where to.
        run: The run.
        lock: The lock on the folder, held by rank 0.
    """

    def __init__(self, folder: Path, run: Run, lock: FolderLock) -> None:
        self._path, self._run, self._lock = folder / CHECKPOINT, run, lock
        self._name = on_root(run.comm, lambda: secrets.token_hex(16))
        self._journal = Journal(folder / JOURNAL, self._name)
        self._due = 0.0

    def exists(self) -> bool:
        """Whether the folder has a checkpoint; ask on one rank."""
        return self._path.exists()

    def resume(self) -> bool:
        """Let the run go on from the folder's checkpoint, if it has one.

        Returns:
            Whether there was one.

        Raises:
            InputError: When it is damaged, or of another scene.

        Note:
            Collective.
        """
        found = on_root(self._run.comm, self._found)
        if found is not None:
            self._run.resume(found.steps, found.position, found.state, found.laws)
        return found is not None

    def keep(self, step: LoadStep) -> None:
        """Keep a load step just accepted.

        Args:
            step: The load step.

        Raises:
            NotWritten: When that fails; what was kept before stays.

        Note:
            Collective.
        """
        state, position = self._run.state(), self._run.position
        on_root(self._run.comm, lambda: self._keep(step, position, state))

    def write(self) -> None:
        """Write the checkpoint whole, now.

        Raises:
            NotWritten: When that fails; what was kept before stays.

        Note:
            Collective.
        """
        state = self._run.state()
        on_root(self._run.comm, lambda: self._write(state))

    def remove(self) -> None:
        """Remove the checkpoint of a run whose results are written; call it on one rank."""
        self._journal.close()
        for name in (JOURNAL, CHECKPOINT):
            self._path.with_name(name).unlink(missing_ok=True)

    def _found(self) -> Checkpoint | None:
        if not self.exists():
            return None
        checkpoint = read_checkpoint(self._path)
        now = checkpoint_of(self._run, self._name, {})
        refuse_changes(checkpoint, now, self._path)
        return with_journal(checkpoint, self._path.with_name(JOURNAL))

    def _keep(self, step: LoadStep, position: LoadPosition, state: Arrays) -> None:
        if time.monotonic() < self._due and self._journal.stands:
            self._journal.append(step, position, state)
        else:
            self._write(state)

    def _write(self, state: Arrays) -> None:
        began = time.monotonic()
        try:
            self._lock.hold()  # the folder may have been removed
        except InputError as error:  # which was good when the run began
            raise NotWritten(f"{self._path.parent}: {error.problem}") from None
        remove_partial(self._path.parent)
        write_checkpoint(self._path, checkpoint_of(self._run, self._name, state))
        self._journal.begin()
        now = time.monotonic()
        self._due = now + max(_SOONEST, _RATHER * (now - began))


def checkpoint_of(run: Run, name: str, state: Arrays) -> Checkpoint:
    """Return all that is needed to go on with a run from here.

    Args:
        run: The run.
        name: Name of it.
        state: What `Run.state` returned.
    """
    return Checkpoint(
        run=name,
        scene=run.given.model_dump(by_alias=True, mode="json"),
        settled=run.resolved,
        heights=run.heights,
        laws=run.law_bytes,
        steps=tuple(run.steps),
        position=run.position,
        state=state,
    )


def with_journal(checkpoint: Checkpoint, path: Path) -> Checkpoint:
    """Return a checkpoint with the load steps that a journal has beyond it.

    Args:
        checkpoint: The checkpoint.
        path: The journal; it may be missing, or of another run.
    """
    for step, position, state in journalled(path, checkpoint.run):
        if step.step == len(checkpoint.steps) + 1:
            steps = (*checkpoint.steps, step)
            checkpoint = replace(checkpoint, steps=steps, position=position, state=state)
    return checkpoint


def refuse_changes(then: Checkpoint, now: Checkpoint, path: Path) -> None:
    """Refuse to go on with a scene other than the checkpoint's.

    Args:
        then: The checkpoint.
        now: What one of the present scene is.
        path: File of the checkpoint.

    Raises:
        InputError: When a key has changed that can matter; names it, and what it was.
    """
    refuse_changed_keys(then.scene, now.scene, path)
    if then.heights != now.heights:
        raise InputError(
            f"the heights are not those that the run in {path.parent} began with; restore them, or "
            "run without --resume to begin anew",
            key="surface.file",
            value=now.scene["surface"].get("file"),
        )


def refuse_changed_keys(then: dict[str, Any], now: dict[str, Any], path: Path) -> None:
    """Refuse to go on with a scene that says something else.

    Args:
        then: The scene as the run began with it, as nested dictionaries.
        now: The present one.
        path: File of the checkpoint.

    Raises:
        InputError: When a key has changed that can matter; names it, and what it was.
    """
    old, new = dict(_flat(then)), dict(_flat(now))
    for key in dict.fromkeys((*new, *old)):
        if not key.startswith("output.") and old.get(key) != new.get(key):
            raise InputError(
                f"is not what the run in {path.parent} began with; restore it, or run without "
                "--resume to begin anew",
                key=key,
                value=new.get(key),
                allowed=repr(old.get(key)),
            )


def kept_choices(folder: Path, scene: Scene) -> dict[str, Any] | None:
    """Return what the open keys of an interrupted run's scene became; None without a checkpoint.

    Args:
        folder: Folder of its results.
        scene: The present scene: choices for another would not fit it.

    Raises:
        InputError: When the checkpoint is damaged, or of another scene.
    """
    path = folder / CHECKPOINT
    if not path.exists():
        return None
    kept = read_checkpoint(path)
    refuse_changed_keys(kept.scene, scene.model_dump(by_alias=True, mode="json"), path)
    return kept.settled


def is_finished(folder: Path, run: Run) -> bool:
    """Tell whether the results in a folder are those of a finished run of the same scene.

    Args:
        folder: The folder.
        run: A run of the scene.
    """
    now = checkpoint_of(run, "", {})
    try:
        facts = json.loads((folder / "provenance.json").read_text(encoding="utf-8"))
        then = replace(now, scene=facts["scene_given"], heights=facts["surface"]["heights_sha256"])
        refuse_changes(then, now, folder / CHECKPOINT)
        return bool(facts["finished"])
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        # InputError is a ValueError
        return False


def _flat(scene: dict[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for name, value in scene.items():
        if isinstance(value, dict):
            yield from _flat(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", value
