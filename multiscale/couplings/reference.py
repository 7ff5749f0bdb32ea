"""The reference among the couplings: the rough surface itself meshed, and pressed as it is."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from geometry.errors import InputError
from geometry.patches import PatchGrid
from geometry.rigid_plane import Control
from multiscale.couplings.blocks import block_material
from multiscale.couplings.load_steps import embedded_step
from multiscale.loading.load_step import LoadStep, PatchState
from multiscale.results.reference_record import ReferenceRecord, reference_record
from multiscale.setup.problem import ProblemSetup
from multiscale.storage.serialisation import Arrays, packed, unpacked

if TYPE_CHECKING:  # finite elements are imported only by scenes that need them
    from macro import Block, MeshQuality, UnilateralContactProblem, UnilateralContactState

Array = NDArray[np.float64]


class ReferenceCoupling:
    """Rough blocks of falling mesh size, pressed alike at every load step.

    Meshes see the same loads this way, halved steps included, and every accepted step has its
    error bar.

    Args:
        blocks: The rough blocks, the finest last, with the patches on its top.
        patches: Partition that the results are summed over; it does not change the solution.
        qualities: How far the roughness has deformed the cells of every block.

    Attributes:
        qualities: The same.

    Raises:
        ValueError: When there is no block.
    """

    def __init__(
        self,
        blocks: Sequence[UnilateralContactProblem],
        patches: PatchGrid,
        qualities: Sequence[MeshQuality] = (),
    ) -> None:
        if not blocks:
            raise ValueError("a reference needs a mesh")
        self._blocks, self._patches = tuple(blocks), patches
        self.qualities = tuple(qualities)
        self._last: tuple[UnilateralContactState, ...] = ()

    @property
    def finest(self) -> UnilateralContactProblem:
        """The block that the load steps tell of."""
        return self._blocks[-1]

    @property
    def blocks(self) -> list[Block]:
        """The rough blocks, the finest last."""
        return [pressed.block for pressed in self._blocks]

    @property
    def unknowns(self) -> tuple[int, ...]:
        """Degrees of freedom of every block."""
        return tuple(block.dofs for block in self.blocks)

    @property
    def latest(self) -> UnilateralContactState:
        """The finest block at the latest load step.

        Raises:
            ValueError: Before the first load step.
        """
        if not self._last:
            raise ValueError("no load step has been accepted yet")
        return self._last[-1]

    def press(self, control: Control) -> LoadStep:
        """Solve one load step on every mesh; see `Coupling.press`."""
        self._last = tuple(block.solve(control) for block in self._blocks)
        return self._step(self._last)

    def state(self) -> Arrays:
        """Return the plane on every mesh; see `Restorable`."""
        return packed(tuple((state.approach, *state.tilt) for state in self._last))

    def restore(self, state: Arrays) -> None:
        """Press every mesh by its plane again; see `Restorable`."""
        planes = unpacked(state, ()) if state else ()
        self._last = tuple(
            block.solve(Control(approach=approach, tilt=(tx, ty)))
            for block, (approach, tx, ty) in zip(self._blocks, planes, strict=False)
        )

    def _step(self, states: Sequence[UnilateralContactState]) -> LoadStep:
        finest, nominal = states[-1], self._patches.area * self._patches.count
        # patches count whole nodes; all together they have the area with its border in the facets
        share = finest.contact_area_fine / finest.contact_area if finest.contact_area else 0.0
        return embedded_step(
            self._patches,
            approach=finest.approach,
            tilt=finest.tilt,
            moment=finest.moment,
            force=finest.force,
            mean_separation_mm=finest.mean_separation,
            contacts=finest.contacts,
            newton_iterations=sum(state.active_sets for state in states),
            linear_iterations=sum(state.linear_iterations for state in states),
            reason=finest.reason,
            patches=PatchState(
                closure_mm=finest.patch_closure,
                pressure_MPa=finest.patch_force / self._patches.area,
                contact_area_fraction=share * finest.patch_area / self._patches.area,
            ),
            imbalance=(finest.force - finest.reaction) / finest.force if finest.force else 0.0,
            meshes=tuple(
                (state.approach, state.force, state.contact_area_fine / nominal) for state in states
            ),
        )


def make_reference(setup: ProblemSetup, comm: Any) -> ReferenceCoupling:
    """Mesh the rough block of a scene, as often as it asks.

    Args:
        setup: The scene's ingredients, of a reference.
        comm: MPI communicator; None for this process alone.

    Raises:
        InputError: When the roughness is too steep for a mesh.

    Note:
        Collective.
    """
    from mpi4py import MPI

    from macro import Block, UnilateralContactProblem, rough_block_mesh

    assert setup.meshes is not None
    scene, surface, blocks, qualities = setup.scene, setup.surface, [], []
    for shape in setup.meshes.shapes:
        finest = shape is setup.meshes.shapes[-1]
        try:
            mesh, quality = rough_block_mesh(shape, surface, comm or MPI.COMM_SELF)
        except InputError as error:
            raise error.located(key="surface", file=scene.file) from None
        block = Block(mesh, block_material(setup), sides=scene.block.sides)
        pressed = UnilateralContactProblem(
            block,
            surface.highest - surface.mean_height,
            method=scene.reference.method,
            patches=setup.patches if finest else None,
        )
        blocks.append(pressed)
        qualities.append(quality)
    return ReferenceCoupling(blocks, setup.patches, qualities)


def recorded(
    setup: ProblemSetup, coupling: ReferenceCoupling, steps: Sequence[LoadStep]
) -> ReferenceRecord:
    """Return what the meshes of a reference say together.

    Where they all miss contacts that must be there, that they agree is no error bar.

    Args:
        setup: The scene's ingredients.
        coupling: What made the load steps.
        steps: The load steps accepted so far.
    """
    assert setup.meshes is not None
    record = reference_record(
        steps,
        setup.meshes.sizes,
        coupling.unknowns,
        force_order=setup.meshes.force_order,
        area_order=setup.meshes.area_order,
    )
    return record.without_bars(np.array([_misses(step, setup) for step in steps], dtype=bool))


def reference_notes(
    record: ReferenceRecord,
    coupling: ReferenceCoupling,
    steps: Sequence[LoadStep],
    setup: ProblemSetup,
) -> Iterator[str]:
    """Yield what a report says of a reference's own errors.

    Args:
        record: What its meshes say together.
        coupling: What made the load steps.
        steps: The load steps.
        setup: The scene's ingredients.
    """
    yield record.sentence
    missed = [step.step for step in steps if _misses(step, setup)]
    if missed:
        yield (
            f"no node of the finest mesh touches in {len(missed)} of {len(steps)} load steps, "
            f"first in step {missed[0]}, though the plane lies below the surface's highest point: "
            f"the mesh is too coarse for contact there, and the force zero; refine "
            f"{setup.meshes.key if setup.meshes else 'it'}"
        )
    if coupling.qualities:
        thinnest = min(quality.thinnest for quality in coupling.qualities)
        steepest = max(quality.steepest for quality in coupling.qualities)
        yield (
            f"the roughness leaves the cells at least {thinnest:.2g} of their volume; the steepest "
            f"edge of the top has a slope of {steepest:.2g}"
        )


def _misses(step: LoadStep, setup: ProblemSetup) -> bool:
    """Whether no node touches though the plane lies below the surface's highest point."""
    if step.contacts:
        return False
    arm = np.asarray(setup.surface.highest_point) - 0.5 * np.asarray(setup.surface.lengths)
    return step.approach_mm + float(arm @ np.asarray(step.tilt)) > 0.0
