"""Examines what patchlaw stands on: packages, MPI, threads, form compiler, memory, a test solve."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from geometry.errors import InputError, PatchlawError

State = Literal["ok", "warning", "fail"]


@dataclass(frozen=True, slots=True)
class Finding:
    """What one check found.

    Args:
        topic: What was looked at.
        state: ``"ok"``; ``"warning"``: runs work but slowly, or may fail elsewhere; ``"fail"``:
            runs cannot work.
        text: What was found, in one line.
        remedy: What to do; empty when all is well.
    """

    topic: str
    state: State
    text: str
    remedy: str = ""


Check = Callable[[Any], list[Finding]]


def examine(comm: Any) -> list[Finding]:
    """Make all checks; one that breaks is a finding as well.

    Args:
        comm: MPI communicator; None for a process on its own.

    Returns:
        The findings, the same on every rank.

    Note:
        Collective.
    """
    from multiscale.doctor import forms as doctor_forms
    from multiscale.doctor import machine as doctor_machine
    from multiscale.doctor import packages as doctor_packages

    checks: Sequence[tuple[str, Check]] = (
        ("packages", doctor_packages.versions),
        ("PETSc", doctor_packages.petsc),
        ("BLAS", doctor_machine.blas),
        ("launcher", doctor_machine.launcher),
        ("ranks", doctor_machine.ranks),
        ("threads", doctor_machine.threads),
        ("memory", doctor_machine.memory),
        ("form compiler", doctor_forms.compiler_works),
        ("form cache", doctor_forms.cache),
        ("test solve", doctor_forms.known_solve),
    )
    return [finding for topic, check in checks for finding in _made(topic, check, comm)]


def verdict(findings: Sequence[Finding]) -> None:
    """Raise when a check failed.

    Args:
        findings: What `examine` found.

    Raises:
        InputError: Naming the failed checks; a run would end with the same exit code or a worse.
    """
    failed = [finding.topic for finding in findings if finding.state == "fail"]
    if failed:
        raise InputError(f"not fit to run: {', '.join(failed)}", key="doctor")


def _made(topic: str, check: Check, comm: Any) -> list[Finding]:
    """Make one check; the findings of rank 0 hold unless a check broke on any rank."""
    error = None
    findings: list[Finding] = []
    try:
        findings = check(comm)
    except PatchlawError as told:  # its text holds the remedy
        error = str(told), ""
    except Exception as raised:
        error = f"{type(raised).__name__}: {raised}", "please report this with the lines above"
    errors = [error] if comm is None else comm.allgather(error)
    broken = [told for told in errors if told is not None]
    if broken:
        return [Finding(topic, "fail", *broken[0])]
    return findings if comm is None else comm.bcast(findings, root=0)
