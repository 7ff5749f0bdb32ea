"""The commands about the machine: doctor and warm."""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from rich.console import Console
from rich.markup import escape

from multiscale import compiled_forms, doctor
from multiscale.doctor import Check, CheckResult, examine, refuse_failures
from multiscale.output import terminal

CHECKS: dict[str, Check] = {
    "packages": doctor.packages,
    "PETSc": doctor.petsc,
    "BLAS": doctor.blas,
    "launcher": doctor.launcher,
    "ranks": doctor.ranks,
    "threads": doctor.threads,
    "memory": doctor.memory,
    "form compiler": compiled_forms.compiler_works,
    "form cache": compiled_forms.cache,
    "test solve": compiled_forms.known_solve,
}
"""Topics and checks of the doctor, in the order in which they are made and shown."""

_COLOUR = {"ok": "green", "warning": "yellow", "fail": "bold red"}


def examine_machine(choice: argparse.Namespace, options: list[str], comm: Any) -> None:
    """Check versions, MPI, threads, form compiler and memory; solve a small block.

    Args:
        choice: Parsed words of the command line.
        options: PETSc options given by the user.
        comm: MPI communicator; None for a process on its own.

    Raises:
        InputError: When a check failed; exit code 2.
    """
    results = examine(comm, CHECKS)
    if terminal.speaks(comm):
        if choice.json:
            listed = [{"topic": topic} | asdict(result) for topic, result in results.items()]
            print(json.dumps(listed, indent=2))
        else:
            show(results)
    refuse_failures(results)


def compile_ahead(choice: argparse.Namespace, options: list[str], comm: Any) -> None:
    """Compile all finite element forms now, so that later runs need no compiler.

    Args:
        choice: Parsed words of the command line.
        options: PETSc options given by the user.
        comm: MPI communicator; None for a process on its own.
    """
    folder, count = compiled_forms.warm(choice.element, comm)
    terminal.say(comm, f"{count} compiled forms in {folder}")


def show(results: Mapping[str, CheckResult]) -> None:
    """Print a line for each result, and its remedy below it.

    Args:
        results: The results by topic.
    """
    console = Console(highlight=False, soft_wrap=True)
    for topic, result in results.items():
        colour = _COLOUR[result.state]
        head = f"[{colour}]{result.state:8}[/][bold]{topic:14}[/]"
        console.print(f"{head}{escape(result.text)}")
        if result.remedy:
            console.print(f"{'':22}→ {escape(result.remedy)}")
