"""What the commands on a scene have in common: the scene and its results folder."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from geometry.collective import on_root
from multiscale.machine import refuse_detached_processes
from multiscale.scene.scene import Scene


def scene_and_folder(
    choice: argparse.Namespace, comm: Any, *, ending: str = ""
) -> tuple[Scene, Path]:
    """Read the scene on rank 0 and find the folder of its results.

    Args:
        choice: Parsed words of the command line.
        comm: MPI communicator; None for a process on its own.
        ending: What the folder is called after the scene's name, unless the user names a folder.

    Returns:
        The scene and the folder, the same on every rank.

    Raises:
        InputError: When the scene cannot be used, or this process is one of several that should be
            one MPI job and are not.

    Note:
        Collective.
    """
    refuse_detached_processes()

    def read() -> tuple[Scene, Path]:
        scene = Scene.load(choice.scene, choice.set)
        return scene, choice.out or Path("results") / f"{scene.name}{ending}"

    return on_root(comm, read)
