"""The command ``patchlaw``: its words, their parser, and the start of one command.

Nothing but the standard library is imported before the words are understood, so that ``--help``
takes a tenth of a second.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, NoReturn

from patchlaw.multiscale.cli.interruption import ended_if_told, signals_raise
from patchlaw.multiscale.exports import FORMATS
from patchlaw.multiscale.studies import AGAINST, AT
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


_QUIET = ("init", "run", "compare", "sweep", "laws", "surface")
"""Commands that are called for the files that they write, not for what they print."""

_LONG = ("run", "plan", "compare", "sweep", "laws")
"""Commands that solve contact problems, and show how far they are."""

_WITH_PAGE = ("run", "compare")
"""Commands that write a report."""

_UNUSED = "of a run: taken, and without effect here"
"""What `plan` says of the words that it takes so that those of a run can be reused."""

_TIME: dict[str, Any] = {"type": wall_time, "metavar": "TIME"}


def command_parser() -> argparse.ArgumentParser:
    """Return the parser of the command line; `function` says where the code of a command is."""
    top = _Parser(
        prog="patchlaw",
        description="Multiscale contact of rough surfaces.",
        epilog="PETSc options follow after --, such as: patchlaw run scene.toml -- -ksp_monitor",
    )
    top.add_argument("--version", action=_ShowVersions, nargs=0, help="show versions and exit")
    commands = top.add_subparsers(required=True, metavar="COMMAND", parser_class=_Parser)

    def command(name: str, function: str, summary: str) -> argparse.ArgumentParser:
        made = commands.add_parser(name, help=summary, description=summary)
        made.set_defaults(function=function)
        if name in _QUIET:
            alone = "print nothing but errors and cautions, these on the error stream"
            made.add_argument("-q", "--quiet", action="store_true", help=alone)
        if name in _LONG:
            ways = "how progress is shown; by default a bar in a terminal, and lines elsewhere"
            made.add_argument("--progress", choices=("bar", "lines", "none"), help=ways)
        if name in _WITH_PAGE:
            made.add_argument("--open", action="store_true", help="open the report in a browser")
        return made

    _add_init(command("init", "init.write_scene", "Write a scene for a surface, with comments."))
    _add_runs(command)
    _add_descriptions(command)
    return top


def _add_init(init: argparse.ArgumentParser) -> None:
    """Add what the command takes that writes a scene."""
    path: dict[str, Any] = {"type": Path}
    init.add_argument("surface", nargs="?", help="a measured map; a spectrum without it", **path)
    load = init.add_mutually_exclusive_group()
    load.add_argument("--force", help="such as '100 N'; by default one that suits the surface")
    load.add_argument("--approach", help="such as '2 um', instead of a force")
    init.add_argument("--young-modulus", metavar="E", help="of the block; by default 210 GPa")
    init.add_argument("--poisson-ratio", metavar="NU", help="of the block; by default 0.3")
    sides: dict[str, Any] = {"nargs": 2, "metavar": ("LX", "LY")}
    lengths = "sides of the map, where its file lacks them; in mm without a unit"
    init.add_argument("--lengths", help=lengths, **sides)
    init.add_argument("--height-unit", metavar="UNIT", help="of heights, where the file lacks it")
    xy = "of x and y of a list of points; by default mm"
    init.add_argument("--xy-unit", metavar="UNIT", help=xy)
    swap = "take rows of the map, its first index, along x instead of y"
    init.add_argument("--swap-xy", action="store_true", help=swap)
    init.add_argument("--channel", help="name or number of a channel of the file")
    where = "the scene to write; by default SURFACE.toml, here"
    init.add_argument("--out", metavar="FILE", help=where, **path)
    init.add_argument("--overwrite", action="store_true", help="replace a file that is there")


def _add_runs(command: Callable[[str, str, str], argparse.ArgumentParser]) -> None:
    """Add the commands that run scenes."""
    run = command("run", "run.run_scene", "Run a scene; write history, laws, figures and report.")
    _add_run_alone(run)
    _add_scene(run)
    ways = (
        "Run a scene in every sensible configuration and draw error against time; or set the "
        "results of two runs side by side."
    )
    compare = command("compare", "studies.compare_any", ways)
    _add_scene(compare, ending=COMPARE_ENDING)
    second = "a second folder of results, where SCENE is a folder too that patchlaw run wrote"
    compare.add_argument("other", nargs="?", metavar="RESULTS", type=Path, help=second)
    against = f"compare with {', '.join(AGAINST)}; by default the best that is reached"
    compare.add_argument("--against", metavar="KIND", choices=AGAINST, help=against)
    equal = f"what is equal where two results are compared: {' or '.join(AT)}"
    compare.add_argument("--at", choices=AT, help=f"{equal}; by default what both prescribe")
    sweep = command(
        "sweep",
        "studies.sweep_scene",
        "Run a scene for many values of its keys; write all load steps and their statistics.",
    )
    _add_scene(sweep, ending=SWEEP_ENDING)
    values = (
        "values of a key, such as surface.spectrum.seed=0..19 or "
        "block.young_modulus='1 GPa, 4 GPa'; several keys make all combinations"
    )
    sweep.add_argument("--vary", action="append", required=True, metavar="KEY=VALUES", help=values)
    part = "run the K-th of N parts of the cases; by default the task of a Slurm array"
    sweep.add_argument("--part", metavar="K/N", type=sweep_part, help=part)
    anew = "begin anew where another sweep's results are"
    sweep.add_argument("--overwrite", action="store_true", help=anew)


def _add_descriptions(command: Callable[[str, str, str], argparse.ArgumentParser]) -> None:
    """Add the commands that run no scene."""
    summary = (
        "Say what a run would do and why, and its memory; write no results, and solve only "
        "what an accuracy chooses keys without a value by."
    )
    plan = command("plan", "run.plan_scene", summary)
    _add_scene(plan, unused=_UNUSED)
    _add_run_alone(plan, unused=_UNUSED)
    for name in ("--open", "-q"):
        plan.add_argument(name, action="store_true", dest="unused", help=_UNUSED)
    laws = "Tabulate the patch laws of a scene; write and draw them."
    tabulate = command("laws", "run.tabulate_laws", laws)
    _add_scene(tabulate)
    forms = f"write them for other programs too: {', '.join(FORMATS)}; may be given several times"
    choices: dict[str, Any] = {"choices": FORMATS, "metavar": "FORMAT", "default": []}
    tabulate.add_argument("--export", action="append", help=forms, **choices)
    called = "what names of exported laws begin with, where several exports meet in one input"
    tabulate.add_argument("--name", default="", help=called)
    surface = "Describe and draw the surface of a scene."
    _add_scene(command("surface", "run.describe_surface", surface))
    command("schema", "keys.print_schema", "Print the JSON Schema of scene files.")
    keys = command("help", "keys.explain_keys", "Explain the sections and keys of a scene.")
    topic = "a section or a key, such as load or load.force; all sections by default"
    keys.add_argument("topic", nargs="?", metavar="KEY", help=topic)
    shells = "Print what lets a shell complete commands, options and keys of scenes."
    complete = command("completion", "keys.print_completion", shells)
    ways = 'bash or zsh; in its startup file: eval "$(patchlaw completion bash)"'
    complete.add_argument("shell", choices=("bash", "zsh"), help=ways)
    checks = "Name versions, and what fails of packages, PETSc, MPI, forms and a small solution."
    command("doctor", "doctor.examine_machine", checks)
    compiled = "Compile all finite element forms now, so that later runs need no compiler."
    names: dict[str, Any] = {"nargs": "+", "default": [], "metavar": "NAME"}
    warm = command("warm", "doctor.compile_ahead", compiled)
    warm.add_argument("--element", help="Q1, Q2, P1, P2; all by default", **names)


def _add_run_alone(command: argparse.ArgumentParser, *, unused: str = "") -> None:
    """Add what a run takes and other commands on a scene do not."""
    resume = unused or "go on with an interrupted run, as without this; leave a finished one"
    command.add_argument("--resume", action="store_true", help=resume)
    stop = unused or "stop cleanly before this wall time is over"
    command.add_argument("--max-time", help=stop, **_TIME)


def _add_scene(command: argparse.ArgumentParser, *, ending: str = "", unused: str = "") -> None:
    """Add what every command on a scene takes: the file, the results folder, changes of keys."""
    command.add_argument("scene", type=Path, help="scene file (TOML)")
    where = (
        f"folder of the results (default: results/SCENE{ending}, by the file's name; where keys "
        f"are set, results/SCENE-KEY=VALUE{ending})"
    )
    command.add_argument("--out", type=Path, metavar="DIR", help=unused or where)
    keys: dict[str, Any] = {"nargs": "+", "action": "extend", "default": []}
    if not ending:  # the folders of comparisons and sweeps hold many scenes
        other = unused or "begin anew, whatever results are in this folder"
        command.add_argument("--overwrite", action="store_true", help=other)
    changes = "change keys of the scene, such as load.approach='4 um'"
    command.add_argument("--set", metavar="KEY=VALUE", help=changes, **keys)


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
    from patchlaw.support.errors import NotInstalled
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
