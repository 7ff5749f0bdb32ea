"""The cache of compiled forms: stale locks, access, the compiler, and errors with a remedy."""

from __future__ import annotations

import os
import shlex
import shutil
import sysconfig
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from support.errors import InputError

TIMEOUT = 60
"""Seconds that a process waits for another one that compiles the same form."""


def stale_locks(folder: Path, older_than: float = 2.0 * TIMEOUT) -> list[Path]:
    """Return sources whose compilation was interrupted.

    The first process that needs a form writes its source, and others wait for the mark that it is
    compiled. With an old source without a mark they would wait until they time out.

    Args:
        folder: Folder of the compiled forms; need not exist.
        older_than: Age beyond which no process can be compiling any more [s].
    """
    latest = time.time() - older_than
    left = []
    with suppress(PermissionError):  # without access there are no locks of this user
        for source in folder.glob("libffcx_*.c"):
            with suppress(FileNotFoundError):  # another process may remove it meanwhile
                marked = source.with_suffix(".c.cached").exists()
                if not marked and source.stat().st_mtime < latest:
                    left.append(source)
    return sorted(left)


def compiled(folder: Path) -> int:
    """Count the compiled forms in a folder, which need not exist."""
    with suppress(PermissionError):  # a folder on the way that this user may not enter
        return len(list(folder.glob("libffcx_*.c.cached")))
    return 0


def writable(folder: Path) -> bool:
    """Return whether a folder, or its nearest existing parent, can be written to."""
    try:
        nearest = next(path for path in (folder, *folder.absolute().parents) if path.exists())
        return nearest.is_dir() and os.access(nearest, os.W_OK | os.X_OK)
    except OSError:  # a folder on the way that this user may not enter
        return False


def compiler() -> str | None:
    """Return the path of the C compiler that forms are compiled with; None without one."""
    words = shlex.split(os.environ.get("CC") or sysconfig.get_config_var("CC") or "cc")
    return shutil.which(words[0])


@contextmanager
def explained(folder: Path) -> Iterator[None]:
    """Turn an error of the form compiler into one that says what to do.

    Args:
        folder: Folder of the compiled forms.

    Raises:
        InputError: In place of the compiler's own error.
    """
    try:
        yield
    except Exception as error:
        if not _is_the_compilers(error):
            raise
        detail = str(error).strip().splitlines()[-1]
        raise InputError(
            f"a form cannot be compiled ({detail}); {_remedy(folder, detail)}", key="form compiler"
        ) from error


def _remedy(folder: Path, detail: str) -> str:
    """Return what to do, from the state of the cache and the last line of the error."""
    if stale_locks(folder, older_than=0.0):
        return f"a compilation was cut short in {folder}: patchlaw warm clears it"
    if "[Errno" in detail or not writable(folder):
        return f"{folder} cannot be written to: set XDG_CACHE_HOME to a folder that can"
    return "mend the C compiler, or run patchlaw warm where there is one; see patchlaw doctor"


def _is_the_compilers(error: Exception) -> bool:
    """Return whether the form compiler failed; on several ranks dolfinx wraps its errors."""
    wrapped = isinstance(error, RuntimeError) and "just-in-time compilation" in str(error)
    return wrapped or isinstance(error, OSError) or type(error).__name__ == "VerificationError"
