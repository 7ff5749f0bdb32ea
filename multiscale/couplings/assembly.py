"""Makes the laws and the coupling that a scene asks for, and chooses their Newton's method."""

from __future__ import annotations

import gc
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry import InputError
from micro import MicroModel
from multiscale.couplings.body import has_body_term
from multiscale.couplings.condensed import CondensedCoupling
from multiscale.couplings.contact import ContactCoupling
from multiscale.couplings.law_couplings import EmbeddedCoupling, FreePlaneCoupling
from multiscale.couplings.patch_compliance import embedding, patch_compliance, patch_displacements
from multiscale.couplings.reference import ReferenceCoupling, make_reference
from multiscale.couplings.representative import FaceCoupling, face_laws
from multiscale.laws.consistent import consistent_laws
from multiscale.laws.isolated import isolated_laws
from multiscale.laws.law_table import LawTable
from multiscale.loading.load_step import LoadStep
from multiscale.loading.stepper import Coupling
from multiscale.readable import Detail, Observer, percent
from multiscale.results.history import range_notes
from multiscale.results.reference_record import ReferenceRecord
from multiscale.scene.scene import Scene
from multiscale.setup.problem import ProblemSetup

if TYPE_CHECKING:  # finite elements are imported only by scenes that need them
    from macro import ElasticBody

Array = NDArray[np.float64]

MOST_CYCLES_PER_STEP = 12
"""Multigrid cycles that a load step of the full Newton takes at most, when it starts from earlier
steps. With fewer patches that can touch it takes about one for each (the paper's cube with 4 × 4
patches, 4 of them loaded: 39 in 8 steps; with 2 of 64 that can touch: 36 in 40)."""
CYCLES_AT_POINTS = 24
"""Those of a load step of laws of samples, which stand at points: 6 to 60 on four parts."""

CYCLES_PER_PATCH = 11
"""Multigrid cycles that the compliance of one patch takes, measured on the paper's cube with 4 × 4
and 8 × 8 patches."""

_UNLESS_FLAT = "; should a patch turn out to be flat, condensed all the same"


class NewtonChoice(NamedTuple):
    """Which Newton solves the load steps, and why.

    Attributes:
        condensed: Whether it is the dense one of the patches.
        why: The reason, as a sentence.
    """

    condensed: bool
    why: str


def full_cycles(setup: ProblemSetup, steps: int) -> int:
    """Return the multigrid cycles that load steps on the mesh are predicted to take.

    Args:
        setup: The problem set up from the scene.
        steps: Load steps.
    """
    if setup.samples:
        return steps * CYCLES_AT_POINTS
    return steps * min(max(setup.interfering_patches, 1), MOST_CYCLES_PER_STEP)


def newton_choice(setup: ProblemSetup, table: LawTable | None = None) -> NewtonChoice:
    """Choose the Newton of the scene, or the one that is predicted to take fewer multigrid cycles.

    The full Newton spends cycles on load steps until its basis of earlier solutions spans all
    states of the patches. The condensed one spends them on the compliance, before the first step.

    Args:
        setup: The problem set up from the scene, of a coupling with laws.
        table: The laws, once made; flat patches rule out the full Newton.
    """
    coupling = setup.scene.coupling
    if setup.samples:
        return NewtonChoice(False, "laws of samples hold at the points of the mesh")
    if setup.scene.decomposed:
        return NewtonChoice(True, "the decomposed block is its compliance")
    flat = 0 if table is None else sum(law.is_flat for law in table.laws)
    if flat and coupling.newton == "auto" and coupling.interface == "patchwise":
        why = (
            f"{flat} of {setup.patches.count} patches are flat, and their pressure is a function "
            "of closure nowhere"
        )
        return NewtonChoice(True, why)
    if coupling.interface == "pointwise":
        return NewtonChoice(False, "laws at points need the whole mesh")
    if setup.both_give_way and coupling.newton == "auto":
        return NewtonChoice(True, "the counter-body, a half-space, is in the compliance of patches")
    if coupling.newton != "auto":
        return NewtonChoice(coupling.newton == "condensed", "as the scene asks")
    patches, steps = setup.patches.count, setup.load_history.count
    compliance, full = CYCLES_PER_PATCH * patches, full_cycles(setup, steps)
    fewer = "fewer" if compliance < full else "more"
    unless = "" if compliance < full or table or setup.uses_summits else _UNLESS_FLAT
    return NewtonChoice(
        compliance < full,
        f"the compliance of {patches} patches takes about {compliance} multigrid cycles, "
        f"{fewer} than {steps} load steps on the mesh with about {full}{unless}",
    )


def check_has_laws(scene: Scene) -> None:
    """Refuse a coupling without laws; which one ``auto`` becomes is not known beforehand.

    Args:
        scene: The scene.

    Raises:
        InputError: When the coupling has no laws.
    """
    kind = scene.kind
    if kind not in ("isolated", "consistent", "representative", "auto"):
        raise InputError(
            "has no laws",
            key="coupling.kind",
            value=kind,
            allowed="isolated, consistent",
            file=scene.file,
        )


def make_table(
    setup: ProblemSetup, model: MicroModel | None, comm: Any, observe: Observer | None = None
) -> LawTable:
    """Tabulate the laws of all patches, each alone or all from the whole surface on its block.

    Args:
        setup: The problem set up from the scene.
        model: Its micro model on the body, see `contact_model`; None for laws of samples, which
            have their own.
        comm: MPI communicator; None for this process alone.
        observe: Called as rows or laws are made.

    Raises:
        InputError: When the coupling has no laws.
        NotConverged: When the micro model does not converge.

    Note:
        Collective.
    """
    check_has_laws(setup.scene)
    kind = setup.scene.kind
    if model is None:
        return face_laws(setup, comm, observe)
    common: dict[str, Any] = {
        "mean_heights": setup.mean_heights,
        "tolerance": setup.table_tolerance,
        "most_rows": setup.table_rows,
        "comm": comm,
        "observe": observe,
    }
    if kind == "isolated":
        ends, love = setup.largest_closures, setup.scene.coupling.love
        return isolated_laws(model, setup.patches, closure_ends=ends, love=love, **common)
    load_history, displacements = setup.load_history, None
    if has_body_term(setup):  # otherwise rows are those of a half-space, and so are closures
        dense = newton_choice(setup).condensed
        displacements = patch_displacements(setup, comm, dense=dense)
    return consistent_laws(
        model,
        setup.patches,
        largest=load_history.control(load_history.largest),
        displacements=displacements,
        pointwise=setup.scene.coupling.interface == "pointwise",
        **common,
    )


def assemble(setup: ProblemSetup, made: LawTable | MicroModel | None, comm: Any) -> Coupling:
    """Put micro and macro model together as the scene asks.

    Args:
        setup: The problem set up from the scene.
        made: The patch laws, of couplings that use them, or else the micro model on the body; None
            for a reference.
        comm: MPI communicator; None for this process alone.

    Note:
        Collective.
    """
    if made is None:
        return make_reference(setup, comm)
    if not isinstance(made, LawTable):
        return ContactCoupling(made, setup.patches, setup.mean_heights, comm)
    if setup.samples:
        return FaceCoupling(setup, made, comm)
    condensed = newton_choice(setup, made).condensed
    mode, tilt = setup.scene.coupling.interface, setup.load_history.slopes
    if made.path is not None and mode == "patchwise" and tilt is None:
        return FreePlaneCoupling(made, patch_displacements(setup, comm, dense=condensed))
    if condensed:
        return CondensedCoupling(made, patch_compliance(setup, comm))
    from macro import LawContactProblem

    face = embedding(setup, comm)
    problem = LawContactProblem(face, made.laws, mode=mode)
    return EmbeddedCoupling(problem, made, face)


def meshed_blocks(coupling: Coupling | None) -> list[ElasticBody]:
    """Return the meshed bodies that a coupling solves its load steps on, the finest last.

    Args:
        coupling: The coupling; None before it is made.
    """
    if isinstance(coupling, ReferenceCoupling | EmbeddedCoupling):
        return [*coupling.blocks]
    return []


def unknowns(coupling: Coupling | None) -> int | None:
    """Return the degrees of freedom of the mesh that load steps are solved on, if there is one.

    Args:
        coupling: The coupling; None before it is made.
    """
    if isinstance(coupling, EmbeddedCoupling):
        return coupling.face.body.dofs
    meshed = meshed_blocks(coupling)
    return meshed[-1].dofs if meshed else None


def free_blocks(blocks: list[ElasticBody]) -> None:
    """Free blocks that nothing else refers to any more.

    PETSc keeps objects that Python drops until it is asked on their own communicator. Without this
    a program that makes many runs would grow by a block with each.

    Args:
        blocks: The blocks; the list is emptied.

    Note:
        Collective.
    """
    if not blocks:
        return
    from macro.compat import collect_garbage

    comms = [block.stiffness.comm.duplicate() for block in blocks]  # these outlive their blocks
    blocks.clear()
    gc.collect()  # a block and its contact problem refer to each other
    for comm in comms:
        collect_garbage(comm)
        comm.destroy()


def load_finite_elements(scene: Scene, comm: Any) -> None:
    """Import the finite elements on all ranks where a scene may need them.

    PETSc starts with collective calls on all processes of the job, so that one rank alone must not
    import it.

    Args:
        scene: The scene.
        comm: MPI communicator; None for this process alone, which imports them when it needs them.

    Note:
        Collective.
    """
    meshed = scene.body is not None or (scene.counter_body and scene.counter_body.mesh)
    if comm is not None and (scene.kind != "analytic" or meshed):
        import macro  # noqa: F401


def approximation_notes(
    setup: ProblemSetup, table: LawTable | None, steps: Sequence[LoadStep]
) -> Iterator[str]:
    """Yield what a report says of the approximations behind load steps.

    Args:
        setup: The problem set up from a scene.
        table: The laws, where the steps use laws.
        steps: The load steps.
    """
    if table is not None:
        yield from table.notes(setup.table_tolerance)
        planned, taken = newton_choice(setup), newton_choice(setup, table)
        if taken.condensed != planned.condensed:
            yield Detail(f"Newton condensed to the patches, not full: {taken.why}")
    imbalances = [abs(step.imbalance) for step in steps if step.imbalance is not None]
    if imbalances:
        equal = percent(max(imbalances))
        yield Detail(f"force against the support's reaction: equal to {equal}")
    yield from range_notes(steps, table)


def with_mesh_errors(
    coupling: Coupling | None, steps: Sequence[LoadStep]
) -> tuple[tuple[LoadStep, ...], ReferenceRecord | None, list[str]]:
    """Return load steps with the errors of a reference's meshes, its record, and notes on it.

    Args:
        coupling: The coupling; others than a reference leave the steps as they are.
        steps: The load steps.
    """
    if not isinstance(coupling, ReferenceCoupling):
        return tuple(steps), None, []
    record = coupling.record(steps)
    return record.with_errors(steps), record, list(coupling.notes(record, steps))
