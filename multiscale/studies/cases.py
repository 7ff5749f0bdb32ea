"""The cases of a sweep: every combination of the values that keys of a scene take."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

from patchlaw.multiscale.scene.scene import CONTENT, Scene, content_digest
from patchlaw.multiscale.scene.scene_file import parsed
from patchlaw.support.errors import InputError
from patchlaw.support.files import plain

MOST_CASES = 100_000
"""Most cases of a sweep: every rank holds the rows of all, some 10 kB for 8 load steps of each."""
_RANGE = re.compile(r"(-?\d+)\.\.(-?\d+)")
_FILE_KEYS = ("file", "mesh")  # last parts of their names; sections may hold them too


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One case of a sweep.

    Attributes:
        number: Position in the sweep, from 0.
        values: The values of the varied keys, by dotted key.
        base: The scene that all cases start from.
    """

    number: int
    values: dict[str, Any]
    base: Scene

    @property
    def scene(self) -> Scene:
        """The scene with these values, made anew at every access.

        Raises:
            InputError: When the scene is wrong.
        """
        return self.base.with_(self.values)

    @property
    def name(self) -> str:
        """The values as a text."""
        return _text(self.values)

    @property
    def key(self) -> str:
        """The values, and what stands for the content of files that they may name, as a text."""
        named = any(
            key.rpartition(".")[2] in _FILE_KEYS or isinstance(value, dict | list)
            for key, value in self.values.items()
        )
        paths = self.scene.files() if named else {}
        return _text(self.values | {CONTENT + key: _digest(path) for key, path in paths.items()})


def sweep_cases(scene: Scene, vary: Mapping[str, Iterable[Any]]) -> list[Case]:
    """Return every combination of the varied values; the last key varies fastest.

    Args:
        scene: The scene that all cases start from.
        vary: Values by dotted key.

    Raises:
        InputError: When nothing is varied, a key has no values or one twice, or there are too many
            cases. Scenes are not made.
    """
    allowed = '{"section.key": [value, …]}'
    for key, values in vary.items():
        if isinstance(values, str | bytes | Mapping) or not isinstance(values, Iterable):
            raise InputError("is no list of values", key=key, value=values, allowed=allowed)
    lists = {key: [plain(value) for value in values] for key, values in vary.items()}
    if not lists:
        raise InputError("varies nothing", key="--vary", allowed="KEY=VALUES, at least once")
    for key, values in lists.items():
        if not values or len({_text(value) for value in values}) < len(values):
            problem = "has no values" if not values else "takes a value twice"
            raise InputError(problem, key=key, value=values, allowed="different values")
    count = math.prod(map(len, lists.values()))
    if count > MOST_CASES:
        raise InputError(f"make {count} cases", key=" × ".join(lists), allowed=f"≤ {MOST_CASES}")
    _digest.cache_clear()  # files may have changed since the last sweep
    return [
        Case(number=number, values=dict(zip(lists, values, strict=True)), base=scene)
        for number, values in enumerate(product(*lists.values()))
    ]


@cache
def _digest(path: Path) -> str:
    return content_digest(path)


def _text(value: Any) -> str:
    return json.dumps(value, sort_keys=True, default=str)


def values_from_text(text: str) -> tuple[str, list[Any]]:
    """Read a varied key from the command line.

    Args:
        text: ``KEY=VALUES``. The values are a range of whole numbers with both ends (``0..19``), a
            list in TOML (``["1 GPa", "4 GPa"]``), or texts and numbers between commas
            (``1 GPa, 4 GPa``).

    Returns:
        The dotted key, and its values.

    Raises:
        InputError: When the text is nothing of this kind.
    """
    key, equals, values = (part.strip() for part in text.partition("="))
    if not (equals and key and values):
        raise InputError("varies no key", key="--vary", value=text, allowed="KEY=VALUES")
    if ends := _RANGE.fullmatch(values):
        first, last = int(ends[1]), int(ends[2])
        if not 0 <= last - first < MOST_CASES:
            raise InputError(
                "is no range", key=f"--vary {key}", value=values,
                allowed=f"first..last, at most {MOST_CASES} numbers",
            )  # fmt: skip
        return key, list(range(first, last + 1))
    if values.startswith("["):
        return key, _array(values, text)
    return key, [_array(f"[{part}]", text, part)[0] for part in map(str.strip, values.split(","))]


def _array(array: str, text: str, plain: str | None = None) -> list[Any]:
    """Return a TOML array as a list; what is no TOML is a plain text, where that is allowed."""
    try:
        found = parsed(f"values = {array}")
        if found.keys() == {"values"} and found["values"]:
            return found["values"]
    except ValueError:
        if plain:
            return [plain]
    raise InputError("is no list of values", key="--vary", value=text, allowed="KEY=[…, …]")
