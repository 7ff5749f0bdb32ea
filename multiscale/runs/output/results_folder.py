"""The results folder of a run: its lock, its checkpoint, and whose results it holds.

One run at a time writes to it, and another may go on from it.
"""

from __future__ import annotations

import errno
import json
import os
import re
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from hashlib import sha256
from pathlib import Path
from typing import Any

from patchlaw.geometry import Control, ShearControl, ShearState
from patchlaw.micro import RigidPlane, Start
from patchlaw.multiscale.loading.column import Leak, Mode
from patchlaw.multiscale.loading.load_step import LoadStep, PatchState
from patchlaw.multiscale.models.problem import Position
from patchlaw.multiscale.results.contacts import ContactRecord
from patchlaw.multiscale.runs.scene_run import LAYOUT, Checkpoint, Run
from patchlaw.multiscale.scene.scene import (
    CONTENT,
    GONE,
    VERSION,
    Change,
    Scene,
    changes,
    flat_identity,
    identity,
    told,
)
from patchlaw.support import InputError, NotWritten, on_root
from patchlaw.support.files import read_bytes, read_record, remove, remove_partial, write_record

_LOCK = ".lock"
_OUTPUT = "output."
_LONGEST = 120  # bytes of what was set, in the name of a folder
_ODD = re.compile(r"[^\w.=+-]+")  # characters that shells or file systems may not take
_READ_OR_MAKE = os.O_RDWR | os.O_CREAT
_NO_LOCKS = (errno.ENOLCK, errno.ENOTSUP, errno.ENOSYS, errno.EBADF, errno.EISDIR, errno.EINVAL)
"""Errors of file systems without locks, or, the latter, without locks on folders."""


def folder_name(scene: str, overrides: Sequence[str] = (), ending: str = "") -> str:
    """Return what the folder of results is called where the user names none.

    Keys that were set make another folder, so that results of different scenes do not meet; those
    of ``[output]`` make no other scene, and no other folder.

    Args:
        scene: Name of the scene.
        overrides: ``key=value`` strings with dotted keys, as for `Scene.load`.
        ending: What follows after all.
    """
    pairs = (text.partition("=") for text in overrides)
    values = {key.strip(): value.strip() for key, _, value in pairs}  # the last of a key counts
    kept = (key for key in sorted(values) if not f"{key}.".startswith(_OUTPUT))
    changed = [f"{key}={values[key]}" for key in kept]
    name = "".join(f"-{_ODD.sub('_', text).strip('_')}" for text in changed)
    if len(name.encode()) > _LONGEST:
        digest = sha256(repr(changed).encode()).hexdigest()[:8]
        name = f"{name.encode()[:_LONGEST].decode(errors='ignore')}-{digest}"
    return f"{scene}{name}{ending}"


@contextmanager
def locked(folder: Path, comm: Any, *, shared: bool = False) -> Iterator[FolderLock]:
    """Hold the lock on a folder, by rank 0 for all.

    Args:
        folder: The folder; made when missing.
        comm: MPI communicator, or None.
        shared: Whether others that share the folder may hold it too, as the parts of a sweep do.

    Yields:
        The lock, for rank 0 to use.

    Raises:
        InputError: When another run holds it, or the folder cannot be written to.

    Note:
        Collective.
    """
    lock = FolderLock(folder, shared=shared)
    on_root(comm, lock.hold)
    try:
        yield lock
    finally:
        lock.release()


class FolderLock:
    """A lock on a folder of results, which the system lifts when the process ends, however it does.

    The folder itself is locked, so that a killed process leaves nothing of it. Network file systems
    that lock no folders (NFS) get a file ``.lock`` instead. A missing folder is made, with those
    above it, and removed again when nothing was written to it. Where the file system has no locks,
    nothing is locked, nor on Windows: a lock that outlives a killed run would be worse.

    Args:
        folder: The folder.
        shared: Whether others that share the folder may hold it at the same time.
    """

    def __init__(self, folder: Path, *, shared: bool = False) -> None:
        self._folder, self._locked = folder, folder
        self._shared = shared
        self._handle: int | None = None
        self._made: list[Path] = []

    def hold(self) -> None:
        """Take the lock; do nothing when it is held on the folder that is there.

        Raises:
            InputError: When another process holds it, or the folder cannot be written to.
        """
        until = time.monotonic() + 0.2  # for a run that is just ending, or removes the folder
        while not self._is_held():
            problem, passing = "is removed by another run", True
            try:
                self._make_folder()
                if not self._take() or self._is_held():
                    return
            except BlockingIOError:
                problem = "another run is writing to this folder"
            except (FileExistsError, NotADirectoryError):
                problem, passing = "is not a folder", False
            except OSError as error:  # a folder may be removed between two of these calls
                problem = f"cannot be written to: {error.strerror}"
                passing = isinstance(error, FileNotFoundError)
            if not passing or time.monotonic() > until:
                self.release()
                raise InputError(problem, key="--out", value=str(self._folder))
            time.sleep(0.02)

    def share(self) -> None:
        """Let others that share the folder hold it too, from now on.

        Raises:
            InputError: When another process took the lock at this moment.
        """
        self._shared = True
        if self._handle is not None:
            self._close()
            self.hold()

    def release(self) -> None:
        """Lift the lock and leave nothing of it."""
        if self._locked != self._folder and self._handle is not None and self._is_held():
            import fcntl

            with suppress(OSError):  # others share the file, or the folder became read-only
                fcntl.flock(self._handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
                self._locked.unlink(missing_ok=True)
        self._close()
        with suppress(OSError):  # results are there, or a folder is gone
            for folder in self._made:
                folder.rmdir()

    def _make_folder(self) -> None:
        above = [self._folder, *self._folder.parents]
        self._made += [folder for folder in above if not folder.exists()]
        self._folder.mkdir(parents=True, exist_ok=True)
        if not os.access(self._folder, os.W_OK | os.X_OK):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))

    def _take(self) -> bool:
        """Lock the folder or, where that cannot be, the file in it; return False without locks."""
        self._close()
        try:
            import fcntl
        except ImportError:
            return False
        way = fcntl.LOCK_SH if self._shared else fcntl.LOCK_EX
        for path, flags in ((self._folder, os.O_RDONLY), (self._folder / _LOCK, _READ_OR_MAKE)):
            handle = os.open(path, flags, 0o666)
            try:
                fcntl.flock(handle, way | fcntl.LOCK_NB)
            except OSError as error:
                os.close(handle)
                if error.errno not in _NO_LOCKS:
                    raise
            else:
                self._locked, self._handle = path, handle
                return True
        return False

    def _close(self) -> None:
        if self._handle is not None:
            os.close(self._handle)
        self._handle = None

    def _is_held(self) -> bool:
        """Whether this lock is on what has its name: others may have removed or made it."""
        try:
            return self._handle is not None and os.path.samestat(
                os.stat(self._locked), os.fstat(self._handle)
            )
        except OSError:
            return False


FILE_NAME = "checkpoint.state"

LEAST_INTERVAL = 1.0
"""Least wall time between two writes [s]; a kill loses the load steps of this time."""
LEAST_RATIO = 20.0
"""Least wall time between two writes over that of a write; so writing takes 5 % at most."""


def _kinds() -> tuple[type, ...]:
    """Return what a checkpoint may consist of: its own records, and those of states of models."""
    from patchlaw.geometry.sliders import SliderRecord, SliderState
    from patchlaw.multiscale.laws.interpolation import LawPoint
    from patchlaw.multiscale.models.loaded_patches import DenseState

    own = Checkpoint, Control, Position, LoadStep, Mode, ContactRecord, Leak, PatchState
    of_states = DenseState, LawPoint, RigidPlane, ShearControl, ShearState, Start
    return *own, *of_states, SliderRecord, SliderState


def read_checkpoint(path: Path) -> Checkpoint:
    """Read a checkpoint.

    Args:
        path: The file.

    Raises:
        InputError: When it is none, is of another version or damaged.
    """
    try:
        found = read_record(read_bytes(path), _kinds())
        if not isinstance(found, Checkpoint):
            problem = "is no checkpoint"
        elif found.layout != LAYOUT:
            problem = "was written by another patchlaw"
        else:
            return found
    except InputError as error:
        problem = error.problem
    except OSError as error:
        problem = f"cannot be read: {error.strerror}"
    raise InputError(f"{problem}; remove it, or begin anew with --overwrite", file=str(path))


class CheckpointWriter:
    """Writes the checkpoint of a run to its results folder.

    Every accepted load step is kept in memory, and written at once unless the beginning or the last
    write was less than a second ago, or 20 times the duration of that write. What is not written
    yet is written when an error or a signal ends the run. A process that is killed loses it, and
    the resumed run computes it again.

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
        self._due = self._first = time.monotonic() + LEAST_INTERVAL

    def __enter__(self) -> CheckpointWriter:
        """Return the writer."""
        return self

    def __exit__(self, *error: object) -> None:
        """Write what is not written yet, on rank 0; an error that ends the run is what to tell."""
        with suppress(NotWritten, MemoryError):
            self._write(0.0)

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
            self._pending = run.checkpoint(state)
            self._write(self._due)

        on_root(run.comm, keep)

    def finish(self) -> None:
        """Write what was accepted since the last write, of a run that took a second.

        Raises:
            NotWritten: When that fails; the earlier file stays.

        Note:
            Collective.
        """
        on_root(self._run.comm, lambda: self._write(self._first))

    def remove(self) -> None:
        """Remove the file and forget what is not written; the run needs it no longer.

        Note:
            Collective.
        """
        self._pending = None
        on_root(self._run.comm, lambda: remove(self.path))

    def _write(self, due: float) -> None:
        began = time.monotonic()
        if self._pending is None or began < due:
            return
        try:
            self._hold()  # again, where the folder was removed in the meantime
        except InputError as error:  # the folder was good when the run began
            raise NotWritten(f"{self.path.parent}: {error.problem}") from None
        remove_partial(self.path.parent)
        write_record(self.path, self._pending)
        self._pending = None
        now = time.monotonic()
        self._due = now + max(LEAST_INTERVAL, LEAST_RATIO * (now - began))


def find_checkpoint(folder: Path, scene: Scene) -> Checkpoint | None:
    """Return what an interrupted run of a scene left in its results folder; None without it.

    Args:
        folder: The folder.
        scene: The present scene.

    Raises:
        InputError: When the checkpoint is damaged, or anything that its numbers depend on has
            changed: a key of the scene, the content of a file that it names, the version.
    """
    path = folder / FILE_NAME
    if not path.exists():
        return None
    checkpoint = read_checkpoint(path)
    for key, new, old in changes(identity(scene), checkpoint.identity):
        if not key.startswith(_OUTPUT):
            raise InputError(
                f"is not what the run in {folder} began with; restore it, or begin anew with "
                "--overwrite",
                key=key,
                value=new,
                allowed=repr(old),
            )
    return checkpoint


def is_finished(folder: Path, now: Mapping[str, Any]) -> bool:
    """Tell whether the results in a folder are those of a finished run of the same scene.

    Args:
        folder: The folder.
        now: Identity of the scene.
    """
    then, finished = _results(folder)
    return finished and not _differing(now, then)


def refuse_other_results(folder: Path, now: Mapping[str, Any]) -> None:
    """Refuse to replace the results of another scene, finished or not.

    Args:
        folder: The folder.
        now: Identity of the scene whose results are to be written.

    Raises:
        InputError: When the folder holds results of another scene, or of other content of the files
            that it names; says what differs. Results of the same scene, and what is not understood,
            may be replaced.
    """
    if differing := _differing(now, _results(folder)[0]):
        raise InputError(
            f"holds results of another scene, where {told(differing)}",
            key="--out",
            value=str(folder),
            allowed="another folder, or --overwrite",
        )


def _results(folder: Path) -> tuple[dict[str, Any], bool]:
    """Return the identity of the scene whose results a folder holds, and if its run was finished.

    The identity is empty where results say nothing of it.
    """
    try:
        content = json.loads(read_bytes(folder / "provenance.json"))
        then = flat_identity(content["scene_given"], content.get("files", {}), content["patchlaw"])
        return then, content["finished"] is True
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return {}, False


def _differing(now: Mapping[str, Any], then: Mapping[str, Any]) -> list[Change]:
    """Return the changes by which results are those of another scene; none from an empty identity.

    A key that one of two versions does not have is no difference, nor is the version itself. A file
    whose content was not recorded is one.
    """
    return [
        (key, new, old)
        for key, new, old in changes(now if then else {}, then)
        if (key in then or key.startswith(CONTENT))
        and not (key in GONE or key.startswith((VERSION, _OUTPUT)))
    ]
