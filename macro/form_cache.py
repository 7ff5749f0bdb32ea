"""The cache of compiled forms: trust, stale locks, access, errors with a remedy.

What is in it is run. Forms are loaded where nobody but this user or root could write them, and
where their bytes fit the checksum that was written beside them when they were compiled.
"""

from __future__ import annotations

import os
import stat
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from hashlib import sha256
from pathlib import Path

from patchlaw.support.errors import InputError
from patchlaw.support.files import write_text

TIMEOUT = 60
"""Seconds that a process waits for another one that compiles the same form."""

_OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH
_OTHERS_ENTER = stat.S_IXGRP | stat.S_IXOTH
_ROOT = 0
_SUM = ".sha256"
_checked: set[tuple[str, int, int]] = set()
"""Compiled forms that this process has checked: names, times and sizes."""


def user_cache() -> Path:
    """Return the folder of all that is cached for this user.

    Raises:
        RuntimeError: When the user has no home.
    """
    home = os.environ.get("XDG_CACHE_HOME", "")
    return (Path(home) if os.path.isabs(home) else Path.home() / ".cache") / "patchlaw"


def form_folder() -> Path:
    """Return the folder of the compiled forms, in which there are those of patchlaw alone."""
    return user_cache() / "forms"


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


@contextmanager
def trusted(folder: Path) -> Iterator[None]:
    """Compile forms, or load those of a folder that can be trusted; explain what goes wrong.

    Forms that are damaged, or that others could write, are removed before and compiled anew.

    Args:
        folder: Folder of the compiled forms; made when missing, for this user alone.

    Raises:
        InputError: When others can write to the folder, or forms cannot be compiled.
    """
    with suppress(OSError):  # which the compiler meets too
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    _check(folder)
    with explained(folder):
        yield
    with suppress(OSError):  # one that cannot be written to has them already
        for form in _forms(folder):
            beside = form.with_suffix(_SUM)
            if _source(form).with_suffix(".c.cached").exists() and not beside.exists():
                form.chmod(form.stat().st_mode & ~_OTHERS_WRITE)
                write_text(beside, sha256(form.read_bytes()).hexdigest())


def _check(folder: Path) -> None:
    """Refuse a folder that others can write to, and remove forms that are not to be loaded."""
    try:
        facts = folder.stat()
    except OSError:  # there is none
        return
    if not _is_own(facts) or facts.st_mode & _OTHERS_WRITE:
        raise InputError(
            "others can write to this folder, and what is compiled there is run",
            key="form compiler",
            value=str(folder),
            allowed=f"chmod 700 {folder}, or XDG_CACHE_HOME in a folder of your own",
        )
    hidden = not facts.st_mode & _OTHERS_ENTER
    for form in _forms(folder):
        with suppress(FileNotFoundError):  # another process removed it
            here = form.stat()
            identity = (str(form), here.st_ctime_ns, here.st_size)  # modes count too
            if identity in _checked:
                continue
            safe = _is_own(here) and (hidden or not here.st_mode & _OTHERS_WRITE)
            if not (safe and _is_whole(form, here.st_mtime)):
                _remove(form)
            else:
                _checked.add(identity)


def _is_own(facts: os.stat_result) -> bool:
    return facts.st_uid in (os.geteuid(), _ROOT)  # the administrator may fill it for all


def _forms(folder: Path) -> list[Path]:
    return sorted(folder.glob("libffcx_*.so"))


def _source(form: Path) -> Path:
    return form.with_name(f"{form.name.partition('.')[0]}.c")


def _is_whole(form: Path, written: float) -> bool:
    """Whether a form fits its checksum; one without is being compiled, or was when that ended."""
    try:
        kept = form.with_suffix(_SUM).read_text(encoding="ascii", errors="replace")
    except FileNotFoundError:
        return time.time() - written < 2.0 * TIMEOUT
    return kept == sha256(form.read_bytes()).hexdigest()


def _remove(form: Path) -> None:
    """Remove a compiled form and what says that it is compiled."""
    source = _source(form)
    try:
        for path in (source.with_suffix(".c.cached"), form, form.with_suffix(_SUM), source):
            path.unlink(missing_ok=True)
    except OSError as error:
        raise InputError(
            "is not as it was compiled, or others can write it, and cannot be removed",
            key="form compiler",
            value=str(form),
        ) from error


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
