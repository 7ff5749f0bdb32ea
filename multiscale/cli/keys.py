"""The commands that tell what words and scenes may say: schema, help, completion."""

from __future__ import annotations

import argparse
import difflib
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from patchlaw.multiscale import console
from patchlaw.multiscale.cli.command_line import command_parser
from patchlaw.multiscale.console import speaks
from patchlaw.multiscale.scene.keys import Key, scene_keys, scene_schema
from patchlaw.support.errors import InputError

_KEY_OPTIONS = ("--set", "--vary")
"""Options whose values begin with a key of a scene."""
_WITHOUT_SPACE = """
_patchlaw() { _shtab_patchlaw; [[ ${COMPREPLY[0]} == *= ]] && compopt -o nospace 2> /dev/null; }
complete -o bashdefault -F _patchlaw patchlaw
"""
"""What bash needs so that a value can follow a key."""


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
    console.show_pairs(comm, list(_explained(choice.topic)))


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


def print_completion(choice: argparse.Namespace, options: list[str], comm: Any) -> None:
    """Print a script that a shell evaluates.

    Args:
        choice: Parsed words of the command line.
        options: PETSc options given by the user.
        comm: MPI communicator; None for a process on its own.
    """
    if speaks(comm):
        print(completion(choice.shell))


def completion(shell: str) -> str:
    """Return a script that completes the words of ``patchlaw`` in a shell.

    Args:
        shell: ``"bash"`` or ``"zsh"``.
    """
    import shtab  # for this command alone

    parser = command_parser()
    (commands,) = (one for one in parser._actions if isinstance(one, argparse._SubParsersAction))
    for action in (action for one in commands.choices.values() for action in one._actions):
        if action.option_strings and action.option_strings[0] in _KEY_OPTIONS:
            action.complete = dict.fromkeys(("bash", "zsh"), "_patchlaw_keys")
        elif action.type is Path:
            action.complete = shtab.FILE
    keys = " ".join(f"{key.name}=" for key in scene_keys().values() if not key.is_section)
    ways = {"bash": f'compgen -W "{keys}" -- "$1"', "zsh": f"compadd -S '' -- {keys}"}
    preamble = {shell: f"_patchlaw_keys() {{ {way}; }}" for shell, way in ways.items()}
    script = shtab.complete(parser, shell, preamble=preamble)
    return script + _WITHOUT_SPACE * (shell == "bash")
