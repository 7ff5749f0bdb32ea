"""Builds what a scene asks for: laws, the block or its compliance, and the coupling of them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from geometry.errors import InputError
from geometry.rigid_plane import Control
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
from multiscale.setup.problem import ProblemSetup

if TYPE_CHECKING:  # finite elements are imported only by scenes that need them
    from macro import Interface


def make_table(setup: ProblemSetup, model: MicroModel, comm: Any) -> LawTable:
    """Tabulate the laws of all patches: each alone, or all from the whole surface on its block.

    Args:
        setup: The scene's ingredients.
        model: Its micro model on the body, see `contact_model`.
        comm: MPI communicator; None for this process alone.

    Raises:
        InputError: When the coupling has no laws.
        NotConverged: When the micro model does not converge.

    Note:
        Collective.
    """
    kind = setup.scene.coupling.kind
    if not setup.uses_laws:
        raise InputError(
            "has no laws",
            key="coupling.kind",
            value=kind,
            allowed="isolated, consistent",
            file=setup.scene.file,
        )
    if kind == "consistent":
        load_history = setup.scene.loading.load_history
        return consistent_laws(
            model,
            setup.patches,
            mean_heights=setup.mean_heights,
            largest=Control(
                **{load_history.quantity: load_history.largest}, tilt=load_history.tilt
            ),
            displacements=patch_displacements(setup, comm, dense=newton_choice(setup).condensed),
            pointwise=setup.scene.coupling.interface == "pointwise",
            tolerance=setup.table_tolerance,
            most_rows=setup.table_rows,
            comm=comm,
        )
    return isolated_laws(
        model,
        setup.patches,
        mean_heights=setup.mean_heights,
        closure_ends=setup.largest_closures,
        love=setup.scene.coupling.love,
        tolerance=setup.table_tolerance,
        most_rows=setup.table_rows,
        comm=comm,
    )


def assemble(
    setup: ProblemSetup, made: LawTable | MicroModel | None, comm: Any
) -> tuple[Coupling, Interface | None]:
    """Put micro and macro model together as the scene asks.

    Args:
        setup: The scene's ingredients.
        made: The patch laws, of couplings that use them, or else the micro model on the body; None
            in a reference.
        comm: MPI communicator; None for this process alone.

    Returns:
        The coupling, and the interface of the block that it presses itself.

    Note:
        Collective.
    """
    if isinstance(made, LawTable):
        return _with_laws(setup, made, comm)
    if made is None:
        return make_reference(setup, comm), None
    return ContactCoupling(made, setup.patches, setup.mean_heights, comm), None


def _with_laws(
    setup: ProblemSetup, table: LawTable, comm: Any
) -> tuple[Coupling, Interface | None]:
    condensed = newton_choice(setup, table).condensed
    patchwise = setup.scene.coupling.interface == "patchwise"
    if table.path is not None and patchwise and setup.scene.loading.load_history.tilt is None:
        return TurningCoupling(table, patch_displacements(setup, comm, dense=condensed)), None
    if condensed:
        return CondensedCoupling(table, patch_compliance(setup, comm)), None
    from macro import LawContactProblem

    interface = embedding(setup, comm)
    laws = [ExtendedLaw(law) for law in table.laws]
    mode = setup.scene.coupling.interface
    pressed = LawContactProblem(interface.block, interface, laws, mode=mode)
    return EmbeddedCoupling(pressed, table), interface
