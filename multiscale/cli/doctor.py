"""The commands about the machine: doctor and warm."""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict
from typing import Any

from rich.console import Console
from rich.markup import escape

from multiscale.doctor.examination import examine, verdict
from multiscale.doctor.finding import Finding
from multiscale.doctor.warm import checked_elements, warm
from multiscale.output import terminal

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
    findings = examine(comm)
    if terminal.speaks(comm):
        if choice.json:
            print(json.dumps([asdict(finding) for finding in findings], indent=2))
        else:
            _show(findings)
    verdict(findings)


def compile_ahead(choice: argparse.Namespace, options: list[str], comm: Any) -> None:
    """Compile all finite element forms now, so that later runs need no compiler.

    Args:
        choice: Parsed words of the command line.
        options: PETSc options given by the user.
        comm: MPI communicator; None for a process on its own.
    """
    folder, count = warm(checked_elements(choice.element), comm)
    terminal.say(comm, f"{count} compiled forms in {folder}")


def _show(findings: list[Finding]) -> None:
    """Print a line for each finding, and its remedy below it."""
    console = Console(highlight=False, soft_wrap=True)
    for finding in findings:
        colour = _COLOUR[finding.state]
        head = f"[{colour}]{finding.state:8}[/][bold]{finding.topic:14}[/]"
        console.print(f"{head}{escape(finding.text)}")
        if finding.remedy:
            console.print(f"{'':22}→ {escape(finding.remedy)}")
