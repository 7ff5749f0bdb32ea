"""The command ``patchlaw completion``: what lets a shell complete commands, options and keys."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from typing import Any

from multiscale.cli.words import command_parser
from multiscale.console import speaks
from multiscale.scene.keys import scene_keys

_KEY_OPTIONS = ("--set", "--vary")
"""Options whose values begin with a key of a scene."""


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
