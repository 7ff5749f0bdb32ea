"""Solves the contact problem of a micro model at every load step.

Theory: docs/theory.md, sections 3 and 7.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry import Control, InputError, PatchGrid, overlaps
from micro import HalfSpaceModel, HalfSpaceState, MicroModel
from micro.contact_detail import ContactDetail
from micro.model import SolvedContact, Stiffness
from multiscale.loading.load_step import LoadStep
from support.collective import on_root, on_root_alone

Array = NDArray[np.float64]


class ContactSolver:
    """Solves the contact problem itself at every load step, without laws; rank 0 solves for all.

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
        """Solve one load step; see `Solver.press`."""

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
        """Return dF/dδ at the latest load step."""
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

    @property
    def gaps(self) -> Array | None:
        """Gaps of all cells at the latest load step, 0 in contact; None without cells [mm].

        Shape (nx, ny), on rank 0 alone.
        """
        state = self.latest
        if not isinstance(state, HalfSpaceState):
            return None
        return np.where(state.in_contact, 0.0, np.maximum(state.gap, 0.0))

    def _solved_cells(self) -> HalfSpaceState:
        if not isinstance(self.latest, HalfSpaceState):
            raise InputError("contacts without cells have no conductance")
        return self.latest

    def detail(self, latest: Any) -> ContactDetail:
        """Return the spots and fields of a contact, the same on every rank.

        Args:
            latest: What `latest` was after a load step.

        Note:
            Collective.
        """
        return on_root_alone(self._comm, lambda: latest.detail)

    def state(self) -> Any:
        """Return the latest solution; it is whole on rank 0 alone."""
        return self._start

    def restore(self, state: Any) -> None:
        """Start from a solution."""
        self._start = state
