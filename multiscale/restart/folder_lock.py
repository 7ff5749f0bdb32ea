"""Keeps two runs out of one folder."""

from __future__ import annotations

import errno
import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from geometry.collective import on_root
from geometry.errors import InputError

_NAME = ".lock"
_ATTEMPTS = 10
_NO_LOCKS = (errno.ENOLCK, errno.ENOTSUP, errno.ENOSYS)


@contextmanager
def locked(folder: Path, comm: Any) -> Iterator[FolderLock]:
    """Hold the lock on a folder, by rank 0 for all.

    Args:
        folder: The folder; made when missing.
        comm: MPI communicator, or None.

    Yields:
        The lock, which is rank 0's to use.

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

    A folder that is missing is made; it is removed again when nothing was written to it. Where
    the file system has no locks, there is none.

    Args:
        folder: The folder.
    """

    def __init__(self, folder: Path) -> None:
        self._path = folder / _NAME
        self._file: int | None = None
        self._made = False

    def hold(self) -> None:
        """Take the lock, also again when the folder was removed in the meantime.

        Raises:
            InputError: When another process holds it, or the folder cannot be written to.
        """
        for attempt in range(_ATTEMPTS):
            if self._holds():
                return
            try:
                self._made |= not self._path.parent.exists()
                self._path.parent.mkdir(parents=True, exist_ok=True)
                self._lock()
            except BlockingIOError:
                raise self._refused("another run is writing to this folder") from None
            except OSError as error:
                removed = isinstance(error, FileNotFoundError)  # between two calls, by its holder
                if not removed or attempt == _ATTEMPTS - 1:
                    raise self._refused(f"cannot be written to: {error.strerror}") from None

    def release(self) -> None:
        """Lift the lock and leave nothing of it."""
        if self._file is None:
            return
        with suppress(OSError):  # the folder may have become read-only; the lock is lifted anyway
            if self._holds():
                self._path.unlink(missing_ok=True)
        os.close(self._file)
        self._file = None
        if self._made:
            with suppress(OSError):  # results are there, or the folder is gone
                self._path.parent.rmdir()

    def _lock(self) -> None:
        file = os.open(self._path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            if error.errno not in _NO_LOCKS:
                os.close(file)
                raise
        if self._file is not None:
            os.close(self._file)
        self._file = file

    def _holds(self) -> bool:
        """Whether the lock is held, and on the file of that name: its last holder removes it."""
        if self._file is None:
            return False
        try:
            return os.path.samestat(os.stat(self._path), os.fstat(self._file))
        except OSError:
            return False

    def _refused(self, problem: str) -> InputError:
        return InputError(problem, key="--out", value=str(self._path.parent))
