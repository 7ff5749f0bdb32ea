"""The cases of a sweep: every combination of the values that keys of a scene take."""

from __future__ import annotations

import itertools
import json
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from geometry.errors import InputError
from multiscale.scene.scene import Scene
from multiscale.scene.scene_file import parsed

MOST_CASES = 1_000_000
"""Most cases of a sweep; a longer list is a slip of the pen, and would fill the memory."""

_RANGE = re.compile(r"(-?\d+)\.\.(-?\d+)")
_LINEAR = "block.young_modulus"


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One case of a sweep.

    Attributes:
        number: Position in the sweep, from 0.
        values: The values of the varied keys, by dotted key.
        scene: The scene with these values.
    """

    number: int
    values: dict[str, Any]
    scene: Scene

    @property
    def name(self) -> str:
        """The values as a text that identifies the case, whatever its number."""
        return json.dumps(self.values, sort_keys=True, default=str)


def sweep_cases(scene: Scene, vary: Mapping[str, Iterable[Any]]) -> list[Case]:
    """Return every combination of the varied values; the last key varies fastest.

    Args:
        scene: The scene that all cases start from.
        vary: Values by dotted key.

    Raises:
        InputError: When nothing is varied, a key has no values or one twice, there are too many
            cases, or a scene with some of the values is wrong.
    """
    lists = {key: [_plain(value) for value in values] for key, values in vary.items()}
    if not lists:
        raise InputError("varies nothing", key="--vary", allowed="KEY=VALUES, at least once")
    count = 1
    for key, values in lists.items():
        texts = [json.dumps(value, default=str) for value in values]
        if not values or len(set(texts)) < len(texts):
            problem = "has no values" if not values else "takes a value twice"
            raise InputError(problem, key=key, value=values, allowed="different values")
        count *= len(values)
    if count > MOST_CASES:
        raise InputError(f"make {count} cases", key=" × ".join(lists), allowed=f"≤ {MOST_CASES}")
    combinations = itertools.product(*lists.values())
    changes = [dict(zip(lists, values, strict=True)) for values in combinations]
    return [
        Case(number=number, values=values, scene=scene.with_(values))
        for number, values in enumerate(changes)
    ]


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


def grouped(cases: Sequence[Case]) -> list[list[Case]]:
    """Group the cases whose load steps differ by a factor alone.

    The body is linearly elastic: at given approaches, pressures and forces are proportional to its
    Young's modulus, if nothing else is elastic and no hardness bounds them. At given forces they
    are not, as the contact area grows less than the force.

    Args:
        cases: The cases of a sweep.

    Returns:
        Groups of cases; all load steps of a group follow from those of its first case.
    """
    groups: dict[str, list[Case]] = {}
    for case in cases:
        others = {key: value for key, value in case.values.items() if key != _LINEAR}
        scene = case.scene
        elastic = scene.counter_body is None and scene.micro.hardness is None
        linear = elastic and scene.loading.approach is not None
        key = json.dumps(others if linear else case.values, sort_keys=True, default=str)
        groups.setdefault(key, []).append(case)
    return list(groups.values())
