"""Which files in a folder of results patchlaw wrote; all others are the user's, and stay.

A list in the folder has a line for every time that files were written: their names before, and what
identifies their contents after. A file is patchlaw's where its content is one of those listed, or
where a process was killed while it wrote. Processes that share a folder append to one list.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from hashlib import sha256
from pathlib import Path
from typing import Any

from patchlaw.support.errors import InputError
from patchlaw.support.files import begins_as_record, read_bytes, remove, written

LIST = ".patchlaw-files"
"""Name of the list."""

_END = 2**16
"""Bytes at both ends of a file that identify it, with its size: fields may take gigabytes."""

REPLACED = "another folder, or --overwrite"
"""What is allowed instead of a folder with files of others, where a command takes the option."""


class OwnFiles:
    """The files that patchlaw wrote to a folder.

    Args:
        folder: The folder, which need not exist.
    """

    def __init__(self, folder: Path) -> None:
        self._folder, self._list = folder, folder / LIST

    def refuse_others(
        self,
        names: Iterable[str],
        inputs: Iterable[Path] = (),
        *,
        overwrite: bool = False,
        allowed: str = REPLACED,
        key: str = "--out",
    ) -> None:
        """Refuse to write where files of the same names are not patchlaw's, or are read.

        Args:
            names: Names of the files that may be written, within the folder.
            inputs: Files that are read, which nothing may replace.
            overwrite: Whether the user gave up the files of others.
            allowed: What the error says is allowed.
            key: What the error calls the folder.

        Raises:
            InputError: When there is such a file.
        """
        there, inputs = [name for name in names if os.path.lexists(self._folder / name)], [*inputs]
        others = [] if overwrite else self._others(there)
        for name in there:
            path = self._folder / name
            if any(_are_same(path, one) for one in inputs):
                problem, instead = f"results would replace {name}, which is read", "another folder"
            elif name in others:
                problem, instead = f"holds {name}, which is no result of patchlaw", allowed
            else:
                continue
            raise InputError(problem, key=key, value=str(self._folder), allowed=instead)

    def remove(self, names: Iterable[str]) -> None:
        """Remove those of some files that patchlaw wrote.

        Args:
            names: Their names, within the folder.

        Raises:
            NotWritten: When the system refuses.
        """
        there = [name for name in names if os.path.lexists(self._folder / name)]
        for name in set(there) - set(self._others(there)):
            remove(self._folder / name)

    @contextmanager
    def writing(self, names: Iterable[str]) -> Iterator[None]:
        """List files as patchlaw's that are written meanwhile.

        Args:
            names: Names of all files that may be written; those that are not stay what they are.

        Raises:
            NotWritten: When the list cannot be written.
        """
        names = [*names]
        others = {name: _content(self._folder / name) for name in self._others(names)}
        self._append({name: None for name in names if name not in others})
        yield
        now = {name: _content(self._folder / name) for name in names}
        self._append({name: now[name] for name in names if now[name] != others.get(name, None)})

    def _others(self, names: Iterable[str]) -> list[str]:
        """Return those of some names that are files which patchlaw did not write."""
        listed = self._listed()
        return [name for name in names if not self._is_own(name, listed)]

    def _is_own(self, name: str, listed: Mapping[str, list[str | None]]) -> bool:
        path = self._folder / name
        if path.is_symlink() or not path.exists():  # of a link, what it points to is not touched
            return True
        contents = listed.get(name) or [""]
        if contents[-1] is None or _content(path) in contents:
            return True
        with suppress(OSError):
            return path.is_file() and begins_as_record(path)
        return False

    def _listed(self) -> dict[str, list[str | None]]:
        """Return the contents of every name that were written."""
        with suppress(OSError):
            found: dict[str, list[str | None]] = {}
            for line in read_bytes(self._list).splitlines():
                with suppress(ValueError, AttributeError):  # a line that was cut short
                    for name, content in json.loads(line).items():
                        found.setdefault(name, []).append(content)
            return found
        return {}

    def _append(self, contents: Mapping[str, Any]) -> None:
        with written(self._list):
            self._folder.mkdir(parents=True, exist_ok=True)
            if self._list.is_symlink():
                self._list.unlink()
            with self._list.open("ab") as file:  # behind what other processes wrote, in one piece
                file.write(b"\n" + json.dumps(contents).encode() + b"\n")


def _content(path: Path) -> str:
    """Return what identifies the content of a file or of a folder; nothing where there is none."""
    whole = sha256()
    if path.is_dir():
        for one in sorted(path.rglob("*")):
            whole.update(f"{one.relative_to(path)} {one.stat().st_size}\n".encode())
    elif path.is_file():
        size = path.stat().st_size
        whole.update(b"%d\n" % size)
        with path.open("rb") as file:
            whole.update(file.read(_END))
            file.seek(max(_END, size - _END))
            whole.update(file.read(_END))
    else:
        return ""
    return whole.hexdigest()[:20]


def _are_same(one: Path, other: Path) -> bool:
    with suppress(OSError):
        return one.samefile(other)
    return False
