"""The console that lines and tables are printed on; only rank 0 prints."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from rich.console import Console

_QUIET: ContextVar[bool] = ContextVar("quiet", default=False)


@contextmanager
def quietly(quiet: bool) -> Iterator[None]:
    """Print nothing but errors and cautions, which go to the error stream.

    Args:
        quiet: Whether it is so; otherwise nothing changes.
    """
    token = _QUIET.set(quiet)
    try:
        yield
    finally:
        _QUIET.reset(token)


def is_quiet() -> bool:
    """Tell whether nothing but errors and cautions is printed."""
    return _QUIET.get()


def speaks(comm: Any) -> bool:
    """Tell whether this process prints and writes files.

    Args:
        comm: MPI communicator, or None.
    """
    return comm is None or comm.rank == 0


def colours() -> Literal["auto"] | None:
    """Return which colours a console of rich has: none, nor bold letters, with ``NO_COLOR``."""
    return None if os.environ.get("NO_COLOR") else "auto"


def console_of(comm: Any, *, least_width: int = 0, stderr: bool = False) -> Console:
    """Return a console that is silent on all ranks but the first.

    Lines for tables are cut at the width of the terminal; all others stay whole, so that they can
    be searched and copied.

    Args:
        comm: MPI communicator, or None.
        least_width: Least width of tables; 0 for a console without tables.
        stderr: Whether it prints to the error stream.
    """
    from rich.console import Console  # its import takes time that many processes do without

    console = Console(
        stderr=stderr,
        soft_wrap=not least_width,
        highlight=False,
        quiet=not speaks(comm) or (_QUIET.get() and not stderr),
        color_system=colours(),
    )
    if least_width:
        console.width = max(console.width, least_width)
    return console
