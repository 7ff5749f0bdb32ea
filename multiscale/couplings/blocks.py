"""Blocks for couplings: the meshed block under its interface, its compliance, its correction."""

from __future__ import annotations

import math
import sys
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from geometry.partition import Partition, UnevenPartition
from micro import FreeSides, HalfSpace, HalfSpaceModel, MicroModel, influence_matrix
from multiscale.couplings.yielding import SpreadLoads, UniformLoads, Yielding
from multiscale.law_tables.law_files import LawTable
from multiscale.scene import Scene
from multiscale.stage import Stage

if TYPE_CHECKING:  # finite elements are imported only by scenes that need them
    from macro import Correction, Interface, Material

Array = NDArray[np.float64]

_LOADS = 16  # rectangles along a side, at least, that tell a smooth field the contacts' forces
_MOST_LOADS = 32
"""And at most, where they would be more than its square. Set 1, seed 1 at 8 µm, which has contacts
near a free side, carries 3.0284 and 3.0281 N with 16 and 32 on a block of 24 × 24 × 16 cells."""

_HALVINGS = 2
"""Halvings of the outermost rectangles where the micro model knows of no sides: contacts near them
feel them on a finer scale. None misses 1.4 % of the force of Set 1, seed 1 at 8 µm; 1, 2, 3 miss
0.5, 0.2 and 0.1 %."""
_CORNER_HALVINGS = 1
"""Halvings where it does, for the sake of corners: a ball cut by one carries 2 % too much, without
7 %."""
_REACH = 0.25
"""Reach of free sides in the micro model, of the shortest side of the block."""


def embedding(stage: Stage, comm: Any) -> Interface:
    """Mesh and assemble the block of a scene, with its patches on top.

    Args:
        stage: The scene's ingredients.
        comm: MPI communicator; None for this process alone.

    Note:
        Collective.
    """
    from mpi4py import MPI

    from macro import Block, Interface, block_mesh

    section = stage.scene.block
    mesh = block_mesh(stage.shape, comm or MPI.COMM_SELF)
    return Interface(Block(mesh, block_material(stage), sides=section.sides), stage.patches)


def patch_compliance(stage: Stage, comm: Any) -> Array:
    """Return the compliance of a scene's block under its patches, shape (N, N) [mm/MPa].

    Args:
        stage: The scene's ingredients.
        comm: MPI communicator; None for this process alone.

    Note:
        Collective.
    """
    if stage.scene.coupling.decomposed:
        if stage.scene.coupling.kind == "consistent":  # whose laws know of free sides themselves
            correction = contact_correction(stage, comm)
        else:
            correction = smooth_correction(stage, scene_loads(stage), comm)
        return _half_space(stage) + correction.patch_compliance(stage.patches)
    from mpi4py import MPI

    from macro import plain_compliance
    from macro.compliance_cache import cached
    from macro.solvers import users_options

    def compute() -> dict[str, Array]:
        return {"compliance": plain_compliance(embedding(stage, comm))}

    sides = stage.scene.block.sides
    key = (stage.shape, block_material(stage), sides, stage.patches, users_options())
    return cached("plain", key, compute, comm or MPI.COMM_SELF)["compliance"]


def bending_block(stage: Stage, comm: Any) -> Correction | None:
    """Return what a scene's consistent laws need to know of its block; None on a plain mesh.

    Args:
        stage: The scene's ingredients.
        comm: MPI communicator; None for this process alone.

    Note:
        Collective.
    """
    coupling = stage.scene.coupling
    if not (coupling.decomposed and coupling.kind == "consistent"):
        return None
    return contact_correction(stage, comm)


def contact_correction(stage: Stage, comm: Any) -> Correction:
    """Return what a scene's block yields beyond what `contact_model` knows.

    Args:
        stage: The scene's ingredients.
        comm: MPI communicator; None for this process alone.

    Note:
        Collective.
    """
    found = smooth_correction(stage, fine_loads(stage), comm)
    sides = free_sides(stage)
    if sides is None:
        return found
    beside = sides.top(found.x, found.y, found.loads)
    return found.less(np.divide(beside, stage.model.contact_modulus))


def contact_model(stage: Stage) -> MicroModel:
    """Return a scene's micro model; a half-space takes the free sides of the block into account.

    Args:
        stage: The scene's ingredients.
    """
    model, sides = stage.model, free_sides(stage)
    if isinstance(model, HalfSpaceModel) and sides is not None:
        return replace(model, sides=sides)
    return model


def free_sides(stage: Stage) -> FreeSides | None:
    """Return the free sides that a scene's half-space model takes into account.

    None where there are none, the micro model is another one, or the block is a mesh.

    Args:
        stage: The scene's ingredients.
    """
    coupling = stage.scene.coupling
    together = coupling.decomposed and coupling.kind != "isolated"
    if not (together and _has_free_sides(stage) and isinstance(stage.model, HalfSpaceModel)):
        return None
    return FreeSides(
        lengths=stage.surface.lengths,
        poisson_ratio=stage.scene.block.poisson_ratio,
        reach=_REACH * min(*stage.surface.lengths, stage.shape.height),
    )


def _has_free_sides(stage: Stage) -> bool:
    return stage.scene.block.sides == "free" and not stage.shape.margin


def yielding(stage: Stage, table: LawTable, comm: Any) -> Yielding:
    """Return how a scene's block yields to the pressures of patch laws.

    Args:
        stage: The scene's ingredients.
        table: The laws; those made on the block know where the contacts are.
        comm: MPI communicator; None for this process alone.

    Note:
        Collective.
    """
    if table.spread is None:
        return UniformLoads(patch_compliance(stage, comm))
    return SpreadLoads(_half_space(stage), table.spread)


def fine_loads(stage: Stage) -> UnevenPartition:
    """Return rectangles that tell the block of a scene where its contacts are.

    They divide the patches, unless these are too many, and are smallest at free sides, above all
    if the micro model knows of none.

    Args:
        stage: The scene's ingredients.
    """
    patches = stage.patches
    counts = [n * -(-_LOADS // n) for n in patches.grid]
    if math.prod(counts) > _MOST_LOADS**2:
        counts = [min(count, _MOST_LOADS) for count in counts]
    even = [
        np.linspace(0.0, length, count + 1, dtype=np.float64)
        for length, count in zip(patches.lengths, counts, strict=True)
    ]
    if _has_free_sides(stage):
        halvings = _HALVINGS if free_sides(stage) is None else _CORNER_HALVINGS
        even = [_graded(ticks, halvings) for ticks in even]
    return UnevenPartition(ticks_x=tuple(even[0]), ticks_y=tuple(even[1]))


def _graded(ticks: Array, halvings: int) -> Array:
    """Halve the outermost intervals towards the ends."""
    halves = 0.5 ** np.arange(halvings, 0, -1)
    first, last = ticks[0] + halves * (ticks[1] - ticks[0]), ticks[-1] - halves * np.diff(ticks)[-1]
    return np.concatenate([ticks[:1], first, ticks[1:-1], last[::-1], ticks[-1:]])


def _half_space(stage: Stage) -> Array:
    return np.asarray(influence_matrix(stage.patches) / (np.pi * stage.model.contact_modulus))


def smooth_correction(stage: Stage, loads: Partition, comm: Any) -> Correction:
    """Return what the scene's block adds to the half-space.

    Args:
        stage: The scene's ingredients.
        loads: Rectangles that pressures are gathered on.
        comm: MPI communicator; None for this process alone.

    Note:
        Collective.
    """
    from mpi4py import MPI

    from macro import cached_correction

    material = block_material(stage)
    return cached_correction(
        stage.shape,
        material,
        stage.scene.block.sides,
        loads,
        HalfSpace(material.young_modulus, material.poisson_ratio),
        comm or MPI.COMM_SELF,
    )


def load_together(scene: Scene, comm: Any) -> None:
    """Load the finite elements on all ranks where a scene may need them.

    PETSc starts with collective calls on all processes of the job: one rank alone must not.

    Args:
        scene: The scene.
        comm: MPI communicator; None for this process alone, which loads them when it needs them.

    Note:
        Collective.
    """
    if comm is not None and scene.coupling.kind != "analytic":
        import macro  # noqa: F401


def correction_known(stage: Stage) -> bool:
    """Tell whether the smooth correction of a scene is on disk from an earlier run.

    Not collective: a rank of a job that has not loaded the finite elements does not know.

    Args:
        stage: The scene's ingredients.
    """
    if "macro" not in sys.modules and _one_of_many():
        return False
    from macro import correction_is_kept

    return correction_is_kept(
        stage.shape, block_material(stage), stage.scene.block.sides, scene_loads(stage)
    )


def _one_of_many() -> bool:
    mpi = sys.modules.get("mpi4py.MPI")
    return mpi is not None and mpi.COMM_WORLD.size > 1


def scene_loads(stage: Stage) -> Partition:
    """Return the rectangles that the correction of a scene's decomposed block is made for.

    Args:
        stage: The scene's ingredients.
    """
    few = stage.patches.count <= _MOST_LOADS**2
    return stage.patches if few and stage.scene.coupling.kind == "isolated" else fine_loads(stage)


def block_material(stage: Stage) -> Material:
    """Return the elastic constants of a scene's block."""
    from macro import Material

    section = stage.scene.block
    return Material(young_modulus=section.young_modulus, poisson_ratio=section.poisson_ratio)


def final_field(stage: Stage, pressure: Array, comm: Any) -> tuple[Interface, Array]:
    """Return the meshed block and its displacements under pressures that are uniform on patches.

    Args:
        stage: The scene's ingredients.
        pressure: Pressures of the patches, shape (N,) [MPa].
        comm: MPI communicator; None for this process alone.

    Note:
        Collective.
    """
    interface = embedding(stage, comm)
    function = interface.block.solve(interface.load(pressure))
    return interface, function.x.array[: interface.block.owned_dofs].copy()
