"""Reads scene files and overrides as nested dictionaries, whatever bytes they may be."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

from geometry.errors import InputError

MOST_BYTES = 64 * 1024
"""Size of the largest scene file [B]; a scene with every key takes 2 kB."""

_OF_NUMBER = re.compile(r"[0-9]\.[0-9]+(?!\.)")
_DEEPEST = 100  # sections within sections


def read_scene_file(path: Path) -> dict[str, Any]:
    """Return what a scene file says, unchecked.

    Args:
        path: TOML file in UTF-8.

    Raises:
        InputError: When it is no regular file, cannot be read, is too large or no TOML.
    """
    content = _content(path)
    if len(content) > MOST_BYTES:
        raise InputError(
            f"cannot be read: it is larger than any scene (allowed: {MOST_BYTES} bytes)",
            file=str(path),
        )
    try:
        return parsed(content.decode("utf-8-sig"))  # some editors put a mark before the text
    except UnicodeDecodeError as error:
        raise InputError(f"is not UTF-8 text: {error}", file=str(path)) from None
    except ValueError as error:
        raise InputError(f"is not valid TOML: {error}", file=str(path)) from None


def _content(path: Path) -> bytes:
    """Return the bytes of a file, if it has an end; no more than a scene and one."""
    try:
        regular = path.is_file() or not path.exists()  # what does not exist has a better error
        if regular:
            with path.open("rb") as file:
                return file.read(MOST_BYTES + 1)
    except (OSError, ValueError) as error:  # ValueError: a zero byte in the name
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"cannot be read: {reason}", file=str(path)) from None
    raise InputError("cannot be read: it is not a regular file", file=str(path))


def override(data: dict[str, Any], text: str) -> None:
    """Set one dotted key in nested dictionaries.

    Args:
        data: The dictionaries, changed in place.
        text: ``key=value``; a value is TOML, or else a plain string.

    Raises:
        InputError: When it is no override, or a section in its key is none.
    """
    key, equals, value = (part.strip() for part in text.partition("="))
    *sections, name = key.split(".")
    if not equals or not key or len(sections) > _DEEPEST:
        raise InputError("is not an override", value=text, allowed="--set key=value")
    for section in sections:
        data = data.setdefault(section, {})
        if not isinstance(data, dict):
            raise InputError(f"'{section}' is not a section", value=text, key=key)
    data[name] = _overriding(value)


def _overriding(text: str) -> Any:
    try:
        found = parsed(f"value = {text}")
    except ValueError:
        return text
    return found["value"] if found.keys() == {"value"} else text


def parsed(text: str) -> dict[str, Any]:
    """Return a TOML text as nested dictionaries.

    Args:
        text: The text.

    Raises:
        ValueError: When it is no TOML, or nested deeper than anything sensible.
    """
    if any(_dots(line) > _DEEPEST for line in text.split("\n")):
        raise ValueError("a line with more dots than any scene has")  # they take hours to parse
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise ValueError("it is nested too deeply") from None


def _dots(line: str) -> int:
    """Count the dots of a line that may part keys, not those of numbers or comments."""
    if line.lstrip().startswith("#"):
        return 0
    return line.count(".") - len(_OF_NUMBER.findall(line))
