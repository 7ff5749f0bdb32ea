"""The command ``patchlaw``: its words, their parser, and the start of one command.

Nothing but the standard library is imported before the words are understood, so that ``--help``
takes a tenth of a second.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, NoReturn

from patchlaw.multiscale.cli.interruption import ended_if_told, signals_raise
from patchlaw.multiscale.laws import FORMATS
from patchlaw.multiscale.runs import AGAINST, AT, VIEWS
from patchlaw.support.quantities import parse_duration

SWEEP_ENDING = "-sweep"
"""What the results folder of a sweep is called after the scene's name."""

COMPARE_ENDING = "-compare"
"""What the results folder of a comparison is called after the scene's name."""


_DISTRIBUTIONS = {"patchlaw": ("patchlaw",), "dolfinx": ("fenics-dolfinx", "dolfinx-solver-real")}
"""Distributions that bring a package: that of dolfinx, and its wheel with PETSc."""


_GONE = {
    "invalid choice: 'diff'": "diff is now a part of compare: patchlaw compare RESULTS RESULTS",
    "unrecognized arguments: --budget": "compare has no --budget any more: interrupt it, and the "
    "same call goes on; or leave the meshes out by --against concurrent",
}
"""What to do instead of words that are gone."""


class UsageError(Exception):
    """The words of the command line are not understood."""


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        message = next((told for word, told in _GONE.items() if word in message), message)
        raise UsageError(f"{message} (see: {self.prog} --help)")


class _ShowVersions(argparse.Action):
    """Prints the versions of patchlaw and of dolfinx, which is not loaded for it."""

    def __call__(self, *given: Any) -> NoReturn:
        from importlib import metadata  # takes longer than all else that --help needs

        versions = dict.fromkeys(_DISTRIBUTIONS, "not installed")
        for name, distributions in _DISTRIBUTIONS.items():
            for distribution in distributions:
                with suppress(metadata.PackageNotFoundError):
                    versions[name] = metadata.version(distribution)
        print(", ".join(f"{name} {version}" for name, version in versions.items()))
        raise SystemExit(0)


def wall_time(text: str) -> float:
    """Return a wall time in seconds.

    Args:
        text: A quantity such as ``"55m"`` or ``"2 h"``.

    Raises:
        argparse.ArgumentTypeError: When the text is no time, or not greater than zero.
    """
    try:
        return parse_duration(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"{text!r}: {error}") from None


def sweep_part(text: str) -> tuple[int, int]:
    """Return the part of a sweep that a text ``K/N`` names.

    Args:
        text: Number of the part, from 1, and number of parts.

    Raises:
        argparse.ArgumentTypeError: When the text is nothing of this kind.
    """
    which, _, parts = text.partition("/")
    if which.isdecimal() and parts.isdecimal() and 1 <= int(which) <= int(parts):
        return int(which), int(parts)
    raise argparse.ArgumentTypeError(f"{text!r} is no part of a sweep; it is K/N, such as 2/8")


_COMMANDS = {
    "init": ("init.write_scene", "Write a scene for a surface, with comments."),
    "run": ("run.run_scene", "Run a scene; write history, laws, figures and report."),
    "compare": (
        "studies.compare_any",
        "Run a scene in every sensible configuration and draw error against time; or set the "
        "results of two runs side by side.",
    ),
    "sweep": (
        "studies.sweep_scene",
        "Run a scene for many values of its keys; write all load steps and their statistics.",
    ),
    "view": (
        "run.view_results",
        "Show results in three dimensions: pages to turn by hand, linked from their report.",
    ),
    "plan": (
        "run.plan_scene",
        "Say what a run would do and why, and its memory; write no results, and solve only "
        "what an accuracy chooses keys without a value by.",
    ),
    "laws": ("run.tabulate_laws", "Tabulate the patch laws of a scene; write and draw them."),
    "surface": ("run.describe_surface", "Describe and draw the surface of a scene."),
    "schema": ("about.print_schema", "Print the JSON Schema of scene files."),
    "help": ("about.explain_keys", "Explain the sections and keys of a scene."),
    "completion": (
        "about.print_completion",
        "Print what lets a shell complete commands, options and keys of scenes.",
    ),
    "doctor": (
        "about.examine_machine",
        "Name versions, and what fails of packages, PETSc, MPI, forms and a small solution.",
    ),
    "warm": (
        "about.compile_ahead",
        "Compile all finite element forms now, so that later runs need no compiler.",
    ),
}
"""Where the code of every command is, and what it does."""

_UNUSED = "of a run: taken, and without effect here"
"""What `plan` says of the words that it takes so that those of a run can be reused."""


def _out(ending: str = "") -> str:
    return (
        f"folder of the results (default: results/SCENE{ending}, by the file's name; where keys "
        f"are set, results/SCENE-KEY=VALUE{ending})"
    )


_PATH: dict[str, Any] = {"type": Path}
_FLAG: dict[str, Any] = {"action": "store_true"}
_SIDES: dict[str, Any] = {"nargs": 2, "metavar": ("LX", "LY")}
_KEYS: dict[str, Any] = {"nargs": "+", "action": "extend", "default": []}
_TIME: dict[str, Any] = {"type": wall_time, "metavar": "TIME"}
_DIR: dict[str, Any] = {"type": Path, "metavar": "DIR"}

_WORDS: tuple[tuple[str, str, str, dict[str, Any]], ...] = (
    ("init run compare sweep view laws surface", "-q --quiet",
     "print nothing but errors and cautions, these on the error stream", _FLAG),
    ("run compare view", "--open", "open the report, or the first page, in a browser", _FLAG),
    ("run plan compare sweep laws", "--progress",
     "how progress is shown; by default a bar in a terminal, and lines elsewhere",
     {"choices": ("bar", "lines", "none")}),
    ("init", "surface", "a measured map; a spectrum without it", _PATH | {"nargs": "?"}),
    ("load", "--force", "such as '100 N'; by default one that suits the surface", {}),
    ("load", "--approach", "such as '2 um', instead of a force", {}),
    ("init", "--young-modulus", "of the block; by default 210 GPa", {"metavar": "E"}),
    ("init", "--poisson-ratio", "of the block; by default 0.3", {"metavar": "NU"}),
    ("init", "--lengths", "sides of the map, where its file lacks them; in mm without a unit",
     _SIDES),
    ("init", "--height-unit", "of heights, where the file lacks it", {"metavar": "UNIT"}),
    ("init", "--xy-unit", "of x and y of a list of points; by default mm", {"metavar": "UNIT"}),
    ("init", "--swap-xy", "take rows of the map, its first index, along x instead of y", _FLAG),
    ("init", "--channel", "name or number of a channel of the file", {}),
    ("init", "--out", "the scene to write; by default SURFACE.toml, here",
     _PATH | {"metavar": "FILE"}),
    ("init", "--overwrite", "replace a file that is there", _FLAG),
    ("run compare sweep plan laws surface", "scene", "scene file (TOML)", _PATH),
    ("compare", "other",
     "a second folder of results, where SCENE is a folder too that patchlaw run wrote",
     _PATH | {"nargs": "?", "metavar": "RESULTS"}),
    ("run laws surface", "--out", _out(), _DIR),
    ("compare", "--out", _out(COMPARE_ENDING), _DIR),
    ("sweep", "--out", _out(SWEEP_ENDING), _DIR),
    ("run laws surface", "--overwrite", "begin anew, whatever results are in this folder", _FLAG),
    ("sweep", "--overwrite", "begin anew where another sweep's results are", _FLAG),
    ("run", "--resume",
     "go on with an interrupted run, as without this; leave a finished one", _FLAG),
    ("run", "--max-time", "stop cleanly before this wall time is over", _TIME),
    ("plan", "--out", _UNUSED, _DIR),
    ("plan", "--max-time", _UNUSED, _TIME),
    ("plan", "--overwrite", _UNUSED, _FLAG),
    ("plan", "--resume", _UNUSED, _FLAG),
    ("plan", "--open", _UNUSED, _FLAG),
    ("plan", "-q --quiet", _UNUSED, _FLAG | {"dest": "unused"}),
    ("run compare sweep plan laws surface", "--set",
     "change keys of the scene, such as load.approach='4 um'", _KEYS | {"metavar": "KEY=VALUE"}),
    ("compare", "--against",
     f"compare with {', '.join(AGAINST)}; by default the best that is reached",
     {"metavar": "KIND", "choices": AGAINST}),
    ("compare", "--at",
     f"what is equal where two results are compared: {' or '.join(AT)}; by default what both "
     "prescribe", {"choices": AT}),
    ("sweep", "--vary",
     "values of a key, such as surface.spectrum.seed=0..19 or "
     "block.young_modulus='1 GPa, 4 GPa'; several keys make all combinations",
     {"action": "append", "required": True, "metavar": "KEY=VALUES"}),
    ("sweep", "--part",
     "run the K-th of N parts of the cases; by default the task of a Slurm array",
     {"metavar": "K/N", "type": sweep_part}),
    ("view", "results", "folder of results that patchlaw run wrote", _PATH),
    ("view", "--show",
     f"what is shown, of {', '.join(VIEWS)}; by default all that these results have",
     {"nargs": "+", "metavar": "WHAT"}),
    ("view", "--step", "number of the load step; by default the last that was written",
     {"type": int, "metavar": "N"}),
    ("view", "--mode", "number of the natural mode; by default 1",
     {"type": int, "metavar": "N"}),
    ("view", "--window",
     "open a window with each, one after the other, by default with the first; write no pages",
     _FLAG),
    ("laws", "--export",
     f"write them for other programs too: {', '.join(FORMATS)}; may be given several times",
     {"action": "append", "choices": FORMATS, "metavar": "FORMAT", "default": []}),
    ("laws", "--name",
     "what names of exported laws begin with, where several exports meet in one input",
     {"default": ""}),
    ("help", "topic", "a section or a key, such as load or load.force; all sections by default",
     {"nargs": "?", "metavar": "KEY"}),
    ("completion", "shell",
     'bash or zsh; in its startup file: eval "$(patchlaw completion bash)"',
     {"choices": ("bash", "zsh")}),
    ("warm", "--element", "Q1, Q2, P1, P2; all by default",
     {"nargs": "+", "default": [], "metavar": "NAME"}),
)  # fmt: skip
"""What commands take: the commands, the words, their meaning, and what else argparse knows."""


def command_parser() -> argparse.ArgumentParser:
    """Return the parser of the command line; `function` says where the code of a command is."""
    top = _Parser(
        prog="patchlaw",
        description="Multiscale contact of rough surfaces.",
        epilog="PETSc options follow after --, such as: patchlaw run scene.toml -- -ksp_monitor",
    )
    top.add_argument("--version", action=_ShowVersions, nargs=0, help="show versions and exit")
    commands = top.add_subparsers(required=True, metavar="COMMAND", parser_class=_Parser)
    made: dict[str, Any] = {}
    for name, (function, summary) in _COMMANDS.items():
        made[name] = commands.add_parser(name, help=summary, description=summary)
        made[name].set_defaults(function=function)
    made["load"] = made["init"].add_mutually_exclusive_group()
    for names, words, meaning, how in _WORDS:
        for name in names.split():
            made[name].add_argument(*words.split(), help=meaning, **how)
    return top


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command. Works the same under ``mpirun``, where rank 0 prints and writes.

    Args:
        arguments: Words of the command line after the program's name; what follows ``--`` are
            PETSc options.

    Returns:
        0 done; 2 the input is wrong and nothing was written; 3 not converged, the results up to
        there are written; 4 stopped in time; 5 a file or the output cannot be written, or memory
        ran out; 129, 130 and 143 stopped by SIGHUP, SIGINT and SIGTERM; 1 a bug. After all but
        0, 1 and 2 ``patchlaw run --resume`` goes on from the last load step.

    Note:
        Collective over all processes of the MPI job.
    """
    words = list(sys.argv[1:] if arguments is None else arguments)
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):  # for terminals that lack a character
            stream.reconfigure(errors="backslashreplace")
    with signals_raise():
        try:
            with ended_if_told():
                code = _run(words)
            sys.stdout.flush()
            return code
        except KeyboardInterrupt as error:
            return getattr(error, "exit_code", 130)  # of SIGINT, as shells have it
        except OSError as error:
            with suppress(OSError):
                if not isinstance(error, BrokenPipeError):  # who reads has had enough
                    print(f"patchlaw: standard output: {error.strerror}", file=sys.stderr)
                # Python flushes once more at its end
                os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            return 5


def _run(words: list[str]) -> int:
    """Parse the words, then run the command; return its exit code."""
    cut = words.index("--") if "--" in words else len(words)
    choice: argparse.Namespace | str
    try:
        choice = command_parser().parse_args(words[:cut])
    except SystemExit:  # of --help and --version
        return 0
    except UsageError as error:  # for rank 0 to say, which is known once MPI has started
        choice = str(error)
    from patchlaw.support import NotInstalled
    from patchlaw.support.packages import conflict, optional_packages

    try:
        if problem := conflict():
            raise NotInstalled(problem)
        with optional_packages():
            from patchlaw.multiscale.cli.execution import execute
    except NotInstalled as error:  # what other errors are written with may be missing
        print(f"patchlaw: {error}", file=sys.stderr)
        return error.exit_code
    return execute(choice, words[cut + 1 :])
