"""The commands about the machine: doctor and warm."""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict
from typing import Any

from rich.console import Console
from rich.markup import escape

from multiscale import doctor
from multiscale.console import colours, speaks
from multiscale.doctor import Check, CheckResult, examine
from multiscale.output import terminal
from support.errors import InputError

CHECKS: dict[str, Check] = {
    "packages": doctor.packages,
    "PETSc": doctor.petsc,
    "launcher": doctor.launcher,
    "ranks": doctor.ranks,
    "threads": doctor.threads,
    "form cache": doctor.form_cache,
    "test solve": doctor.known_solve,
}
"""Topics and checks of the doctor, in the order in which they are made and shown."""

_COLOUR = {"ok": "green", "warning": "yellow", "fail": "bold red"}


def examine_machine(choice: argparse.Namespace, options: list[str], comm: Any) -> None:
    """Check versions, MPI, threads, memory and compiled forms; solve a problem of known answer.

    Args:
        choice: Parsed words of the command line.
        options: PETSc options given by the user.
        comm: MPI communicator; None for a process on its own.

    Raises:
        InputError: When a check failed, as a run would end with the same exit code or a worse one.
    """
    results = {}
    for topic, result in examine(comm, CHECKS):
        results[topic] = result
        if speaks(comm) and not choice.json:
            show(topic, result)
    if speaks(comm) and choice.json:
        listed = [{"topic": topic} | asdict(result) for topic, result in results.items()]
        print(json.dumps(listed, indent=2))
    if failed := [topic for topic, result in results.items() if result.state == "fail"]:
        raise InputError(f"not fit to run: {', '.join(failed)}", key="doctor")


def compile_ahead(choice: argparse.Namespace, options: list[str], comm: Any) -> None:
    """Compile all finite element forms now, so that later runs need no compiler.

    Args:
        choice: Parsed words of the command line.
        options: PETSc options given by the user.
        comm: MPI communicator; None for a process on its own.
    """
    folder, count = doctor.warm(choice.element, comm)
    terminal.say(comm, f"{count} compiled forms in {folder}")


def show(topic: str, result: CheckResult) -> None:
    """Print a line for a result, and its remedy below it.

    Args:
        topic: What was checked.
        result: The result.
    """
    console = Console(highlight=False, soft_wrap=True, color_system=colours())
    colour = _COLOUR[result.state]
    console.print(f"[{colour}]{result.state:8}[/][bold]{topic:14}[/]{escape(result.text)}")
    if result.remedy:
        console.print(f"{'':22}→ {escape(result.remedy)}")
