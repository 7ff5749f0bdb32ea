"""Compiles all forms ahead of time, so that compute nodes need no compiler."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from geometry.collective import on_root
from geometry.errors import InputError


def warm(elements: Sequence[str], comm: Any = None) -> tuple[Path, int]:
    """Compile every form that scenes with these elements use.

    What earlier compilations left half done, for longer than two minutes, is cleared first.

    Args:
        elements: Elements of blocks: ``Q1``, ``Q2``, ``P1``, ``P2``.
        comm: MPI communicator; rank 0 compiles. None for a process on its own.

    Returns:
        The folder of the compiled forms, and how many are in it.

    Raises:
        InputError: When an element is unknown, or forms cannot be compiled or kept.

    Note:
        Collective.
    """
    if comm is not None:  # PETSc starts on all ranks together; one rank alone must not
        import macro  # noqa: F401
    return on_root(comm, lambda: _compile_all(elements))


def _compile_all(elements: Sequence[str]) -> tuple[Path, int]:
    from macro import form_cache as jit
    from macro.compat import form_cache

    folder = form_cache()
    if jit.writable(folder):
        for source in jit.stale_locks(folder):
            source.unlink(missing_ok=True)
    for element in elements:
        _use_all_forms(element)
    return folder, len(list(folder.glob("libffcx_*.c.cached")))


def _use_all_forms(element: str) -> None:
    """Do on a tiny block whatever compiles a form: press it, load it, write its fields."""
    from mpi4py import MPI

    from geometry.meshes.block import BlockShape
    from geometry.patches import PatchGrid
    from macro import Block, Interface, Material, UnilateralContactProblem, block_mesh, write_fields

    shape = BlockShape(interface=(1.0, 1.0), height=1.0, cells=(2, 2, 2), element=element)
    block = Block(block_mesh(shape, MPI.COMM_SELF), Material(young_modulus=1.0, poisson_ratio=0.3))
    UnilateralContactProblem(block, 0.0)
    rest = block.stiffness.createVecRight()
    block.reaction(rest)
    interface = Interface(block, PatchGrid(grid=(1, 1), lengths=(1.0, 1.0)))
    with tempfile.TemporaryDirectory() as folder:
        write_fields(Path(folder) / "fields.xdmf", interface, rest.array_r, np.zeros(1))


def checked_elements(names: Sequence[str]) -> tuple[str, ...]:
    """Return the elements asked for, all of them when none is.

    Args:
        names: Names from the command line.

    Raises:
        InputError: When a name is unknown.
    """
    from geometry.meshes.block import ELEMENTS

    for name in names:
        if name not in ELEMENTS:
            raise InputError(
                "this element is unknown", key="--element", value=name, allowed=", ".join(ELEMENTS)
            )
    return tuple(names) or tuple(ELEMENTS)
