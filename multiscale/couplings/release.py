"""Frees the memory of bodies that nothing refers to any more."""

from __future__ import annotations

import gc
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from macro import ElasticBody


def free_bodies(bodies: list[ElasticBody]) -> None:
    """Free bodies that nothing else refers to any more.

    PETSc keeps objects that Python drops until it is asked on their own communicator. Without this
    a program that makes many runs would grow by a block with each.

    Args:
        bodies: The bodies; the list is emptied.

    Note:
        Collective.
    """
    if not bodies:
        return
    from macro.compat import collect_garbage

    comms = [body.stiffness.comm.duplicate() for body in bodies]  # these outlive their bodies
    bodies.clear()
    gc.collect()  # a body and its contact problem refer to each other
    for comm in comms:
        collect_garbage(comm)
        comm.destroy()
