"""Makes the laws and the coupling that a scene asks for."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from geometry.errors import InputError
from micro import MicroModel
from multiscale.couplings.blocks import embedding, patch_compliance, patch_displacements
from multiscale.couplings.condensed import CondensedCoupling, FreePlaneCoupling
from multiscale.couplings.load_steps import ContactCoupling, EmbeddedCoupling
from multiscale.couplings.newton_choice import newton_choice
from multiscale.couplings.reference import ReferenceCoupling, make_reference
from multiscale.laws.consistent import consistent_laws
from multiscale.laws.isolated import isolated_laws
from multiscale.laws.law_table import LawTable
from multiscale.loading.stepper import Coupling
from multiscale.setup.problem import ProblemSetup

if TYPE_CHECKING:  # finite elements are imported only by scenes that need them
    from macro import Block


def make_table(setup: ProblemSetup, model: MicroModel, comm: Any) -> LawTable:
    """Tabulate the laws of all patches, each alone or all from the whole surface on its block.

    Args:
        setup: The problem set up from the scene.
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
            largest=load_history.control(load_history.largest),
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


def assemble(setup: ProblemSetup, make: Callable[[], LawTable | MicroModel], comm: Any) -> Coupling:
    """Put micro and macro model together as the scene asks.

    Args:
        setup: The problem set up from the scene.
        make: Makes the patch laws, of couplings that use them, or else the micro model on the body;
            not called for a reference.
        comm: MPI communicator; None for this process alone.

    Note:
        Collective.
    """
    if setup.micro is None:
        return make_reference(setup, comm)
    made = make()
    if not isinstance(made, LawTable):
        return ContactCoupling(made, setup.patches, setup.mean_heights, comm)
    condensed = newton_choice(setup, made).condensed
    mode, tilt = setup.scene.coupling.interface, setup.scene.loading.load_history.tilt
    if made.path is not None and mode == "patchwise" and tilt is None:
        return FreePlaneCoupling(made, patch_displacements(setup, comm, dense=condensed))
    if condensed:
        return CondensedCoupling(made, patch_compliance(setup, comm))
    from macro import LawContactProblem

    interface = embedding(setup, comm)
    problem = LawContactProblem(interface.block, interface, made.laws, mode=mode)
    return EmbeddedCoupling(problem, made, interface)


def meshed_blocks(coupling: Coupling | None) -> list[Block]:
    """Return the meshed blocks that a coupling solves its load steps on, the finest last.

    Args:
        coupling: The coupling; None before it is made.
    """
    if isinstance(coupling, ReferenceCoupling | EmbeddedCoupling):
        return coupling.blocks
    return []
