"""Keeps what the elastic block was solved for on disk, under a key of all that it depends on."""

from __future__ import annotations

import hashlib
import os
import tempfile
import zipfile
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Arrays = Mapping[str, NDArray[np.float64]]

VARIABLE = "PATCHLAW_CACHE"
"""Environment variable: the cache's directory, or ``off``."""

_FORMAT = 1  # raise it when the numbers behind a key change


def cache_directory() -> Path | None:
    """Return where results are kept, None when the user switched the cache off.

    ``PATCHLAW_CACHE`` wins, then ``XDG_CACHE_HOME/patchlaw``, then ``~/.cache/patchlaw``.
    """
    chosen = os.environ.get(VARIABLE, "")
    if chosen.lower() == "off":
        return None
    if chosen:
        return Path(chosen)
    home = os.environ.get("XDG_CACHE_HOME", "")
    return (Path(home) if home else Path.home() / ".cache") / "patchlaw"


def cached(kind: str, key: tuple[object, ...], compute: Callable[[], Arrays], comm: Any) -> Arrays:
    """Return arrays from the cache, or compute and keep them.

    The first rank alone reads and writes. A file that cannot be read is computed again; one that
    cannot be written is done without.

    Args:
        kind: Name of what is kept.
        key: All that it depends on, with representations that tell different values apart.
        compute: Collective; returns the same arrays on every rank.
        comm: MPI communicator.

    Note:
        Collective.
    """
    directory = cache_directory() if comm.rank == 0 else None
    digest = hashlib.sha256(repr((_FORMAT, kind, key)).encode()).hexdigest()[:32]
    path = directory / f"{kind}-{digest}.npz" if directory else None
    found: Arrays | None = comm.bcast(_read(path) if path else None, root=0)
    if found is not None:
        return found
    made = compute()
    if path:
        with suppress(OSError):
            _write(path, made)
    return made


def _read(path: Path) -> Arrays | None:
    try:
        with np.load(path, allow_pickle=False) as file:
            return {name: file[name] for name in file.files}
    except (OSError, ValueError, EOFError, KeyError, AttributeError, zipfile.BadZipFile):
        return None


def _write(path: Path, arrays: Arrays) -> None:
    """Write beside the place and move there, so that nobody reads half a file."""
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=path.parent, suffix=".part")
    try:
        with os.fdopen(handle, "wb") as file:
            np.savez(file, **arrays)
        os.replace(name, path)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise
