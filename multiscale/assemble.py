"""Builds what a scene asks for: laws, the block or its compliance, and the coupling of them."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from geometry.collective import on_root
from geometry.errors import InputError
from micro import FreeSides, HalfSpaceModel, MicroModel, resampled
from multiscale.coupling import AnalyticCoupling, EmbeddedCoupling
from multiscale.couplings.blocks import (
    bending_block,
    contact_correction,
    contact_model,
    embedding,
    yielding,
)
from multiscale.couplings.concurrent import TOLERANCE, ConcurrentCoupling
from multiscale.couplings.condensed import CondensedCoupling
from multiscale.law_tables.consistent import consistent_laws
from multiscale.law_tables.isolated import isolated_laws
from multiscale.law_tables.law_files import LawTable
from multiscale.laws import ExtendedLaw
from multiscale.loading import Coupling
from multiscale.planning.newton_choice import newton_choice
from multiscale.reference.coupling import make_reference
from multiscale.stage import Stage

if TYPE_CHECKING:  # finite elements are imported only by scenes that need them
    from macro import Interface

_SHARP = 1e-2 * TOLERANCE
"""Residual of half-space solutions: their forces are then right to 1e-12, so that neither the unit
of length nor the number of ranks is seen in a result. It costs a tenth more than the usual 1e-8."""

_COARSE = 64  # cells along a side, at most, of the surface that goes ahead


def make_table(stage: Stage, comm: Any) -> LawTable:
    """Tabulate the laws of all patches: each alone, or all from the whole surface under its plane.

    Args:
        stage: The scene's ingredients.
        comm: MPI communicator; None for this process alone.

    Raises:
        InputError: When the coupling has no laws.
        NotConverged: When the micro model does not converge.

    Note:
        Collective.
    """
    kind = stage.scene.coupling.kind
    if not stage.by_laws:
        raise InputError(
            "has no laws",
            key="coupling.kind",
            value=kind,
            allowed="isolated, consistent",
            file=stage.scene.file,
        )
    if kind == "consistent":
        sinking = bending_block(stage, comm)
        return consistent_laws(
            _sharp(stage.model if sinking is None else contact_model(stage)),
            stage.patches,
            mean_heights=stage.mean_heights,
            approach_end=on_root(comm, lambda: stage.approach_end),
            tolerance=stage.table_tolerance,
            most_rows=stage.table_rows,
            tilt=stage.furthest[1],
            sinking=sinking,
            comm=comm,
        )
    return isolated_laws(
        _sharp(stage.model),
        stage.patches,
        mean_heights=stage.mean_heights,
        closure_ends=stage.closure_ends,
        love=stage.scene.coupling.love,
        tolerance=stage.table_tolerance,
        most_rows=stage.table_rows,
        comm=comm,
    )


def assemble(stage: Stage, table: LawTable | None, comm: Any) -> tuple[Coupling, Interface | None]:
    """Put micro and macro model together as the scene asks.

    Args:
        stage: The scene's ingredients.
        table: The patch laws, of couplings that use them.
        comm: MPI communicator; None for this process alone.

    Returns:
        The coupling, and the interface of the block that it presses itself.

    Note:
        Collective.
    """
    if table is not None:
        return _with_laws(stage, table, comm)
    if stage.meshes is not None:
        return make_reference(stage, comm), None
    if stage.embedded:
        return _concurrent(stage, comm), None
    return AnalyticCoupling(_sharp(stage.model), stage.patches, stage.mean_heights), None


def _with_laws(stage: Stage, table: LawTable, comm: Any) -> tuple[Coupling, Interface | None]:
    if newton_choice(stage, table).condensed:
        return CondensedCoupling(table, yielding(stage, table, comm)), None
    from macro import PressedBlock

    interface = embedding(stage, comm)
    laws = [ExtendedLaw(law) for law in table.laws]
    mode = stage.scene.coupling.interface
    pressed = PressedBlock(interface.block, interface, laws, mode=mode)
    return EmbeddedCoupling(pressed, table), interface


def _concurrent(stage: Stage, comm: Any) -> Coupling:
    model = _sharp(contact_model(stage))
    sides = model.sides if isinstance(model, HalfSpaceModel) else None
    return ConcurrentCoupling(
        model,
        stage.patches,
        stage.mean_heights,
        contact_correction(stage, comm),
        coarse=None if stage.by_summits else _coarse_model(stage, sides),
        comm=comm,
    )


def _sharp(model: MicroModel) -> MicroModel:
    """Return a micro model whose own error is none beside the tolerances of what it goes into."""
    return replace(model, tolerance=_SHARP) if isinstance(model, HalfSpaceModel) else model


def _coarse_model(stage: Stage, sides: FreeSides | None) -> MicroModel | None:
    """Return a half-space of fewer cells; None where the surface itself has no more."""
    surface = stage.surface
    cells = min(surface.grid[0], _COARSE), min(surface.grid[1], _COARSE)
    if cells == surface.grid:
        return None
    return HalfSpaceModel(
        surface=resampled(surface, cells),
        contact_modulus=stage.model.contact_modulus,
        highest=surface.highest,
        sides=sides,
    )
