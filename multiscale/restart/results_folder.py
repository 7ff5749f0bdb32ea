"""The results folder of a run: one run at a time writes to it, and another may go on from it."""

from __future__ import annotations

import errno
import json
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from filelock import FileLock, Timeout

from geometry.collective import on_root
from geometry.errors import InputError
from multiscale.removed import refuse_removed_results, without_removed
from multiscale.restart.checkpoint import FILE_NAME, Checkpoint, read_checkpoint
from multiscale.run import Run
from multiscale.scene.keys import dotted
from multiscale.scene.scene import Scene

_NAME = ".lock"
_ATTEMPTS = 10  # while others make and remove the folder
_PATIENCE = 0.2  # for another run that is just ending [s]
_MOST_SHOWN = 3  # keys that differ between two scenes
_NO_LOCKS = (errno.ENOLCK, errno.ENOTSUP, errno.ENOSYS)


@contextmanager
def locked(folder: Path, comm: Any) -> Iterator[FolderLock]:
    """Hold the lock on a folder, by rank 0 for all.

    Args:
        folder: The folder; made when missing.
        comm: MPI communicator, or None.

    Yields:
        The lock, for rank 0 to use.

    Raises:
        InputError: When another run holds it, or the folder cannot be written to.

    Note:
        Collective.
    """
    lock = FolderLock(folder)
    on_root(comm, lock.hold)
    try:
        yield lock
    finally:
        lock.release()


class FolderLock:
    """A lock on a folder of results, which the system lifts when the process ends, however it does.

    A missing folder is made, with those above it, and removed again when nothing was written to
    it. Where the file system has no locks, nothing is locked: a lock that outlives a killed run
    would be worse.

    Args:
        folder: The folder.
    """

    def __init__(self, folder: Path) -> None:
        self._path = folder / _NAME
        self._lock = FileLock(
            self._path, _PATIENCE, thread_local=False, poll_interval=0.02, fallback_to_soft=False
        )
        self._file: os.stat_result | None = None
        self._made: list[Path] = []

    def hold(self) -> None:
        """Take the lock; do nothing when it is held and its file is still there.

        Raises:
            InputError: When another process holds it, or the folder cannot be written to.
        """
        if self._is_held():
            return
        self._lock.release()
        for _ in range(_ATTEMPTS):
            try:
                self._made += [folder for folder in self._path.parents if not folder.exists()]
                self._path.parent.mkdir(parents=True, exist_ok=True)
                self._lock.acquire()
                self._file = os.stat(self._path)
                return
            except Timeout:
                problem = "another run is writing to this folder"
                break
            except OSError as error:
                if error.errno in _NO_LOCKS:
                    return
                problem = f"cannot be written to: {error.strerror}"
                if isinstance(error, FileExistsError | NotADirectoryError):
                    problem = "is not a folder"
                if not isinstance(error, FileNotFoundError):
                    break
                self._lock.release()  # another run removed the folder between two of these calls
        self.release()
        raise InputError(problem, key="--out", value=str(self._path.parent))

    def release(self) -> None:
        """Lift the lock and leave nothing of it."""
        if self._is_held():
            with suppress(OSError):  # in a folder that became read-only the file stays
                self._path.unlink(missing_ok=True)
        self._lock.release()
        self._file = None
        with suppress(OSError):  # results are there, or a folder is gone
            for folder in self._made:
                folder.rmdir()

    def _is_held(self) -> bool:
        """Whether this lock is on the file of that name: others may have removed or made it."""
        try:
            return self._file is not None and os.path.samestat(os.stat(self._path), self._file)
        except OSError:
            return False


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
    try:
        refuse_removed_results(found.scene)
    except InputError as error:
        raise error.located(file=str(path)) from None
    _refuse_changed_keys(folder, scene, found.scene)
    return found


def go_on(run: Run, found: Checkpoint, folder: Path) -> None:
    """Let a run go on from a checkpoint of the same scene.

    Args:
        run: The run, made with the resolved values of the checkpoint; nothing of it made yet.
        found: The checkpoint.
        folder: Folder of the results, for messages.

    Raises:
        InputError: When the heights or the meshes have changed.
    """
    _refuse_changed_heights(folder, run, found.heights)
    _refuse_changed_meshes(folder, run, found.meshes)
    run.resume(found.steps, found.position, found.state, found.laws, found.contacts)


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
        meshes = [one["mesh_sha256"] for one in facts.get("bodies", ())]
        _refuse_changed_meshes(folder, run, [one for one in meshes if one])
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


def _refuse_changed_meshes(folder: Path, run: Run, meshes: list[str]) -> None:
    """Refuse to go on with bodies other than those that a run began with."""
    if meshes != run.meshes:
        body, counter = run.given.body, run.given.counter_body
        key, section = ("body.mesh", body) if body else ("counter_body.mesh", counter)
        raise InputError(
            f"the meshes are not those that the run in {folder} began with; restore them, or run "
            "without --resume to begin anew",
            key=key,
            value=section and section.mesh,
        )


def _refuse_changed_keys(folder: Path, now: Scene, then: dict[str, Any]) -> None:
    """Refuse to go on with a scene in which a key has changed that can matter."""
    for key, new, old in _changes(now, then):
        raise InputError(
            f"is not what the run in {folder} began with; restore it, or run without --resume and "
            "with --overwrite to begin anew",
            key=key,
            value=new,
            allowed=repr(old),
        )


def refuse_other_results(folder: Path, scene: Scene) -> None:
    """Refuse to replace the results of another scene, finished or not.

    Args:
        folder: The folder.
        scene: The scene whose results are to be written.

    Raises:
        InputError: When the folder holds results of another scene; names the first keys that
            differ. Results of the same scene, and what is not understood, may be replaced.
    """
    then = without_removed(_scene_of_results(folder))
    known = dict(dotted(then))  # a key that an earlier version did not have is no difference
    differing = [change for change in _changes(scene, then) if change[0] in known]
    if differing:
        shown = ", ".join(f"{key} was {old!r}" for key, _, old in differing[:_MOST_SHOWN])
        more = f" and {len(differing) - _MOST_SHOWN} more" * (len(differing) > _MOST_SHOWN)
        raise InputError(
            f"holds results of another scene, where {shown}{more}",
            key="--out",
            value=str(folder),
            allowed="another folder, or --overwrite",
        )


def _scene_of_results(folder: Path) -> dict[str, Any]:
    """Return the scene, as given, whose results a folder holds; nothing where it has none."""
    try:
        path = folder / "provenance.json"
        if path.is_file():
            found = json.loads(path.read_text(encoding="utf-8"))["scene_given"]
            return found if isinstance(found, dict) else {}
        path = folder / FILE_NAME
        return read_checkpoint(path).scene if path.exists() else {}
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return {}  # InputError is a ValueError


def _changes(now: Scene, then: dict[str, Any]) -> Iterator[tuple[str, Any, Any]]:
    """Yield the keys that have changed and can matter, with their present and former values."""
    old = dict(dotted(without_removed(then)))
    new = dict(dotted(now.model_dump(by_alias=True, mode="json")))
    for key in dict.fromkeys((*new, *old)):
        if not key.startswith("output.") and old.get(key) != new.get(key):
            yield key, new.get(key), old.get(key)
