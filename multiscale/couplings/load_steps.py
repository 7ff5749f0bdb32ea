"""Couplings that solve the contact problem itself, or laws on the mesh of a block."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from geometry.collective import on_root
from geometry.errors import InputError, NotConverged
from geometry.patches import PatchGrid
from geometry.rigid_plane import Control
from micro import START_KINDS, MicroModel
from multiscale.laws.law_table import LawTable
from multiscale.loading.load_step import LoadStep
from multiscale.loading.stepper import BeyondLaws
from multiscale.storage import Arrays, packed, unpacked

if TYPE_CHECKING:  # finite elements are imported only by scenes that need them
    from macro import Block, Interface, LawContactProblem, LawContactState

Array = NDArray[np.float64]


class ContactCoupling:
    """The contact problem itself at every load step, without laws.

    ``analytic`` is the micro model on a half-space, ``concurrent`` the same on the scene's block:
    they differ by a term of the compliance. Rank 0 solves for all.

    Args:
        model: Micro model of the whole surface, with the body that it is pressed on.
        patches: Partition that the results are summed over; it does not change the solution.
        mean_heights: Mean height of each patch, shape (N,) [mm].
        comm: MPI communicator (mpi4py) or None.
    """

    def __init__(
        self, model: MicroModel, patches: PatchGrid, mean_heights: Array, comm: Any = None
    ) -> None:
        self._model, self._patches, self._mean_heights = model, patches, mean_heights
        self._comm = comm
        self._start: Any = None

    def press(self, control: Control) -> LoadStep:
        """Solve one load step; see `Coupling.press`."""

        def solve() -> LoadStep:
            response, plane, self._start = self._model.press(
                control, patches=self._patches, mean_heights=self._mean_heights, start=self._start
            )
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
                residuals=(float(response.residual[0]),),
                warnings=response.warnings,
            )

        return on_root(self._comm, solve)

    def state(self) -> Arrays:
        """Return the latest solution; see `Restorable`. It is whole on rank 0 alone."""
        return packed(self._start)

    def restore(self, state: Arrays) -> None:
        """Start from a solution; see `Restorable`."""
        self._start = unpacked(state, START_KINDS)


class EmbeddedCoupling:
    """Patch laws on the flat interface of an elastic block (Waddad et al. 2016, section 3.2).

    Args:
        problem: The block with the laws on its interface.
        table: The laws, which also give contact area, contacts and separation.
        interface: The interface of the block.
    """

    def __init__(self, problem: LawContactProblem, table: LawTable, interface: Interface) -> None:
        self._problem, self._table, self.interface = problem, table, interface
        self._last: LawContactState | None = None

    @property
    def blocks(self) -> list[Block]:
        """The block, as a list of one."""
        return [self.interface.block]

    @property
    def displacement(self) -> Array:
        """This rank's displacements at the latest load step; earlier ones are not kept [mm].

        Raises:
            ValueError: Before the first load step.
        """
        if self._last is None:
            raise ValueError("no load step has been accepted yet")
        return self._last.displacement

    def press(self, control: Control) -> LoadStep:
        """Solve one load step; see `Coupling.press`."""
        try:
            state = self._problem.solve(control)
        except NotConverged as error:
            if not any(law.is_flat for law in self._table.laws):
                raise
            problem = "a flat patch, whose pressure is a function of closure nowhere"
            raise beyond_law(control, problem, self._table) from error
        step = self._step(control, state)
        self._last = state
        return step

    def state(self) -> Arrays:
        """Return the latest plane and pressures, which determine the displacements."""
        last = self._last
        return {} if last is None else packed((last.approach, last.tilt, last.pressure))

    def restore(self, state: Arrays) -> None:
        """Find the equilibrium under a plane again, from the pressures; see `Restorable`.

        It agrees with the earlier one to the tolerance of the Newton iteration.
        """
        if state:
            approach, tilt, pressure = unpacked(state, ())
            self._problem.start_from(pressure)
            self._last = self._problem.solve(Control(approach=approach, tilt=tilt))

    def _step(self, control: Control, state: LawContactState) -> LoadStep:
        """Return the load step, with area, contacts and separation of the laws."""
        laws = self._table.laws

        def means(name: str) -> Array:
            functions = [lambda closure, at=law.at: getattr(at(closure), name) for law in laws]
            return self._problem.patch_means(functions)

        try:
            area_fraction, separation = means("contact_area_fraction"), means("separation")
        except InputError as error:
            falls = not all(law.is_function for law in laws)
            raise beyond_law(control, str(error), self._table, falls=falls) from error
        mean_closures = zip(laws, state.closure, strict=True)
        contacts = [law.at(closure, extend=True).contacts for law, closure in mean_closures]
        return LoadStep.of_patches(
            self._table.patches,
            plane=(state.approach, *state.tilt),
            load=(state.force, *state.moment),
            closure=state.closure,
            pressure=state.pressure,
            area_fraction=area_fraction,
            separation=separation,
            contacts=contacts,
            newton_iterations=state.newton_iterations,
            linear_iterations=state.linear_iterations,
            reason=state.reason,
            imbalance=(state.force - state.reaction) / state.force if state.force else 0.0,
            residuals=tuple(map(float, state.residuals)),
        )


def beyond_law(
    control: Control, problem: str, table: LawTable, *, falls: bool = False
) -> BeyondLaws:
    """Return the error of a patch outside the range of its law.

    Args:
        control: The load step.
        problem: Which patch, and the range of its law.
        table: The laws.
        falls: Whether closure falls somewhere in a law, where the mesh cannot follow.
    """
    if table.made_by.get("coupling") != "consistent":
        remedy = (
            "near full contact a patch taken alone has no pressure as a function of closure: take "
            "coupling.newton = 'condensed', which goes on, coupling.kind = 'consistent' or "
            "'concurrent', larger patches (patches.grid) or a smaller load"
        )
    elif falls:
        remedy = (
            "where the closure of a law falls the mesh cannot follow: take coupling.newton = "
            "'condensed', which goes on, or coupling.kind = 'concurrent', which needs no law"
        )
    else:
        remedy = (
            "the block lets the plane come or turn further than the half-space that the laws were "
            "made for: take coupling.kind = 'concurrent', which needs none"
        )
    return BeyondLaws(
        f"the patches at {control}", reason=f"LAW_RANGE: {problem}", iterations=0, remedy=remedy
    )
