"""The reference among the couplings: the rough surface itself is meshed and pressed.

Theory: docs/theory.md, section 12.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from geometry import Control
from micro.contact_detail import ContactDetail, peaks_of
from multiscale.loading.load_step import LoadStep
from multiscale.results.reference_record import ReferenceRecord, reference_record
from multiscale.setup.problem import ProblemSetup
from multiscale.setup.surface_and_block import block_material, block_section, located
from multiscale.storage import packed, unpacked
from support.checked_store import Arrays

if TYPE_CHECKING:  # finite elements are imported only by scenes that need them
    from macro import ContactState, ElasticBody, MeshQuality, UnilateralContactProblem

Array = NDArray[np.float64]

_NO_AREA = 1e-9
"""Area of a node, relative to the largest, that counts as none."""


class ReferenceCoupling:
    """The rough surface of a block, meshed ever finer and pressed alike at every load step.

    All meshes see the same loads, halved steps included, and every accepted step has its error bar.

    Args:
        setup: The problem set up from a scene, of a reference. Its patches are what results are
            summed over; they do not change the solution.
        problems: The contact problems of the meshes, the finest last, with the patches on its top.
        qualities: How far the roughness has deformed the cells of every mesh.

    Attributes:
        qualities: The same.
    """

    def __init__(
        self,
        setup: ProblemSetup,
        problems: Sequence[UnilateralContactProblem],
        qualities: Sequence[MeshQuality],
    ) -> None:
        assert setup.meshes is not None
        self._surface, self._patches, self._meshes = setup.surface, setup.patches, setup.meshes
        self._problems, self.qualities = tuple(problems), tuple(qualities)
        self._last: tuple[ContactState, ...] = ()

    @property
    def finest(self) -> UnilateralContactProblem:
        """The contact problem that the load steps are those of."""
        return self._problems[-1]

    @property
    def blocks(self) -> list[ElasticBody]:
        """The rough blocks, the finest last."""
        return [problem.body for problem in self._problems]

    @property
    def latest(self) -> ContactState:
        """The finest block at the latest load step.

        Raises:
            ValueError: Before the first load step.
        """
        if not self._last:
            raise ValueError("no load step has been accepted yet")
        return self._last[-1]

    def press(self, control: Control) -> LoadStep:
        """Solve one load step on every mesh; see `Coupling.press`."""
        self._last = states = tuple(problem.solve(control) for problem in self._problems)
        finest, nominal = states[-1], self._patches.area * self._patches.count
        # patches count whole nodes; all together they have the area with its border in the facets
        share = (finest.contact_area or 0.0) / finest.nodal_area if finest.nodal_area else 0.0
        return LoadStep.of_patches(
            self._patches,
            plane=(finest.approach, *finest.tilt),
            load=(finest.force, *finest.moment),
            closure=finest.patch_closure,
            pressure=finest.patch_pressure,
            area_fraction=share * finest.patch_area / self._patches.area,
            separation=finest.mean_separation,
            contacts=finest.contacts,
            newton_iterations=sum(state.iterations for state in states),
            linear_iterations=sum(state.linear_iterations for state in states),
            reason=finest.reason,
            imbalance=(finest.force - finest.reaction) / finest.force if finest.force else 0.0,
            peak_pressure_MPa=finest.peak_pressure,
            meshes=tuple(
                (state.approach, state.force, (state.contact_area or 0.0) / nominal)
                for state in states
            ),
        )

    def detail(self, latest: ContactState) -> ContactDetail:
        """Return the contact of a load step in detail; see `HasContact`.

        The area of a spot is that of its nodes times the area with its border in the facets over
        that of all nodes, so that the areas of all spots add up to the load step's.
        """
        from macro import nodal_contact

        nodes = nodal_contact(self.finest, latest)
        touching = np.flatnonzero(nodes.region >= 0)
        region, count = nodes.region[touching], latest.contacts
        share = (latest.contact_area or 0.0) / latest.nodal_area if latest.nodal_area else 0.0
        top = touching[peaks_of(region, nodes.pressure[touching], count)]
        some = nodes.area > _NO_AREA * nodes.area.max()
        return ContactDetail(
            place=np.stack([nodes.x[top], nodes.y[top]], axis=1),
            area=share * np.bincount(region, nodes.area[touching], minlength=count),
            force=np.bincount(region, nodes.force[touching], minlength=count).astype(np.float64),
            peak_pressure=nodes.pressure[top],
            x=nodes.x[some],
            y=nodes.y[some],
            pressure=nodes.pressure[some],
            gap=nodes.gap[some],
        )

    def state(self) -> Arrays:
        """Return the plane on every mesh; see `Restorable`."""
        return packed(tuple((state.approach, *state.tilt) for state in self._last))

    def restore(self, state: Arrays) -> None:
        """Press every mesh by its plane again; see `Restorable`."""
        planes = unpacked(state, ()) if state else ()
        self._last = tuple(
            problem.solve(Control(approach=approach, tilt=(tx, ty)))
            for problem, (approach, tx, ty) in zip(self._problems, planes, strict=False)
        )

    def record(self, steps: Sequence[LoadStep]) -> ReferenceRecord:
        """Return the results of all meshes together, with their error bars.

        Where all meshes miss contacts that must exist, their agreement is no error bar.

        Args:
            steps: Load steps of this coupling.
        """
        meshes = self._meshes
        record = reference_record(
            steps,
            meshes.sizes,
            [block.dofs for block in self.blocks],
            force_order=meshes.force_order,
            area_order=meshes.area_order,
        )
        return record.without_bars(np.array([self._misses(step) for step in steps], dtype=bool))

    def notes(self, record: ReferenceRecord, steps: Sequence[LoadStep]) -> Iterator[str]:
        """Yield what a report says of the errors of the reference.

        Args:
            record: What `record` returned.
            steps: Load steps of this coupling.
        """
        yield record.sentence
        missed = [step.step for step in steps if self._misses(step)]
        if missed:
            yield (
                f"no node of the finest mesh touches in {len(missed)} of {len(steps)} load steps, "
                f"first in step {missed[0]}, though the plane lies below the surface's highest "
                "point: the mesh is too coarse for contact there, and the force zero; refine "
                f"{self._meshes.key}"
            )
        thinnest = min(quality.thinnest for quality in self.qualities)
        steepest = max(quality.steepest for quality in self.qualities)
        yield (
            f"the roughness leaves the cells at least {thinnest:.2g} of their volume; the steepest "
            f"edge of the top has a slope of {steepest:.2g}"
        )

    def _misses(self, step: LoadStep) -> bool:
        """Whether no node touches though the plane lies below the surface's highest point."""
        arm = np.subtract(self._surface.highest_point, np.multiply(0.5, self._surface.lengths))
        return not step.contacts and step.approach_mm + float(arm @ np.asarray(step.tilt)) > 0.0


def make_reference(setup: ProblemSetup, comm: Any) -> ReferenceCoupling:
    """Mesh the rough block of a scene, as often as it asks for.

    Args:
        setup: The problem set up from the scene, of a reference.
        comm: MPI communicator; None for this process alone.

    Raises:
        InputError: When the roughness is too steep for a mesh.

    Note:
        Collective.
    """
    from mpi4py import MPI

    from macro import Block, UnilateralContactProblem, rough_block_mesh

    assert setup.meshes is not None
    scene, surface, problems, qualities = setup.scene, setup.surface, [], []
    for shape in setup.meshes.shapes:
        finest = shape is setup.meshes.shapes[-1]
        with located(scene, "surface"):
            mesh, quality = rough_block_mesh(shape, surface, comm or MPI.COMM_SELF)
        problem = UnilateralContactProblem(
            Block(mesh, block_material(scene), sides=block_section(scene).sides),
            surface.highest - surface.mean_height,
            method=scene.reference.method,
            patches=setup.patches if finest else None,
        )
        problems.append(problem)
        qualities.append(quality)
    return ReferenceCoupling(setup, problems, qualities)
