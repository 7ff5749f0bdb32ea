"""The cases of a sweep: every combination of the values that keys of a scene take."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, overload

from multiscale.scene.identity import content_digest
from multiscale.scene.scene import Scene
from multiscale.scene.scene_file import parsed
from support.errors import InputError

MOST_CASES = 1_000_000
"""Most cases of a sweep; a longer list is a slip of the pen, and would fill the memory."""

_RANGE = re.compile(r"(-?\d+)\.\.(-?\d+)")
_LINEAR = "block.young_modulus"
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
        """The values as a text that identifies the case, whatever its number."""
        return json.dumps(self.values, sort_keys=True, default=str)


class SweepCases(Sequence[Case]):
    """Every combination of the varied values, or some of them; the last key varies fastest.

    Cases are made when they are looked at: a sweep of a million takes no memory for them.

    Args:
        base: The scene that all cases start from.
        values: Lists of values by dotted key.
        numbers: The cases among all combinations, ascending; all of them when not given.
    """

    def __init__(
        self, base: Scene, values: Mapping[str, list[Any]], numbers: Sequence[int] | None = None
    ) -> None:
        self.base, self.values = base, dict(values)
        count = math.prod(len(each) for each in self.values.values())
        self.numbers: Sequence[int] = range(count) if numbers is None else numbers
        self._places = {
            key: {_text(value): place for place, value in enumerate(each)}
            for key, each in self.values.items()
        }
        self._digests: dict[Path, str] = {}
        self._varies_files = any(
            key.rpartition(".")[2] in _FILE_KEYS or isinstance(each[0], dict | list)
            for key, each in self.values.items()
        )

    def __len__(self) -> int:
        return len(self.numbers)

    @overload
    def __getitem__(self, index: int) -> Case: ...

    @overload
    def __getitem__(self, index: slice) -> SweepCases: ...

    def __getitem__(self, index: int | slice) -> Case | SweepCases:
        if isinstance(index, slice):
            return SweepCases(self.base, self.values, self.numbers[index])
        number = left = self.numbers[index]
        found: dict[str, Any] = {}
        for key, values in reversed(self.values.items()):
            left, place = divmod(left, len(values))
            found[key] = values[place]
        return Case(number=number, values=dict(reversed(found.items())), base=self.base)

    def number_of(self, name: str) -> int | None:
        """Return the number of the case of a name; None where it is not of this sweep."""
        values, number = json.loads(name), 0
        if values.keys() != self.values.keys():
            return None
        for key, each in self.values.items():
            place = self._places[key].get(_text(values[key]))
            if place is None:
                return None
            number = number * len(each) + place
        return number

    def files(self, case: Case) -> dict[str, str]:
        """Return what stands for the content of files as a case names them, by their keys.

        Args:
            case: The case. Where no varied key can name a file, the answer is empty.
        """
        if not self._varies_files:
            return {}
        named = case.scene.files()
        for path in named.values():
            if path not in self._digests:
                self._digests[path] = content_digest(path)
        return {key: self._digests[path] for key, path in named.items()}

    def where(self, chosen: Mapping[str, Any]) -> SweepCases:
        """Return the cases whose keys have given values."""
        kept = [case.number for case in self if chosen.items() <= case.values.items()]
        return SweepCases(self.base, self.values, kept)

    def groups(self) -> list[list[int]]:
        """Return the cases by number, in groups whose load steps differ by a factor alone.

        The body is linearly elastic: at given approaches, pressures and forces are proportional to
        its Young's modulus, if nothing else is elastic and no hardness bounds them. At given forces
        they are not, as the contact area grows less than the force. All load steps of a group
        follow from those of its first case.
        """
        if _LINEAR not in self.values:
            return [[number] for number in self.numbers]
        groups: dict[str, list[int]] = {}
        for case in self:
            scene = case.scene
            elastic = scene.counter_body is None and scene.micro.hardness is None
            linear = elastic and scene.loading.approach is not None
            differing = {key: case.values[key] for key in self.values if key != _LINEAR}
            groups.setdefault(_text(differing if linear else case.values), []).append(case.number)
        return list(groups.values())


def sweep_cases(scene: Scene, vary: Mapping[str, Iterable[Any]]) -> SweepCases:
    """Return every combination of the varied values; the last key varies fastest.

    Args:
        scene: The scene that all cases start from.
        vary: Values by dotted key.

    Raises:
        InputError: When nothing is varied, a key has no values or one twice, or there are too many
            cases. Scenes are not made.
    """
    lists = {key: [_plain(value) for value in values] for key, values in vary.items()}
    if not lists:
        raise InputError("varies nothing", key="--vary", allowed="KEY=VALUES, at least once")
    for key, values in lists.items():
        if not values or len({_text(value) for value in values}) < len(values):
            problem = "has no values" if not values else "takes a value twice"
            raise InputError(problem, key=key, value=values, allowed="different values")
    count = math.prod(map(len, lists.values()))
    if count > MOST_CASES:
        raise InputError(f"make {count} cases", key=" × ".join(lists), allowed=f"≤ {MOST_CASES}")
    return SweepCases(scene, lists)


def _text(value: Any) -> str:
    return json.dumps(value, sort_keys=True, default=str)


def _plain(value: Any) -> Any:
    """Return numpy's scalars as Python's own, which scenes and JSON take."""
    return value.item() if hasattr(value, "item") and getattr(value, "ndim", 0) == 0 else value


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
