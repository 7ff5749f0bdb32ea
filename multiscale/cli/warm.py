"""Compiles the forms of finite elements ahead of runs, which then need no compiler."""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from multiscale.console import say
from support.collective import on_root
from support.errors import InputError


def warm(elements: Sequence[str], comm: Any = None) -> tuple[Path, int]:
    """Compile every form that scenes with these elements use.

    Compilations that were cut short more than two minutes ago are cleared first.

    Args:
        elements: Elements of blocks, ``Q1``, ``Q2``, ``P1``, ``P2``; all of them when empty.
        comm: MPI communicator; rank 0 compiles. None for a process on its own.

    Returns:
        The folder of the compiled forms, and how many are in it.

    Raises:
        InputError: When an element is unknown, or forms cannot be compiled or stored.

    Note:
        Collective.
    """
    from geometry.meshes.block import ELEMENTS

    if unknown := set(elements) - set(ELEMENTS):
        raise InputError(
            "this element is unknown", key="--element", value=min(unknown),
            allowed=", ".join(ELEMENTS),
        )  # fmt: skip
    if comm is not None:  # PETSc starts on all ranks together; one rank alone must not
        import macro.bodies  # noqa: F401

    def compile_all() -> tuple[Path, int]:
        from macro import form_cache as jit
        from macro.compat import form_folder

        folder = form_folder()
        if jit.writable(folder):
            for source in jit.stale_locks(folder):
                source.unlink(missing_ok=True)
        for element in elements or ELEMENTS:
            _use_all_forms(element)
        return folder, jit.compiled(folder)

    return on_root(comm, compile_all)


def _use_all_forms(element: str) -> None:
    """Do on a tiny block whatever compiles a form: make its problems and write its fields."""
    from mpi4py import MPI

    from geometry.meshes.block import BlockShape
    from geometry.patches import PatchGrid
    from macro import (
        Block,
        FieldStep,
        LoadedFace,
        Material,
        UnilateralContactProblem,
        block_mesh,
        write_fields,
    )

    shape = BlockShape(interface=(1.0, 1.0), height=1.0, cells=(2, 2, 2), element=element)
    block = Block(block_mesh(shape, MPI.COMM_SELF), Material(young_modulus=1.0, poisson_ratio=0.3))
    UnilateralContactProblem(block, 0.0)
    rest = block.stiffness.createVecRight()
    block.reaction(rest)
    face = LoadedFace.of_block(block, PatchGrid(grid=(1, 1), lengths=(1.0, 1.0)))
    with tempfile.TemporaryDirectory() as folder:
        at_rest = FieldStep(0, rest.array_r, np.zeros(1))
        write_fields(Path(folder) / "fields.xdmf", face, [at_rest])


def compile_ahead(choice: argparse.Namespace, options: list[str], comm: Any) -> None:
    """Compile all finite element forms now, so that later runs need no compiler.

    Args:
        choice: Parsed words of the command line.
        options: PETSc options given by the user.
        comm: MPI communicator; None for a process on its own.
    """
    folder, count = warm(choice.element, comm)
    say(comm, f"{count} compiled forms in {folder}")
