"""Reads the text of a scene file, and changes keys of what it says, before anything is checked.

Keys that are gone are refused here, too, with what to write instead.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from patchlaw.support.errors import InputError

MOST_BYTES = 64 * 1024
"""Size of the largest scene file [B]; a scene with every key takes 2 kB."""

_START = 4096  # bytes that tell a scene from heights
_DEEPEST = 100  # sections within sections
_EXCLUSIVE = {
    "approach": ("force", "pressure", "stage"),
    "force": ("approach", "pressure", "stage"),
    "pressure": ("approach", "force", "stage"),
    "file": ("spectrum", "heights"),
    "spectrum": ("file", "heights"),
    "heights": ("file", "spectrum"),
}
"""Keys that one key replaces, as a section may have only one of them."""
_HALF_SPACE = "micro.model = 'half-space', on a coarser surface.grid where speed matters"
_AUTO = "coupling.kind", "patches.grid", "block.cells", "surface.grid", "counter_surface.grid"
_BY_ACCURACY = "leave it out, with 'accuracy' beside it, which chooses what is not stated"
_EDGES = "reference.fine states the edge length of tetrahedra"
GONE: Mapping[str, str] = {
    "micro.model = 'islands'": _HALF_SPACE,
    "micro.model = 'auto'": _HALF_SPACE,
    "micro.curvature": f"leave it out, for that of the summit; or {_HALF_SPACE}",
    "micro.border": f"leave it out: summits on the border carry no load; or {_HALF_SPACE}",
    **{f"{key} = 'auto'": _BY_ACCURACY for key in _AUTO},
    "coupling.compliance": "leave it out: the program chooses",
    "coupling.newton": "leave it out: the program chooses",
    "micro.solver": "leave it out: Newton's method on the active set",
    "micro.tolerance": f"leave it out; or {_HALF_SPACE}",
    "reference.mesh": f"leave it out: all meshes are of tetrahedra; {_EDGES}",
    "reference.cells": f"{_EDGES}, or leave it out",
    "reference.mesher": "leave it out; a mesh of your own, by gmsh too, goes into [body]",
}
"""What to do instead, by key, or by key and value where other values stay."""


def read_scene_file(path: Path) -> dict[str, Any]:
    """Return what a scene file says, unchecked.

    Args:
        path: TOML file in UTF-8.

    Raises:
        InputError: When it is no regular file, cannot be read, is too large or no TOML.
    """
    content = _content(path)
    if path.suffix.lower() != ".toml" and _may_be_heights(content):
        raise InputError(
            f"is no scene, it looks like a height map: 'patchlaw init {path}' writes one for it",
            file=str(path),
        )
    if len(content) > MOST_BYTES:
        allowed = f"{MOST_BYTES} bytes"
        problem = "cannot be read: it is larger than any scene"
        raise InputError(problem, allowed=allowed, file=str(path))
    try:
        return parsed(content.decode("utf-8-sig"))  # some editors put a mark before the text
    except UnicodeDecodeError as error:
        problem = f"is not UTF-8 text: {error}"
    except ValueError as error:
        problem = f"is not valid TOML: {error}"
    raise InputError(problem, file=str(path))


def _content(path: Path) -> bytes:
    """Return the bytes of a regular file, as many as a scene may have and one more."""
    try:
        if path.exists() and not path.is_file():
            raise ValueError("it is not a regular file")
        with path.open("rb") as file:
            return file.read(MOST_BYTES + 1)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"cannot be read: {reason}", file=str(path)) from None


def _may_be_heights(content: bytes) -> bool:
    """Tell whether bytes are no text, or have no line that sets a key or begins a section."""
    try:
        text = content[:_START].decode("utf-8-sig")
    except UnicodeDecodeError as error:
        return error.start < len(content[:_START]) - 4  # the last character may be cut
    lines = [line for line in map(str.strip, text.splitlines()) if line and line[0] != "#"]
    return "\0" in text or (bool(lines) and not any("=" in one or one[0] == "[" for one in lines))


def flat(section: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the keys of a scene with dots, and their values.

    Args:
        section: The scene as nested dictionaries.
        above: What stands before its keys.
    """
    for name, value in section.items():
        if isinstance(value, Mapping):
            yield from flat(value, f"{above}{name}.")
        else:
            yield f"{above}{name}", value


def overridden(data: dict[str, Any], text: str) -> dict[str, Any]:
    """Return what a scene file says, with one key set from the command line.

    Args:
        data: The sections; they stay what they are.
        text: ``key=value``; a value is TOML, or else a plain string.

    Raises:
        InputError: When it is no override, or a section in its key is none.
    """
    key, equals, value = (part.strip() for part in text.partition("="))
    if not equals or not key or key.count(".") >= _DEEPEST:
        raise InputError("is not an override", value=text, allowed="--set key=value")
    return changed(data, key, _overriding(value))


def changed(data: dict[str, Any], key: str, value: Any) -> dict[str, Any]:
    """Return nested dictionaries with one key set, without the keys that it excludes.

    Args:
        data: The dictionaries; they stay what they are.
        key: The dotted key.
        value: Its value.

    Raises:
        InputError: When a section in the key is none.
    """
    first, _, rest = key.partition(".")
    if not rest:
        excluded = _EXCLUSIVE.get(first, ())
        return {name: old for name, old in data.items() if name not in excluded} | {first: value}
    section = data.get(first, {})
    if not isinstance(section, dict):
        raise InputError(f"'{first}' is not a section", key=key, value=value)
    return data | {first: changed(section, rest, value)}


def _overriding(text: str) -> Any:
    try:
        stated = parsed(f"value = {text}")
    except ValueError:
        return text
    return stated["value"] if stated.keys() == {"value"} else text


def parsed(text: str) -> dict[str, Any]:
    """Return a TOML text as nested dictionaries.

    Args:
        text: The text.

    Raises:
        ValueError: When it is no TOML, or nested deeper than anything sensible.
    """
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise ValueError("it is nested too deeply") from None


def refuse_removed(scene: Any) -> None:
    """Refuse a scene that names what is gone.

    Args:
        scene: The sections as nested dictionaries, unchecked.

    Raises:
        InputError: When it does; says what to write instead.
    """
    for name, section in scene.items() if isinstance(scene, Mapping) else ():
        for field, value in section.items() if isinstance(section, Mapping) else ():
            key = f"{name}.{field}"
            if instead := GONE.get(key) or GONE.get(f"{key} = {value!r}"):
                raise InputError("is gone", key=key, value=value, allowed=instead)
