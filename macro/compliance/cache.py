"""Caches solutions of the elastic block on disk, under a key of everything that they depend on.

The key includes the sources of the packages that make them: other sources do not find the files. A
file is believed when its bytes fit its checksum, it states that key, and nobody but this user or
root could write it: where several users share a directory, each reads its own files alone.
"""

from __future__ import annotations

import hashlib
import os
import re
import stat
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from patchlaw.macro.disk_caches import user_cache
from patchlaw.support.errors import InputError, NotWritten
from patchlaw.support.files import fingerprint, read_record, write_record
from patchlaw.support.parallel import place_in

Arrays = Mapping[str, NDArray[np.float64]]

VARIABLE = "PATCHLAW_CACHE"
"""Environment variable: the cache's directory, or ``off``."""

MOST_BYTES = 500_000_000
"""Largest size of all files together; beyond it the least recently used are removed [B]."""

_SUFFIX = ".arrays"
_NAME = re.compile(r"\.?[a-z-]+-([0-9a-f]{32})(?:\.partial-[0-9a-f]{32})?\.arrays")
"""Names of files, whole and of killed processes."""
_BEGINNING = re.compile(rb'[0-9a-f]{64} [0-9]+\n\{"value": \{"key": "([0-9a-f]{64})", "arrays": ')
_LONGEST_BEGINNING = 256
_OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH

_SOURCES = "macro", "micro", "geometry"
"""Packages whose sources make the cached arrays."""

_TOP = Path(__file__).resolve().parents[2]


def cache_directory() -> Path | None:
    """Return the cache's directory, None when the user switched the cache off or has no home.

    ``PATCHLAW_CACHE`` wins, then ``XDG_CACHE_HOME/patchlaw``, then ``~/.cache/patchlaw``.
    """
    chosen = os.environ.get(VARIABLE, "")
    if chosen.lower() == "off":
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
    digest = hashlib.sha256()
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
        if not stat.S_ISREG(facts.st_mode) or facts.st_mode & _OTHERS_WRITE:
            return None
        if facts.st_uid not in (os.geteuid(), 0):  # the administrator may fill it for all
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
