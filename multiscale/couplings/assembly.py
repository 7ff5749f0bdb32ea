"""Builds what a scene asks for: laws, the block or its compliance, and the coupling of them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from geometry.control import Control
from geometry.errors import InputError
from micro import MicroModel
from multiscale.couplings.blocks import embedding, patch_compliance, patch_displacements
from multiscale.couplings.condensed import CondensedCoupling
from multiscale.couplings.free_tilt import TurningCoupling
from multiscale.couplings.load_steps import ContactCoupling, EmbeddedCoupling
from multiscale.couplings.newton_choice import newton_choice
from multiscale.couplings.reference import make_reference
from multiscale.laws.consistent import consistent_laws
from multiscale.laws.files import LawTable
from multiscale.laws.isolated import isolated_laws
from multiscale.laws.patch_law import ExtendedLaw
from multiscale.loading.stepper import Coupling
from multiscale.setup.problem import Stage

if TYPE_CHECKING:  # finite elements are imported only by scenes that need them
    from macro import Interface


def make_table(stage: Stage, model: MicroModel, comm: Any) -> LawTable:
    """Tabulate the laws of all patches: each alone, or all from the whole surface on its block.

    Args:
        stage: The scene's ingredients.
        model: Its micro model on the body, see `contact_model`.
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
        programme = stage.scene.loading.programme
        return consistent_laws(
            model,
            stage.patches,
            mean_heights=stage.mean_heights,
            largest=Control(**{programme.quantity: programme.largest}, tilt=programme.tilt),
            displacements=patch_displacements(stage, comm, dense=newton_choice(stage).condensed),
            pointwise=stage.scene.coupling.interface == "pointwise",
            tolerance=stage.table_tolerance,
            most_rows=stage.table_rows,
            comm=comm,
        )
    return isolated_laws(
        model,
        stage.patches,
        mean_heights=stage.mean_heights,
        closure_ends=stage.closure_ends,
        love=stage.scene.coupling.love,
        tolerance=stage.table_tolerance,
        most_rows=stage.table_rows,
        comm=comm,
    )


def assemble(
    stage: Stage, made: LawTable | MicroModel | None, comm: Any
) -> tuple[Coupling, Interface | None]:
    """Put micro and macro model together as the scene asks.

    Args:
        stage: The scene's ingredients.
        made: The patch laws, of couplings that use them, or else the micro model on the body; None
            in a reference.
        comm: MPI communicator; None for this process alone.

    Returns:
        The coupling, and the interface of the block that it presses itself.

    Note:
        Collective.
    """
    if isinstance(made, LawTable):
        return _with_laws(stage, made, comm)
    if made is None:
        return make_reference(stage, comm), None
    return ContactCoupling(made, stage.patches, stage.mean_heights, comm), None


def _with_laws(stage: Stage, table: LawTable, comm: Any) -> tuple[Coupling, Interface | None]:
    condensed = newton_choice(stage, table).condensed
    patchwise = stage.scene.coupling.interface == "patchwise"
    if table.path is not None and patchwise and stage.scene.loading.programme.tilt is None:
        return TurningCoupling(table, patch_displacements(stage, comm, dense=condensed)), None
    if condensed:
        return CondensedCoupling(table, patch_compliance(stage, comm)), None
    from macro import PressedBlock

    interface = embedding(stage, comm)
    laws = [ExtendedLaw(law) for law in table.laws]
    mode = stage.scene.coupling.interface
    pressed = PressedBlock(interface.block, interface, laws, mode=mode)
    return EmbeddedCoupling(pressed, table), interface
