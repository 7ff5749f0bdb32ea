"""Keys and units as they are misspelt, and what must be said of them."""

import re

from hypothesis import strategies as st

from benchmarks.scene_inputs import BASE, put
from patchlaw.multiscale import Scene
from patchlaw.multiscale.scene.schema import scene_keys
from patchlaw.support import InputError
from patchlaw.support.quantities import _UNITS, parse_quantity

_LONG = 5  # letters of a name in which one wrong letter leaves no doubt
KEYS = [
    name
    for name, key in scene_keys().items()
    if len(name.rpartition(".")[2]) >= _LONG and not key.is_section
]
"""Keys that are long enough; those in lists and under names of the user's have no place of theirs
in a scene of dictionaries alone, but are refused like all others."""


@st.composite
def keys(draw):
    """Draw the name of a key, and the same name misspelt."""
    name = draw(st.sampled_from(KEYS))
    section, dot, key = name.rpartition(".")
    at = draw(st.integers(1, len(key) - 2))
    wrong = draw(
        st.sampled_from(
            [
                key[:at] + key[at + 1 :],
                key[:at] + key[at] + key[at:],
                key[: at - 1] + key[at] + key[at - 1] + key[at + 1 :],
                key.capitalize(),
                key.upper(),
            ]
        )
    )
    return name, f"{section}{dot}{wrong}"


def key_was_offered(drawn):
    """Write a misspelt key into a scene; the nearest key must be offered."""
    name, wrong = drawn
    if name.rpartition(".")[2] in (wrong.rpartition(".")[2],):
        return "no misspelling"
    *sections, _ = wrong.split(".")
    try:
        Scene.from_dict(put(BASE, wrong, 1))
    except InputError as error:
        told = str(error)
        if "unknown key" not in told:  # what else is wrong with sections of which this is all
            assert any(
                part in ("supports", "materials", "tractions", "pretension", "regions", "stage")
                for part in sections
            )
            return "refused otherwise"
        offered = re.search(r"did you mean '([^']+)'", told)
        assert offered, told
        right = name.rpartition(".")[2]
        assert offered[1].rpartition(".")[2] == right, (told, right)
        return "offered"
    raise AssertionError(f"{wrong} was taken")


@st.composite
def units(draw):
    """Draw a unit of a quantity, and the same in other letters of other cases."""
    target = draw(st.sampled_from([name for name, unit in _UNITS.items() if unit.common]))
    unit = draw(st.sampled_from(sorted(_UNITS[target].common)))
    cases = draw(st.lists(st.booleans(), min_size=len(unit), max_size=len(unit)))
    wrong = "".join(
        letter.upper() if up else letter.lower() for letter, up in zip(unit, cases, strict=True)
    )
    number = draw(st.sampled_from(["8", "2.5", "1e3", "-3.25", "2,5"]))
    return target, unit, wrong, number


def unit_was_offered(drawn):
    """Read a quantity with letters of the wrong case; a right one must be offered."""
    target, unit, wrong, number = drawn
    right = wrong in _UNITS[target].common
    try:
        found = parse_quantity(f"{number} {wrong}", target)
    except ValueError as error:
        offered = re.search(r"did you mean '([^']+)'", str(error))
        assert offered, str(error)
        meant = parse_quantity(offered[1], target)
        same = unit.casefold() == offered[1].split(" ", 1)[1].casefold()
        assert (
            same
            and meant
            == float(number.replace(",", ".")) * _UNITS[target].common[offered[1].split(" ", 1)[1]]
        )
        return "offered"
    assert right and "," not in number, (drawn, found)
    return "read"
