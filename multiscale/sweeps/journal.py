"""Keeps the cases of a sweep that are done, so that the next call goes on from them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from multiscale.scene.identity import changes, told
from support.checked_store import START, append, end_of, unsealed
from support.errors import InputError
from support.whole_files import written

_SUFFIX = ".cases"


@dataclass(frozen=True, slots=True, kw_only=True)
class CaseResult:
    """What a case came to.

    Attributes:
        case: Name of the case, see `cases.Case`.
        rows: The rows of its ``history.csv``: a value for every column.
        notes: Remarks of the run on its own approximations.
        failure: Why the case ended early; empty when it did not.
        files: What stands for the content of files that varied keys name, by these keys.
    """

    case: str
    rows: Sequence[Sequence[Any]]
    notes: Sequence[str] = ()
    failure: str = ""
    files: Mapping[str, str] = field(default_factory=dict)


class Journal:
    """Files with a record for every case that is done; every process appends to its own.

    Any number of processes and of jobs may so work on one sweep without waiting for each other.

    Args:
        folder: Folder of the files; made with the first case. None stores nothing.
        identity: Identity of the scene that all cases start from.
    """

    def __init__(self, folder: Path | None, identity: Mapping[str, Any]) -> None:
        self._folder, self._identity = folder, dict(identity)

    def files(self) -> list[Path]:
        """Return the files that are there, in the order of their names."""
        return sorted(self._folder.glob(f"*/*{_SUFFIX}")) if self._folder else []

    def read(self, paths: Iterable[Path]) -> Iterator[CaseResult]:
        """Yield the cases that are done, from some of the files.

        Raises:
            InputError: When they are cases of another scene, or a file is damaged.
        """
        for path in paths:
            yield from self._results(path)

    def _results(self, path: Path) -> Iterator[CaseResult]:
        try:
            for value, mark in unsealed(path.read_bytes()):
                if mark.records > 1:
                    yield CaseResult(**value)
                elif found := list(changes(self._identity, value)):
                    raise InputError(
                        f"holds the cases of another scene, where {told(found)}", key="--out",
                        value=str(path.parents[2]), allowed="another folder, or --overwrite",
                    )  # fmt: skip
        except InputError as error:
            if error.key:
                raise
            raise InputError(
                f"{error.problem}; remove it, and its cases are computed again", file=str(path)
            ) from None

    @contextmanager
    def appending(self, part: str, process: str) -> Iterator[Callable[[CaseResult], None]]:
        """Open the file of a process.

        Args:
            part: Name of the part of the sweep.
            process: Name of the process, different for all that work on the part.

        Yields:
            The function that stores a result.
        """
        if self._folder is None:
            yield lambda result: None
            return
        path = self._folder / part / f"{process}{_SUFFIX}"
        with written(path):
            path.parent.mkdir(parents=True, exist_ok=True)
        mark = end_of(path.read_bytes()) if path.exists() else START

        def store(result: CaseResult) -> None:
            nonlocal mark
            head = [self._identity] if mark == START else []
            mark = append(path, [*head, asdict(result)], mark)

        yield store
