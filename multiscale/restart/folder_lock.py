"""Keeps two runs out of one folder."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from filelock import FileLock, Timeout

from geometry.collective import on_root
from geometry.errors import InputError

_NAME = ".lock"
_ATTEMPTS = 10  # while others make and remove the folder
_PATIENCE = 0.2  # for another run that is just ending [s]
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
