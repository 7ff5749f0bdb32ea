"""The command that shows results in three dimensions."""

from __future__ import annotations

import argparse
import os
import sys
from functools import partial
from typing import Any

from patchlaw.multiscale import console
from patchlaw.multiscale.runs.output.results_folder import locked
from patchlaw.multiscale.runs.output.view import view, write_views
from patchlaw.support.errors import InputError
from patchlaw.support.parallel import on_root_alone


def view_results(choice: argparse.Namespace, options: list[str], comm: Any) -> None:
    """Write pages that show results in three dimensions, or open a window with one of them.

    Args:
        choice: Parsed words of the command line.
        options: PETSc options given by the user; without effect.
        comm: MPI communicator; None for a process on its own.
    """
    folder, which = choice.results, {"step": choice.step, "mode": choice.mode}
    if not folder.is_dir():
        allowed = "a folder that patchlaw run wrote"
        raise InputError("is not a folder", key="RESULTS", value=str(folder), allowed=allowed)
    if choice.window:
        if sys.platform == "linux" and not {"DISPLAY", "WAYLAND_DISPLAY"} & os.environ.keys():
            problem = "there is no display to open a window on"
            raise InputError(problem, key="--window", allowed="pages, which are written without it")
        if comm is None or comm.rank == 0:
            for name in choice.show or ("",):
                view(folder, name, **which).show()
        return
    with locked(folder, comm):
        write = partial(write_views, folder, choice.show or (), **which)
        files = on_root_alone(comm, write)
    console.show_files(comm, files)
    if choice.open:
        console.open_page(comm, files)
