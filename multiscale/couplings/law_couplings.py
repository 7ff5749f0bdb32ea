"""Couplings of patch laws with the mesh of a block, and with a plane that turns as in their rows.

Theory: docs/theory.md, section 11.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from geometry import Control, InputError, NotConverged, PatchGrid, RigidPlane
from micro.model import Stiffness
from multiscale.couplings.patch_compliance import Displacements
from multiscale.laws.interpolation import LawPoint
from multiscale.laws.law_table import LawTable
from multiscale.laws.patch_law import PatchLaws
from multiscale.loading.load_step import LoadStep
from multiscale.loading.stepper import BeyondLaws
from multiscale.storage import packed, unpacked
from support.checked_store import Arrays

if TYPE_CHECKING:  # finite elements are imported only by scenes that need them
    from macro import ContactState, FacePair, LawContactProblem, LoadedFace

Array = NDArray[np.float64]

ROUNDING = 1e-12
"""Share of a law's end by which a converged approach may exceed it."""

_OTHER_MODEL = 0.05
"""Residual of closures, relative to the largest local approach, that shows that the laws were made
for another macro model; between their rows it is hundredths of that."""


class EmbeddedCoupling:
    """Patch laws on the flat interface of an elastic block (Waddad et al. 2016, section 3.2).

    Args:
        problem: The body with the laws on its contact face.
        table: The laws, which also give contact area, contacts and separation.
        face: The patches on its contact face.

    Attributes:
        table: The laws.
        face: The patches on its contact face.
    """

    def __init__(
        self, problem: LawContactProblem, table: LawTable, face: LoadedFace | FacePair
    ) -> None:
        self._problem, self.table, self.face = problem, table, face
        self._last: ContactState | None = None

    @property
    def blocks(self) -> list[Any]:
        """The body, and the counter-body where that is a mesh."""
        body = self.face.body
        return [body.body, body.counter] if hasattr(body, "counter") else [body]

    @property
    def displacement(self) -> Array:
        """This rank's displacements at the latest load step; earlier ones are not kept [mm].

        Raises:
            ValueError: Before the first load step.
        """
        if self._last is None:
            raise ValueError("no load step has been accepted yet")
        return self._last.displacement

    @property
    def point_pressures(self) -> Array:
        """Pressures at this rank's quadrature points of the face at the latest load step [MPa]."""
        if self._last is None:
            raise ValueError("no load step has been accepted yet")
        pressure, face = self._last.sample_pressure, self.face
        if not hasattr(face, "on_both"):
            return pressure
        whole = np.zeros(len(face.on_both))
        whole[face.on_both] = pressure
        return whole

    def face_pressures(self) -> Array:
        """Return places on the face and the pressures there at the latest load step.

        Returns:
            Columns x, y [mm] and p [MPa] of the quadrature points of all ranks, shape (n, 3).

        Note:
            Collective.
        """
        first: Any = getattr(self.face, "first", self.face)
        first = first.quadrature
        own = np.column_stack([first.x, first.y, self.point_pressures])
        return np.concatenate(self.face.comm.allgather(own))

    def press(self, control: Control) -> LoadStep:
        """Solve one load step; see `Coupling.press`."""
        try:
            state = self._problem.solve(control)
        except NotConverged as error:
            if not any(law.is_flat for law in self.table.laws):
                raise
            problem = "a flat patch, whose pressure is a function of closure nowhere"
            raise beyond_law(control, problem, self.table) from error
        step = self._step(control, state)
        self._last = state
        return step

    def state(self) -> Arrays:
        """Return the latest plane and pressures, which determine the displacements."""
        last = self._last
        return {} if last is None else packed((last.approach, last.tilt, last.patch_pressure))

    def restore(self, state: Arrays) -> None:
        """Find the equilibrium under a plane again, from the pressures; see `Restorable`.

        It agrees with the earlier one to the tolerance of the Newton iteration.
        """
        if state:
            approach, tilt, pressure = unpacked(state, ())
            if isinstance(self.table.patches, PatchGrid) or len(self.blocks) == 1:
                self._problem.start_from(pressure)
            self._last = self._problem.solve(Control(approach=approach, tilt=tilt))

    def _step(self, control: Control, state: ContactState) -> LoadStep:
        """Return the load step, with area, contacts and separation of the laws."""
        laws = self.table.laws

        def means(name: str) -> Array:
            functions = [lambda closure, at=law.at: getattr(at(closure), name) for law in laws]
            return self._problem.patch_means(functions)

        try:
            area_fraction, separation = means("contact_area_fraction"), means("separation")
            stiffness = means("stiffness")
        except InputError as error:
            falls = not all(law.is_function for law in laws)
            raise beyond_law(control, str(error), self.table, falls=falls) from error
        return LoadStep.of_patches(
            self.table.patches,
            plane=(state.approach, *state.tilt),
            load=(state.force, *state.moment),
            closure=state.patch_closure,
            pressure=state.patch_pressure,
            area_fraction=area_fraction,
            separation=separation,
            stiffness=stiffness,
            **self._of_contacts(state),
            newton_iterations=state.iterations,
            linear_iterations=state.linear_iterations,
            reason=state.reason,
            imbalance=(state.force - state.reaction) / state.force if state.force else 0.0,
        )

    def _of_contacts(self, state: ContactState) -> dict[str, Any]:
        """Return the numbers of contacts in the patches, and what else regions have.

        Where laws are those of samples, contacts are counted on the area of the samples, and the
        pressure has a largest value on the face.
        """
        laws = self.table.laws
        if isinstance(self.table.patches, PatchGrid):
            mean_closures = zip(laws, state.patch_closure, strict=True)
            return {"contacts": [law.at(c, extend=True).contacts for law, c in mean_closures]}
        areas = self.face.areas
        density = [
            lambda closure, law=law: law.at(closure).contacts / law.sample_area for law in laws
        ]
        peaks = self._problem.patch_largest([law.pressure for law in laws])
        return {
            "contacts": round(float(self._problem.patch_means(density) @ areas)),
            "areas": areas,
            "peak_pressure_MPa": float(peaks.max()),
        }


class FreePlaneCoupling:
    """Consistent laws under a plane without moment.

    The moment of the contacts decides how such a plane turns. Mean pressures of few large patches
    do not tell that moment, and a single law knows nothing of it. Therefore the plane turns as it
    did in the rows of the laws, where the macro model that the laws were made for is in equilibrium
    with their pressures.

    Args:
        table: The laws, with the path of the plane.
        displacements: Mean displacements of the patches by their pressures in the macro model.
            Collective.

    Raises:
        ValueError: When the laws have no path.
    """

    def __init__(self, table: LawTable, displacements: Displacements) -> None:
        if table.path is None:
            raise ValueError("the laws were made under a plane of given tilt")
        self._table, self._path, self._laws = table, table.path, PatchLaws(table.laws)
        self._displacements = displacements
        self._approach: float | None = None

    def press(self, control: Control) -> LoadStep:
        """Find the equilibrium of one load step; see `Coupling.press`.

        Raises:
            NotConverged: Also when the laws were made for another macro model.
        """
        path, patches = self._path, self._table.grid
        approach, evaluations = control.approach, 0
        if approach is None:
            approach, evaluations = path.approach_under(control.force or 0.0, self._force)
        end = float(path.approach[-1])
        if approach > end + ROUNDING * abs(end):
            problem = f"the plane at an approach of {approach:.6g} mm (allowed: up to {end:.6g} mm)"
            raise beyond_law(control, problem, self._table)
        tx, ty, *moment = map(float, path.at(approach))
        point = self._along(approach)
        xc, yc = map(float, patches.middle)
        local = RigidPlane(approach=approach, tilt=(tx, ty), centre=(xc, yc)).means(patches)
        closure = local - self._displacements(point.pressure[None])[0]
        residual = np.abs(np.where(point.pressure > 0.0, closure - point.closure, 0.0)).max()
        residual /= float(np.abs(local).max()) or 1.0
        if residual > _OTHER_MODEL:
            raise NotConverged(
                f"the patches at {control}",
                reason="OTHER_BODY",
                iterations=0,
                remedy=f"their closures miss {residual:.1%} of the approach: make the laws for "
                "this block and mesh",
            )
        self._approach = approach
        return LoadStep.of_patches(
            patches,
            plane=(approach, tx, ty),
            load=(self._force(approach), *moment),
            closure=closure,
            pressure=point.pressure,
            area_fraction=point.contact_area_fraction,
            separation=point.separation,
            contacts=point.contacts,
            stiffness=point.stiffness,
            newton_iterations=evaluations,
        )

    def stiffness(self) -> Stiffness:
        """Return dF/dδ at the latest load step, from the laws alone; see `HasStiffness`."""
        if self._approach is None:
            return Stiffness(None, 0)
        rates = self._along(self._approach).dpressure
        return Stiffness(self._table.grid.area * float(rates.sum()), 0)

    def _force(self, approach: float) -> float:
        return self._table.grid.area * float(self._along(approach).pressure.sum())

    def _along(self, approach: float) -> LawPoint:
        return self._laws.along(np.full(self._table.grid.count, approach))


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
    if table.made_by.get("coupling") == "representative":
        remedy = (
            "somewhere on the face the pressure is larger than any that laws are made for, almost "
            "the hardness or the contact modulus: take a smaller load"
        )
    elif table.made_by.get("coupling") != "consistent":
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
