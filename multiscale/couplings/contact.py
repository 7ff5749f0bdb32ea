"""The contact problem on the body of a scene, and the coupling that solves it at every load step.

Theory: docs/theory.md, sections 3 and 7.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from geometry import Control, InputError, PatchGrid, overlaps
from micro import (
    START_KINDS,
    FiniteSlopes,
    HalfSpaceModel,
    HalfSpaceState,
    MicroModel,
    SlopesOfBodies,
)
from micro.contact_detail import ContactDetail
from micro.model import SolvedContact, Stiffness
from multiscale.couplings.body import has_body_term, scene_body
from multiscale.loading.load_step import LoadStep
from multiscale.setup.problem import ProblemSetup
from multiscale.storage import packed, unpacked
from support.checked_store import Arrays
from support.collective import on_root, on_root_alone

if TYPE_CHECKING:  # finite elements are imported only by scenes that need them
    from macro import FaceCompliance

Array = NDArray[np.float64]

OnBody = Callable[[HalfSpaceModel, int], HalfSpaceModel]
"""Puts a half-space model on a body; with finite slopes up to an order, 0 for none."""

SLOPES = 2
"""Order of finite slopes where they are taken into account."""

_RESIDUAL = 1e-10
"""Residual of half-space solutions. Their forces are then right to 1e-12, so that neither the unit
of length nor the number of ranks changes a result. It costs a tenth more than 1e-8."""


class ContactCoupling:
    """The contact problem itself at every load step, without laws.

    ``analytic`` is the micro model on a half-space, ``concurrent`` the same on the scene's block:
    they differ by a term of the compliance. Rank 0 solves for all.

    Args:
        model: Micro model of the whole surface, with the body that it is pressed on.
        patches: Partition that the results are summed over; it does not change the solution.
        mean_heights: Mean height of each patch, shape (N,) [mm].
        comm: MPI communicator (mpi4py) or None.

    Attributes:
        latest: The contact at the latest load step; on rank 0 alone.
    """

    def __init__(
        self, model: MicroModel, patches: PatchGrid, mean_heights: Array, comm: Any = None
    ) -> None:
        self._model, self._patches, self._mean_heights = model, patches, mean_heights
        self._comm = comm
        self._start: Any = None
        self._turns = False
        self.latest: SolvedContact | None = None

    def press(self, control: Control) -> LoadStep:
        """Solve one load step; see `Coupling.press`."""

        def solve() -> LoadStep:
            response, plane, self._start, self.latest = self._model.press(
                control, patches=self._patches, mean_heights=self._mean_heights, start=self._start
            )
            self._turns = control.tilt is None
            return LoadStep.of_patches(
                self._patches,
                plane=(plane.approach, *plane.tilt),
                load=(response.force[0], *response.moment[0]),
                closure=plane.means(self._patches) - response.patch_displacement[0],
                pressure=response.patch_force[0] / self._patches.area,
                area_fraction=response.patch_contact_area[0] / self._patches.area,
                separation=response.mean_separation,
                contacts=response.contacts,
                newton_iterations=int(response.iterations[0]),
                warnings=response.warnings,
                peak_pressure_MPa=self.latest.peak_pressure,
                **self._of_cells(),
            )

        return on_root_alone(self._comm, solve)

    def _of_cells(self) -> dict[str, Any]:
        """Return the energies at the latest load step, and what has yielded, where known."""
        state = self.latest
        if not isinstance(state, HalfSpaceState):
            return {}
        found = {
            "elastic_energy_mJ": state.elastic_energy,
            "plastic_work_mJ": state.plastic_work,
        }
        if state.plastic_depth is not None:
            found["yielding_area_fraction"] = float(np.mean(state.yielding))
            found["plastic_depth_mm"] = float(state.plastic_depth.max())
        return found

    @property
    def past(self) -> Any:
        """What the next load step starts from; under a hardness it depends on it."""
        return self._start, self.latest

    @past.setter
    def past(self, value: Any) -> None:
        self._start, self.latest = value

    def pressures_on(self, parts: PatchGrid) -> Array:
        """Return the mean pressures of parts of the contact face at the latest load step.

        Their forces add up to the force on the plane. A spot that is not made of cells counts for
        the part that holds its largest pressure.

        Args:
            parts: The N parts.

        Returns:
            Shape (N,) [MPa].

        Note:
            Collective.
        """

        def pressures() -> Array:
            assert self.latest is not None
            if isinstance(self._model, HalfSpaceModel):
                pressure, surface = self._start[0], self._model.surface
                borders = parts.borders_x, parts.borders_y
                x, y = map(overlaps, borders, surface.lengths, surface.grid)
                return np.asarray((x @ pressure @ y.T).ravel() / parts.area)
            spots = self.latest.detail
            owner = parts.index_of(*spots.place.T)
            return np.bincount(owner, spots.force, minlength=parts.count) / parts.area

        return on_root(self._comm, pressures)

    def stiffness(self) -> Stiffness:
        """Return dF/dδ at the latest load step; see `HasStiffness`."""
        return on_root_alone(
            self._comm, lambda: self._model.stiffness(self.latest, turns=self._turns)
        )

    def interface_stiffness(self) -> float:
        """Return dF/dδ of the contacts at the latest load step on half-spaces alone [N/mm].

        Raises:
            InputError: When the micro model has no cells.

        Note:
            Collective.
        """
        return on_root_alone(self._comm, lambda: self._solved_cells().interface_stiffness())

    def over_gaps(self, function: Callable[[Array], float]) -> float:
        """Return a function of the gaps at the latest load step, on every rank.

        Args:
            function: Of the gaps of all cells, 0 in contact, shape (nx, ny) [mm].

        Raises:
            InputError: When the micro model has no cells.

        Note:
            Collective.
        """

        def found() -> float:
            state = self._solved_cells()
            return function(np.where(state.in_contact, 0.0, np.maximum(state.gap, 0.0)))

        return on_root_alone(self._comm, found)

    def _solved_cells(self) -> HalfSpaceState:
        if not isinstance(self.latest, HalfSpaceState):
            raise InputError("contacts without cells have no conductance")
        return self.latest

    def detail(self, latest: Any) -> ContactDetail:
        """Return the contact of a load step in detail; see `HasContact`."""
        return on_root_alone(self._comm, lambda: latest.detail)

    def state(self) -> Arrays:
        """Return the latest solution; see `Restorable`. It is whole on rank 0 alone."""
        return packed(self._start)

    def restore(self, state: Arrays) -> None:
        """Start from a solution; see `Restorable`."""
        self._start = unpacked(state, START_KINDS)


def contact_model(setup: ProblemSetup, comm: Any, put_on_body: OnBody | None = None) -> MicroModel:
    """Return a scene's micro model on the body that it is pressed on, finite slopes included.

    Args:
        setup: The problem set up from the scene.
        comm: MPI communicator; None for this process alone.
        put_on_body: What puts a half-space model on the scene's body, where that was solved for
            already, see `on_body`.

    Note:
        Collective.
    """
    model = setup.model
    isolated = setup.scene.kind == "isolated"
    if isinstance(model, HalfSpaceModel):
        put_on_body = put_on_body or on_body(setup, comm, half_space=isolated)
        return put_on_body(model, SLOPES if setup.finite_slopes else 0)
    if isolated or not has_body_term(setup):
        return model
    body = scene_body(setup)
    return replace(model, body=body.term(body.face(comm)))  # type: ignore[type-var]


def on_body(
    setup: ProblemSetup,
    comm: Any,
    *,
    half_space: bool = False,
    face: FaceCompliance | None = None,
) -> OnBody:
    """Return what puts half-space models on a scene's body, which is solved for once.

    Args:
        setup: The problem set up from the scene, with a half-space model.
        comm: MPI communicator; None for this process alone.
        half_space: Whether the body is a half-space even where the scene has a block.
        face: Compliance of the body's top, where that was solved for; then it is not collective.

    Returns:
        A function from a model and the order of finite slopes, 0 for none, to the model on the
        body. It is not collective.

    Note:
        Collective.
    """
    body = None if half_space or not has_body_term(setup) else scene_body(setup)
    if body is not None and face is None:
        face = body.face(comm)
    material, counter = setup.materials.first, setup.counter_surface

    def put(model: HalfSpaceModel, order: int) -> HalfSpaceModel:
        model, above = replace(model, tolerance=_RESIDUAL), None
        surface = model.surface
        if counter is not None:  # each body has slopes of its own
            above = counter.on_grid(surface.grid)
            surface = replace(surface, heights=surface.heights - above.heights)
        # With finite slopes heights count from the highest point, near the loads, where slopes add
        # least. The flat body then ends at it, while the block's height is that of the mean plane.
        higher = surface.highest - surface.mean_height if order else 0.0
        if body is not None and face is not None:
            model = replace(model, body=body.term(face, higher=higher))
            if body.side_term is not None:
                share = body.side_share(model.contact_modulus)
                model = replace(model, sides=replace(body.side_term, share=share))
        if not order:
            return model
        stresses = [] if body is None or face is None else body.stresses(face, surface)
        plane = surface.highest if stresses else None
        slopes = FiniteSlopes(
            surface,
            material,
            order=order,
            periodic=model.periodic,
            plane=plane,
            edge_stresses=stresses,
        )
        second = setup.materials.second
        if above is None or second is None:
            return replace(model, slopes=slopes)
        others = FiniteSlopes(above, second, order=order, periodic=model.periodic)
        return replace(model, slopes=SlopesOfBodies((slopes, others)))

    return put
