"""The commands that tell what a scene may say: schema, help."""

from __future__ import annotations

import argparse
import difflib
import json
from collections.abc import Iterator
from typing import Any

from multiscale.console import speaks
from multiscale.output import terminal
from multiscale.scene.keys import Key, scene_keys, scene_schema
from support.errors import InputError


def print_schema(choice: argparse.Namespace, options: list[str], comm: Any) -> None:
    """Print the JSON Schema of scene files.

    Args:
        choice: Parsed words of the command line.
        options: PETSc options given by the user.
        comm: MPI communicator; None for a process on its own.
    """
    if speaks(comm):
        print(json.dumps(scene_schema(), indent=2))


def explain_keys(choice: argparse.Namespace, options: list[str], comm: Any) -> None:
    """Explain the sections of a scene, the keys of one, or one key.

    Args:
        choice: Parsed words of the command line.
        options: PETSc options given by the user.
        comm: MPI communicator; None for a process on its own.
    """
    terminal.show_pairs(comm, list(_explained(choice.topic)))


def _explained(topic: str | None) -> Iterator[tuple[str, str]]:
    """Yield keys, each with what it means and may be."""
    keys = scene_keys()
    if topic is None:
        yield from ((key.name, key.meaning) for key in keys.values() if "." not in key.name)
        yield "more", "patchlaw help load, patchlaw help load.force"
        return
    named = [key for key in keys.values() if f".{key.name}".endswith(f".{topic}")]
    if not named:
        close = difflib.get_close_matches(topic, keys, n=1)
        hint = f"; did you mean '{close[0]}'?" if close else ""
        sections = ", ".join(key.name for key in keys.values() if key.is_section)
        raise InputError(f"is no key of a scene{hint}", key="KEY", value=topic, allowed=sections)
    for key in named:
        yield key.name, key.meaning if key.is_section else _on_key(key)
        inner = (one for one in keys.values() if one.name.rpartition(".")[0] == key.name)
        yield from ((one.name, one.meaning if one.is_section else _on_key(one)) for one in inner)


def _on_key(key: Key) -> str:
    return f"{key.meaning}\nvalues: {key.values}\ndefault: {key.default}"
