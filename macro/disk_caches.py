"""What is kept on disk for this user: compiled forms, and solutions of the elastic block.

Forms are run. They are loaded where nobody but this user or root could write them, and where their
bytes fit the checksum that was written beside them when they were compiled.

Solutions stand under a key of everything that they depend on, the sources of the packages that make
them included: other sources do not find the files. A file is believed when its bytes fit its
checksum, it states that key, and nobody but this user or root could write it: where several users
share a directory, each reads its own files alone.
"""

from __future__ import annotations

import os
import re
import stat
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any

from patchlaw.support import Array, InputError, NotWritten, place_in
from patchlaw.support.files import fingerprint, read_record, write_record, write_text

TIMEOUT = 60
"""Seconds that a process waits for another one that compiles the same form."""

_OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH
_OTHERS_ENTER = stat.S_IXGRP | stat.S_IXOTH
_ROOT = 0
_TICK = 2.0
"""Seconds within which files may come to a folder and leave its time as it is."""
_SUM = ".sha256"
_checked: set[tuple[str, int, int]] = set()
"""Compiled forms that this process has checked: names, times and sizes."""
_unchanged: dict[Path, int | None] = {}
"""Folders that nobody else can enter, and when files last came into them, or went, as checked."""


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
    before = _changed(folder)
    with explained(folder):
        yield
    if before is not None and _changed(folder) == before:
        return  # nothing was compiled
    with suppress(OSError):  # one that cannot be written to has them already
        names = set(os.listdir(folder))
        for name in sorted(filter(_is_form, names)):
            if name.removesuffix(".so") + _SUM in names:
                continue
            form = folder / name
            if f"{_source(form).name}.cached" in names:
                beside = form.with_suffix(_SUM)
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
    if hidden and _unchanged.get(folder) == facts.st_mtime_ns:
        return  # looking at each of thousands of forms took longer than to load one
    entries: list[os.DirEntry[str]] = []
    with suppress(PermissionError):
        entries = list(os.scandir(folder))
    for entry in entries:  # thousands, in years: paths are made of those alone that are new
        if not _is_form(entry.name):
            continue
        with suppress(FileNotFoundError):  # another process removed it
            here = entry.stat()
            identity = (entry.path, here.st_ctime_ns, here.st_size)  # modes count too
            if identity in _checked:
                continue
            form = folder / entry.name
            safe = _is_own(here) and (hidden or not here.st_mode & _OTHERS_WRITE)
            if not (safe and _is_whole(form, here.st_mtime)):
                _remove(form)
            else:
                _checked.add(identity)
    settled = time.time() - facts.st_mtime > _TICK  # what comes at once has the same time
    _unchanged[folder] = facts.st_mtime_ns if settled else None


def _is_own(facts: os.stat_result) -> bool:
    return facts.st_uid in (os.geteuid(), _ROOT)  # the administrator may fill it for all


def _changed(folder: Path) -> int | None:
    """Return when files came into a folder, or went, last; None where nobody knows."""
    with suppress(OSError):
        return folder.stat().st_mtime_ns
    return None


def _is_form(name: str) -> bool:
    return name.startswith("libffcx_") and name.endswith(".so")


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


Arrays = Mapping[str, Array]

VARIABLE = "PATCHLAW_CACHE"
"""Environment variable: the cache's directory, or ``off``."""

MOST_BYTES = 500_000_000
"""Largest size of all files together; beyond it the least recently used are removed [B]."""

_SUFFIX = ".arrays"
_NAME = re.compile(r"\.?[a-z-]+-([0-9a-f]{32})(?:\.partial-[0-9a-f]{32})?\.arrays")
"""Names of files, whole and of killed processes."""
_BEGINNING = re.compile(rb'[0-9a-f]{64} [0-9]+\n\{"value": \{"key": "([0-9a-f]{64})", "arrays": ')
_LONGEST_BEGINNING = 256

_SOURCES = "macro", "micro", "geometry"
"""Packages whose sources make the cached arrays."""

_TOP = Path(__file__).resolve().parents[1]


def cache_directory() -> Path | None:
    """Return the cache's directory, None when the user switched the cache off or has no home.

    There is none on Windows, which does not say whose a file is.

    ``PATCHLAW_CACHE`` wins, then ``XDG_CACHE_HOME/patchlaw``, then ``~/.cache/patchlaw``.
    """
    chosen = os.environ.get(VARIABLE, "")
    if chosen.lower() == "off" or not hasattr(os, "geteuid"):
        return None
    if chosen:
        return Path(chosen)
    try:
        return user_cache()
    except RuntimeError:
        return None


def cached(kind: str, key: tuple[object, ...], compute: Callable[[], Arrays], comm: Any) -> Arrays:
    """Return arrays from the cache, or compute and cache them.

    Rank 0 alone reads and writes, and all ranks get its arrays. Arrays whose file cannot be read,
    is damaged or could be another user's are computed again, and a file that cannot be written is
    left out.

    Args:
        kind: Name of the kind of arrays.
        key: Everything that they depend on: numbers, words, tuples and dataclasses of them.
        compute: Makes the arrays; collective. Those of rank 0 are used.
        comm: MPI communicator; None for this process alone.

    Raises:
        TypeError: When a key holds anything else, on every rank.

    Note:
        Collective.
    """
    words = fingerprint((sources_digest(), kind, key))  # a wrong key raises on every rank
    rank, _ = place_in(comm)
    path = _file(kind, words) if rank == 0 else None
    arrays = _of_root(comm, _read(path, words) if path else None)
    if arrays is not None:
        return arrays
    made = compute()
    if path:
        with suppress(OSError, NotWritten):
            _write(path, words, made)
            _clear(path.parent)
    return _of_root(comm, made)  # type: ignore[return-value]


def _of_root(comm: Any, arrays: Arrays | None) -> Arrays | None:
    """Return the arrays of rank 0."""
    if comm is None:
        return arrays
    from mpi4py.util import pkl5  # for arrays of more than 2³¹ bytes, as 128 × 128 patches have

    found: Arrays | None = pkl5.Intracomm(comm).bcast(arrays, root=0)
    return found


@cache
def sources_digest(top: Path = _TOP) -> str:
    """Return a digest of the sources of the packages that make the cached arrays.

    Args:
        top: Folder of the packages.
    """
    digest = sha256()
    for package in _SOURCES:
        for path in sorted((top / package).rglob("*.py")):
            digest.update(path.relative_to(top).as_posix().encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()


def _file(kind: str, words: str) -> Path | None:
    """Return the file of arrays by the fingerprint of all that they depend on."""
    directory = cache_directory()
    return directory / f"{kind}-{words[:32]}{_SUFFIX}" if directory else None


def _read(path: Path, words: str) -> Arrays | None:
    """Return the arrays of a file that is this user's and says what they depend on, else None."""
    with suppress(OSError, InputError), open(path, "rb", opener=_opened_at_once) as file:
        facts = os.fstat(file.fileno())
        if not stat.S_ISREG(facts.st_mode) or facts.st_mode & _OTHERS_WRITE or not _is_own(facts):
            return None
        record = read_record(file.read())
        if record["key"] == words:
            os.utime(path)  # marks it as recently used
            arrays: Arrays = record["arrays"]
            return arrays
    return None


def _opened_at_once(path: str, flags: int) -> int:
    """Open a file without waiting for the writer of a pipe."""
    return os.open(path, flags | os.O_NONBLOCK)


def _write(path: Path, words: str, arrays: Arrays) -> None:
    """Write a file that this user alone may change, unless it would not stay."""
    if sum(array.nbytes for array in arrays.values()) > MOST_BYTES:
        return
    path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    write_record(path, {"key": words, "arrays": arrays})
    path.chmod(0o600)


def _clear(directory: Path) -> None:
    """Remove the least recently used of this user's files until the rest is small enough.

    The folder may be one of the user's: only what `_write` wrote counts, and is removed.
    """
    found = [(path, path.lstat()) for path in directory.iterdir() if _is_written_here(path)]
    total = 0
    for path, facts in sorted(found, key=lambda one: one[1].st_mtime, reverse=True):
        total += facts.st_size
        if total > MOST_BYTES:
            path.unlink(missing_ok=True)


def _is_written_here(path: Path) -> bool:
    """Whether a file is one of the cache by its whole name and by the key that it begins with."""
    named = _NAME.fullmatch(path.name)
    if named is None or path.is_symlink() or path.lstat().st_uid != os.geteuid():
        return False
    with suppress(OSError), open(path, "rb", opener=_opened_at_once) as file:
        begun = _BEGINNING.match(file.read(_LONGEST_BEGINNING))
        return begun is not None and begun[1][: len(named[1])] == named[1].encode()
    return False
