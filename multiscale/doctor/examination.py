"""Examines what patchlaw stands on: packages, MPI, threads, form compiler, memory, a test solve."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from geometry.errors import InputError, PatchlawError
from multiscale.doctor import forms, machine, packages
from multiscale.doctor.finding import Finding

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
    checks: Sequence[tuple[str, Check]] = (
        ("packages", packages.versions),
        ("PETSc", packages.petsc),
        ("BLAS", machine.blas),
        ("launcher", machine.launcher),
        ("ranks", machine.ranks),
        ("threads", machine.threads),
        ("memory", machine.memory),
        ("form compiler", forms.compiler_works),
        ("form cache", forms.cache),
        ("test solve", forms.known_solve),
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
