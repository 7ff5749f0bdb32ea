"""Patch laws on the contact face of finite elements.

Theory: docs/theory.md, section 11.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from geometry import Control, InputError, NotConverged, PatchGrid
from micro.model import Stiffness
from multiscale.law_solvers.law_range import beyond_law
from multiscale.laws.law_table import LawTable
from multiscale.loading.load_step import LoadStep

if TYPE_CHECKING:  # finite elements are imported only by scenes that need them
    from macro import FaceContactState, FacePair, LawContactProblem, LoadedFace

Array = NDArray[np.float64]


class EmbeddedLaws:
    """Patch laws on the flat interface of an elastic block (Waddad et al. 2016, section 3.2).

    Args:
        problem: The body with the laws on its contact face.
        table: The laws, which also give contact area, contacts and separation.
        face: The patches on its contact face.

    Attributes:
        table: The laws.
        face: The patches on its contact face.
    """

    past: Any = None

    def __init__(
        self, problem: LawContactProblem, table: LawTable, face: LoadedFace | FacePair
    ) -> None:
        self._problem, self.table, self.face = problem, table, face
        self._last: FaceContactState | None = None

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

    def field_state(self, step: LoadStep) -> Any:
        """Return what fields of the load step just accepted are made from: the displacements."""
        return self.displacement

    def press(self, control: Control) -> LoadStep:
        """Solve one load step; see `Solver.press`."""
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

    def stiffness(self) -> Stiffness:
        """Return nothing: the stiffness on the mesh is not solved for."""
        return Stiffness(None, 0)

    def state(self) -> Any:
        """Return the latest plane and pressures, which determine the displacements."""
        last = self._last
        return None if last is None else (last.approach, last.tilt, last.patch_pressure)

    def restore(self, state: Any) -> None:
        """Find the equilibrium under a plane again, from the pressures.

        It agrees with the earlier one to the tolerance of the Newton iteration.
        """
        if state is not None:
            approach, tilt, pressure = state
            self._problem.start_from(pressure)
            self._last = self._problem.solve(Control(approach=approach, tilt=tilt))

    def _step(self, control: Control, state: FaceContactState) -> LoadStep:
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

    def _of_contacts(self, state: FaceContactState) -> dict[str, Any]:
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
