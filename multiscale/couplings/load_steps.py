"""Couplings that solve every load step in full: the contact problem, laws on finite elements."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from geometry.collective import on_root
from geometry.errors import InputError, NotConverged
from geometry.patches import PatchGrid
from geometry.rigid_plane import Control
from micro import START_KINDS, MicroModel, Response, RigidPlane
from multiscale.laws.files import LawTable
from multiscale.loading.load_step import LoadStep, PatchState
from multiscale.loading.stepper import BeyondLaws
from multiscale.storage.serialisation import Arrays, packed, unpacked

if TYPE_CHECKING:  # finite elements are imported only by scenes that need them
    from macro import LawContactProblem, LawContactState

Array = NDArray[np.float64]


class ContactCoupling:
    """The contact problem itself at every load step: no laws.

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
        kept: list[Any] = [None]

        def solved() -> tuple[Response, RigidPlane]:
            response, plane, kept[0] = self._model.press(
                control, patches=self._patches, mean_heights=self._mean_heights, start=self._start
            )
            return response, plane

        response, plane = on_root(self._comm, solved)
        self._start = kept[0]
        return response_step(response, self._patches, plane=plane)

    def state(self) -> Arrays:
        """Return the latest solution; see `Restorable`. It is whole on rank 0 alone."""
        return packed(self._start)

    def restore(self, state: Arrays) -> None:
        """Go on from a solution; see `Restorable`."""
        self._start = unpacked(state, START_KINDS)


class EmbeddedCoupling:
    """Patch laws on the flat interface of an elastic block (Waddad et al. 2016, section 3.2).

    Args:
        pressed: The block with the laws on its interface.
        table: The laws, which also give contact area, contacts and separation.
    """

    def __init__(self, pressed: LawContactProblem, table: LawTable) -> None:
        self._pressed, self._table = pressed, table
        self._last: LawContactState | None = None

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
            state = self._pressed.solve(control)
        except NotConverged as error:
            if not any(law.is_punch for law in self._table.laws):
                raise
            problem = "a flat patch, whose pressure is a function of closure nowhere"
            made_for = self._table.made_by.get("coupling")
            raise beyond_law(control, problem, made_for) from error
        step = self._step(control, state)
        self._last = state
        return step

    def state(self) -> Arrays:
        """Return the latest plane and pressures, of which the displacements follow."""
        last = self._last
        return {} if last is None else packed((last.approach, last.tilt, last.pressure))

    def restore(self, state: Arrays) -> None:
        """Find the equilibrium under a plane again, from the pressures; see `Restorable`.

        It agrees with the earlier one to the tolerance of the Newton iteration.
        """
        if state:
            approach, tilt, pressure = unpacked(state, ())
            self._pressed.start_from(pressure)
            self._last = self._pressed.solve(Control(approach=approach, tilt=tilt))

    def _step(self, control: Control, press: LawContactState) -> LoadStep:
        """Read area, contacts and separation off the laws at the converged closures."""
        laws = self._table.laws
        try:
            area = self._pressed.patch_means([law.area_fraction_at for law in laws])
            gaps = self._pressed.patch_means([law.separation_at for law in laws])
        except InputError as error:
            made_for = self._table.made_by.get("coupling")
            falls = not all(law.is_function for law in laws)
            raise beyond_law(control, str(error), made_for, falls=falls) from error
        mean_closures = zip(laws, press.closure, strict=True)
        contacts = sum(int(law.contacts_at(c, extend=True)) for law, c in mean_closures)
        return embedded_step(
            self._table.patches,
            approach=press.approach,
            tilt=press.tilt,
            moment=press.moment,
            force=press.force,
            mean_separation_mm=float(np.mean(gaps)),
            contacts=contacts,
            newton_iterations=press.newton_iterations,
            linear_iterations=press.linear_iterations,
            reason=press.reason,
            patches=PatchState(
                closure_mm=press.closure, pressure_MPa=press.pressure, contact_area_fraction=area
            ),
            imbalance=(press.force - press.reaction) / press.force if press.force else 0.0,
            residuals=tuple(map(float, press.residuals)),
        )


def response_step(response: Response, patches: PatchGrid, *, plane: RigidPlane) -> LoadStep:
    """Return the load step that a micro model's response to one plane is.

    Args:
        response: The response, of one row.
        patches: The partition it is summed over.
        plane: The plane.
    """
    return LoadStep(
        step=0,
        approach_mm=plane.approach,
        force_N=float(response.force[0]),
        mean_pressure_MPa=float(response.mean_pressure[0]),
        contact_area_fraction=float(response.contact_area_fraction[0]),
        mean_separation_mm=float(response.mean_separation[0]),
        contacts=int(response.contacts[0]),
        newton_iterations=int(response.iterations[0]),
        linear_iterations=0,
        wall_s=0.0,
        reason="CONVERGED",
        patches=PatchState(
            closure_mm=plane.means(patches) - response.patch_displacement[0],
            pressure_MPa=response.patch_force[0] / patches.area,
            contact_area_fraction=response.patch_contact_area[0] / patches.area,
        ),
        residuals=(float(response.residual[0]),),
        tilt=plane.tilt,
        moment_N_mm=(float(response.moment[0, 0]), float(response.moment[0, 1])),
        warnings=response.warnings,
    )


def embedded_step(
    grid: PatchGrid,
    *,
    approach: float,
    tilt: Sequence[float] | Array,
    moment: Sequence[float] | Array,
    force: float,
    patches: PatchState,
    **rest: Any,
) -> LoadStep:
    """Return the load step of laws on patches; the rest are fields of a `LoadStep`.

    Args:
        grid: The partition.
        approach: Approach at the middle of the interface [mm].
        tilt: Slopes of the approach.
        moment: First moments of the forces about the middle [N mm].
        force: Force on the plane [N].
        patches: The state of every patch.
        **rest: The other fields.
    """
    return LoadStep(
        step=0,
        approach_mm=float(approach),
        force_N=float(force),
        mean_pressure_MPa=float(force) / (grid.area * grid.count),
        contact_area_fraction=float(np.mean(patches.contact_area_fraction)),
        wall_s=0.0,
        patches=patches,
        tilt=(float(tilt[0]), float(tilt[1])),
        moment_N_mm=(float(moment[0]), float(moment[1])),
        **rest,
    )


def beyond_law(
    control: Control, problem: str, coupling: str | None, *, falls: bool = False
) -> BeyondLaws:
    """Return the error of a patch that left its law's range.

    Args:
        control: The load step.
        problem: Which patch, and how far its law goes.
        coupling: The coupling that the laws were made for.
        falls: Whether closure falls somewhere in a law, and the mesh cannot follow.
    """
    alone = (
        "near full contact a patch taken alone has no pressure as a function of closure: take "
        "coupling.newton = 'condensed', which goes on, coupling.kind = 'consistent' or "
        "'concurrent', larger patches (patches.grid) or a smaller load"
    )
    whole = (
        "the block lets the plane come or turn further than the half-space that the laws were "
        "made for: take coupling.kind = 'concurrent', which needs none"
    )
    if falls:
        whole = (
            "where the closure of a law falls the mesh cannot follow: take coupling.newton = "
            "'condensed', which goes on, or coupling.kind = 'concurrent', which needs no law"
        )
    return BeyondLaws(
        f"the patches at {control}",
        reason=f"LAW_RANGE: {problem}",
        iterations=0,
        remedy=whole if coupling == "consistent" else alone,
    )
