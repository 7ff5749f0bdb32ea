"""The commands that tell what words and scenes may say: schema, help, completion."""

from __future__ import annotations

import argparse
import difflib
import json
from collections.abc import Iterator, Mapping
from typing import Any

from patchlaw.multiscale import console
from patchlaw.multiscale.cli.words import command_parser
from patchlaw.multiscale.console import speaks
from patchlaw.multiscale.scene.keys import Key, scene_keys, scene_schema
from patchlaw.support.errors import InputError

_KEY_OPTIONS = ("--set", "--vary")
"""Options whose values begin with a key of a scene."""


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
    commands = _commands(command_parser())
    branches = "\n".join(
        f"    {name})\n{_branch(options)}\n      ;;" for name, options in commands.items()
    )
    keys = " ".join(f"{key.name}=" for key in scene_keys().values() if not key.is_section)
    start = "autoload -U +X bashcompinit && bashcompinit\n" if shell == "zsh" else ""
    return f"""{start}_patchlaw() {{
  local word=${{COMP_WORDS[COMP_CWORD]}} before=${{COMP_WORDS[COMP_CWORD-1]}}
  local option="" values="" words="" i
  COMPREPLY=()
  if [ "$COMP_CWORD" -eq 1 ]; then
    COMPREPLY=($(compgen -W "{" ".join(commands)} --help --version" -- "$word"))
    return
  fi
  for ((i = 2; i < COMP_CWORD; i++)); do
    case ${{COMP_WORDS[i]}} in -*) option=${{COMP_WORDS[i]}} ;; esac
  done
  case ${{COMP_WORDS[1]}} in
{branches}
  esac
  case $word in -*) COMPREPLY=($(compgen -W "$words --help" -- "$word")); return ;; esac
  if [ -n "$values" ]; then
    COMPREPLY=($(compgen -W "$values" -- "$word"))
  elif [[ " {" ".join(_KEY_OPTIONS)} " == *" $option "* ]]; then
    compopt -o nospace 2> /dev/null
    COMPREPLY=($(compgen -W "{keys}" -- "$word"))
  else
    compopt -o filenames 2> /dev/null
    COMPREPLY=($(compgen -f -- "$word"))
  fi
}}
complete -F _patchlaw patchlaw"""


def _commands(parser: argparse.ArgumentParser) -> dict[str, dict[str, list[str]]]:
    """Return the options of every command, each with the values that it may have."""
    (commands,) = (
        action for action in parser._actions if isinstance(action, argparse._SubParsersAction)
    )
    return {
        name: {
            option: [str(one) for one in action.choices or ()]
            for action in each._actions
            if action.help != argparse.SUPPRESS
            for option in action.option_strings or [action.dest]
        }
        for name, each in commands.choices.items()
    }


def _branch(options: Mapping[str, list[str]]) -> str:
    """Return the lines of a command: its options, and the values of those that have few."""
    words = " ".join(name for name in options if name.startswith("--"))
    lines = [f'      words="{words}"']
    lines += [
        f'      [ "$before" = {name} ] && values="{" ".join(values)}"'
        for name, values in options.items()
        if values and name.startswith("-")
    ]
    lines += [
        f'      [ "$COMP_CWORD" -eq 2 ] && values="{" ".join(values)}"'
        for name, values in options.items()
        if values and not name.startswith("-")
    ]
    return "\n".join(lines)
