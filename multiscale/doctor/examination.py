"""Makes checks on all ranks and collects their results."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from geometry.errors import InputError, PatchlawError
from multiscale.machine.installation import removal, shadows

State = Literal["ok", "warning", "fail"]


@dataclass(frozen=True, slots=True)
class CheckResult:
    """The result of one check.

    Args:
        topic: What was checked.
        state: ``"ok"``; ``"warning"``: runs work but slowly, or may fail elsewhere; ``"fail"``:
            runs cannot work.
        text: What was found, in one line.
        remedy: What to do; empty when all is well.
    """

    topic: str
    state: State
    text: str
    remedy: str = ""


Check = Callable[[Any], list[CheckResult]]
"""A check takes the MPI communicator, or None, and is called on all ranks."""


def examine(comm: Any, checks: Sequence[tuple[str, Check]]) -> list[CheckResult]:
    """Make checks; one that raises an error has failed.

    Args:
        comm: MPI communicator; None for a process on its own.
        checks: Topics and their checks.

    Returns:
        The results of rank 0, the same on every rank. Where a check raised an error on any rank,
        that error is its result.

    Note:
        Collective.
    """
    return [result for topic, check in checks for result in _made(topic, check, comm)]


def _made(topic: str, check: Check, comm: Any) -> list[CheckResult]:
    error, results = None, []
    try:
        results = check(comm)
    except PatchlawError as failure:  # its text holds the remedy
        error = CheckResult(topic, "fail", str(failure))
    except Exception as failure:
        text = f"{type(failure).__name__}: {failure}"
        found = shadows()
        advice = removal(found) if found else "please report this with the lines above"
        error = CheckResult(topic, "fail", text, advice)
    errors = [one for one in gathered(comm, error) if one is not None]
    if errors:
        return errors[:1]
    return results if comm is None else comm.bcast(results, root=0)


def refuse_failures(results: Sequence[CheckResult]) -> None:
    """Raise when a check failed: a run would end with the same exit code or a worse one.

    Args:
        results: What `examine` returned.

    Raises:
        InputError: Naming the failed checks.
    """
    failed = [result.topic for result in results if result.state == "fail"]
    if failed:
        raise InputError(f"not fit to run: {', '.join(failed)}", key="doctor")


def gathered(comm: Any, value: Any) -> list[Any]:
    """Return the values of all ranks.

    Args:
        comm: MPI communicator, or None.
        value: This rank's value.
    """
    return [value] if comm is None else comm.allgather(value)
