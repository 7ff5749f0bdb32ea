"""Keeps what the elastic block was solved for on disk, under a key of all that it depends on.

That includes the code: files made by other sources of the packages that make them are not found.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import fields, is_dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py.util import pkl5
from numpy.typing import NDArray

Arrays = Mapping[str, NDArray[np.float64]]

VARIABLE = "PATCHLAW_CACHE"
"""Environment variable: the cache's directory, or ``off``."""

MOST_BYTES = 500_000_000
"""Size of all files together, beyond which those go that were not used for longest [B]."""

_FORMAT = 3  # of the files; the code that fills them counts by itself

_SOURCES = "macro", "geometry"
"""Packages that make what is kept."""


def cache_directory() -> Path | None:
    """Return where results are kept, None when the user switched the cache off or has no home.

    ``PATCHLAW_CACHE`` wins, then ``XDG_CACHE_HOME/patchlaw``, then ``~/.cache/patchlaw``.
    """
    chosen = os.environ.get(VARIABLE, "")
    if chosen.lower() == "off":
        return None
    if chosen:
        return Path(chosen)
    home = os.environ.get("XDG_CACHE_HOME", "")
    try:
        return (Path(home) if home else Path.home() / ".cache") / "patchlaw"
    except RuntimeError:
        return None


def cached(kind: str, key: tuple[object, ...], compute: Callable[[], Arrays], comm: Any) -> Arrays:
    """Return arrays from the cache, or compute and keep them.

    The first rank alone reads and writes, and what it has is what all ranks get. A file that
    cannot be read is computed again; one that cannot be written is done without.

    Args:
        kind: Name of what is kept.
        key: All that it depends on: numbers, words, tuples and dataclasses of them.
        compute: Collective; the first rank's arrays count.
        comm: MPI communicator.

    Raises:
        TypeError: When a key holds anything else.

    Note:
        Collective.
    """
    place = _place(kind, key)  # on every rank, lest a key that will not do fails on one
    path = place if comm.rank == 0 else None
    large = pkl5.Intracomm(comm)  # of 128 × 128 patches they are more than MPI counts in a message
    found: Arrays | None = large.bcast(_read(path) if path else None, root=0)
    if found is not None:
        return found
    made = compute()
    if path:
        with suppress(OSError):
            _write(path, made)
            _clear(path.parent)
    kept: Arrays = large.bcast(made, root=0)
    return kept


def is_cached(kind: str, key: tuple[object, ...]) -> bool:
    """Tell whether `cached` would find arrays, without reading them.

    Args:
        kind: Name of what is kept.
        key: All that it depends on, as for `cached`.
    """
    path = _place(kind, key)
    try:
        return path is not None and path.is_file()
    except OSError:  # a folder above it that this user may not enter
        return False


@cache
def sources_digest() -> str:
    """Return a digest of the sources of the packages that make what is kept."""
    found = hashlib.sha256()
    top = Path(__file__).resolve().parents[2]
    for package in _SOURCES:
        for path in sorted((top / package).rglob("*.py")):
            found.update(path.relative_to(top).as_posix().encode() + b"\0" + path.read_bytes())
    return found.hexdigest()


def _place(kind: str, key: tuple[object, ...]) -> Path | None:
    directory = cache_directory()
    words = repr(_spelt((_FORMAT, sources_digest(), kind, key)))
    digest = hashlib.sha256(words.encode()).hexdigest()[:32]
    return directory / f"{kind}-{digest}.npz" if directory else None


def _spelt(value: object) -> object:
    """Return words for a value that do not depend on how numpy prints its numbers."""
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float):
        return value.hex()
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, tuple | list):
        return tuple(_spelt(part) for part in value)
    if is_dataclass(value) and not isinstance(value, type):
        parts = ((field.name, _spelt(getattr(value, field.name))) for field in fields(value))
        return type(value).__name__, *parts
    raise TypeError(f"{type(value).__name__} in a key of the cache")


def _read(path: Path) -> Arrays | None:
    try:
        with np.load(path, allow_pickle=False) as file:
            found = {name: file[name] for name in file.files}
    except Exception:  # zip, zlib and numpy have many for a damaged file; it is made anew
        return None
    with suppress(OSError):
        os.utime(path)  # it is in use
    return found


def _write(path: Path, arrays: Arrays) -> None:
    """Write beside the place and move there, so that nobody reads half a file."""
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=path.parent, suffix=".part")
    try:
        with os.fdopen(handle, "wb") as file:
            np.savez(file, **dict[str, Any](arrays))
        os.replace(name, path)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise


def _clear(directory: Path) -> None:
    """Remove the files that were not used for longest until the rest is small enough."""
    files = sorted(directory.glob("*-*.npz"), key=lambda path: path.stat().st_mtime, reverse=True)
    total = 0
    for path in files:
        total += path.stat().st_size
        if total > MOST_BYTES:
            path.unlink(missing_ok=True)
