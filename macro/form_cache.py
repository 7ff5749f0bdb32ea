"""The cache of compiled forms: where it is, what can be wrong with it, and what to do then."""

from __future__ import annotations

import os
import shlex
import shutil
import sysconfig
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from geometry.errors import InputError

TIMEOUT = 60
"""Seconds that a process waits for another one that compiles the same form."""


def stale_locks(folder: Path, older_than: float = 2.0 * TIMEOUT) -> list[Path]:
    """Return sources whose compilation was cut short.

    The first process that wants a form makes its source; others wait for the mark that it is
    compiled. A source without mark, made long ago, would keep everybody waiting in vain.

    Args:
        folder: Folder of the compiled forms; need not exist.
        older_than: Age from which on nobody can be at work any more [s].
    """
    latest = time.time() - older_than
    left = []
    with suppress(PermissionError):  # nobody who may not enter it compiles there
        for source in folder.glob("libffcx_*.c"):
            with suppress(FileNotFoundError):  # another process tidies up as well
                marked = source.with_suffix(".c.cached").exists()
                if not marked and source.stat().st_mtime < latest:
                    left.append(source)
    return sorted(left)


def writable(folder: Path) -> bool:
    """Tell whether a folder, or the nearest one above that exists, can be written to."""
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
    """Turn what the form compiler raises into an error that says what to do.

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
    """Return what to do, judged by the state of the cache and the last line of the error."""
    if stale_locks(folder, older_than=0.0):
        return f"a compilation was cut short in {folder}: patchlaw warm clears it"
    if "[Errno" in detail or not writable(folder):
        return f"{folder} cannot be written to: set XDG_CACHE_HOME to a folder that can"
    return "mend the C compiler, or run patchlaw warm where there is one; see patchlaw doctor"


def _is_the_compilers(error: Exception) -> bool:
    """Tell errors of the form compiler from bugs; with several ranks dolfinx wraps them."""
    wrapped = isinstance(error, RuntimeError) and "just-in-time compilation" in str(error)
    return wrapped or isinstance(error, OSError) or type(error).__name__ == "VerificationError"
