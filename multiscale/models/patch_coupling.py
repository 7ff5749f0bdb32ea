"""The couplings with a law for every patch: consistent and isolated laws.

Theory: docs/theory.md, sections 10 and 11.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from patchlaw.geometry import Control, Friction
from patchlaw.geometry.contact_state import ContactState
from patchlaw.micro import HalfSpaceModel, MicroModel
from patchlaw.multiscale.bodies.bodies import on_body
from patchlaw.multiscale.laws.law_table import LawTable
from patchlaw.multiscale.laws.of_patches import consistent_laws, isolated_laws
from patchlaw.multiscale.laws.refinement import MOST_ROWS
from patchlaw.multiscale.loading.load_step import LoadStep
from patchlaw.multiscale.models.cell_coupling import CellCoupling
from patchlaw.multiscale.models.face_contact import FaceContact
from patchlaw.multiscale.models.patch_contact import FreePlaneContact, PatchContact
from patchlaw.multiscale.models.problem import Model, plane_at_largest_load
from patchlaw.multiscale.readable import ProgressObserver, times
from patchlaw.support.parallel import on_root_alone

_TURNED_OVER = 1.0
"""Part of the approach, times μ, that laws are made further under friction. On a cube with 3 × 3
patches that slides as a whole closures needed 0.4 at μ = 0.5."""
_RESERVE = 0.02
"""Way that rows of transmissivities go beyond the largest load, relative to the way to it."""


class PatchCoupling(CellCoupling):
    """A law for every patch, all from one solution of the whole surface, or from each patch alone.

    Laws of patches alone are those of Waddad et al. 2016.
    """

    @property
    def table_rows(self) -> int:
        """Most rows of a table of laws."""
        return MOST_ROWS if self.parts.summits is None else 400  # on cells a row costs a solution

    @property
    def condensed(self) -> bool:
        """Whether load steps know the bodies by the compliance of their patches alone.

        They do unless something else than mean pressures of patches deforms the bodies, or more
        patches than laws have rows would have to be solved for, one by one.
        """
        few = self.scene.decomposed or self.bodies.needs_no_mesh
        return self._pressed_evenly and (few or self.parts.interfering_patches <= self.table_rows)

    @property
    def _pressed_evenly(self) -> bool:
        """Whether nothing but mean pressures of patches deforms the bodies, without mass."""
        return not self.scene.needs_mesh and self.scene.coupling.interface == "patchwise"

    # --- what is said of it

    @property
    def statement(self) -> str:
        """What the coupling is, in a sentence."""
        parts, tilt = self.parts, self.scene.loading.tilt
        patches = f"{times(parts.patches.grid)} patches"
        if parts.plane_at_largest_load is not None:
            laws = parts.interfering_patches
            patches += f", {laws} get a law, {parts.patches.count - laws} stay open"
        made = "all from one solution of the whole surface"
        if self.scene.patches_alone:
            made = f"every patch alone, Love's {self.scene.coupling.love} displacement"
        elif tilt == "free":
            made += " under the tilt that the plane takes at each approach"
        elif any(tilt):
            made += " under the load's tilt"
        return f"{self.scene.kind}: {patches}; {made}; {self.scene.coupling.interface} closure"

    @property
    def causes(self) -> str:
        """Causes of the errors that are measured, in words."""
        return f"{super().causes} and laws"

    # --- laws

    def make_laws(self) -> LawTable:
        """Tabulate the laws of all patches, once; see `Coupling.make_laws`."""
        if self.table is None and not self.scene.patches_alone:
            self._model = self.model_on_body()  # in a phase of its own
        return super().make_laws()

    def _make_table(self, observe: ProgressObserver | None) -> LawTable:
        options: dict[str, Any] = {
            "mean_heights": self.parts.mean_heights,
            "tolerance": self.table_tolerance,
            "most_rows": self.table_rows,
            "comm": self.comm,
            "observe": observe,
        }
        coupling, patches = self.scene.coupling, self.parts.patches
        if self.scene.patches_alone:
            ends = self.parts.largest_closures + self._rise()
            return isolated_laws(
                self.model_alone(), patches, closure_ends=ends, love=coupling.love, **options
            )
        table = consistent_laws(
            self._model,
            patches,
            largest=self._largest_control(),
            displacements=self.bodies.patch_displacements(self.table_rows),
            pointwise=coupling.interface == "pointwise",
            **options,
        )
        return table if self.scene.leak is None else self._with_leak(table)

    def model_alone(self) -> MicroModel:
        """Return the micro model on a half-space, which patches are pressed on alone."""
        if not isinstance(self.micro, HalfSpaceModel):
            return self.micro
        return on_body(None, self.parts.materials, None)(self.micro, 0)

    def _with_leak(self, table: LawTable) -> LawTable:
        """Return the laws with the transmissivities of their patches; collective."""
        from patchlaw.multiscale.laws.transmissivity import patch_grids, patch_transmissivities

        parts = self.parts
        assert parts.cells is not None, "scenes of summits are refused"
        assert isinstance(self._model, HalfSpaceModel)
        model, probe, largest = self._model, self.error_probe(), self._largest_control()
        grids = patch_grids(parts.cells, parts.patches)
        coarser = [probe.on_body(probe.model.resampled(grid), probe.order) for grid in grids]
        end, first = on_root_alone(self.comm, lambda: _ends(model, largest))
        end += _RESERVE * (end - first)
        models, ends = (model, *coarser), (first, end)
        flows = patch_transmissivities(models, parts.patches, ends, largest.tilt, self.comm)
        pairs = zip(table.laws, flows, strict=True)
        laws = tuple(replace(law, transmissivity=flow) for law, flow in pairs)
        return replace(table, laws=laws)

    def _largest_control(self) -> Control:
        """Return the load that laws are made up to: other loads of the body raise its face."""
        path = self.parts.path
        controls, rise = path.largest_controls, self._rise()
        if len(controls) == 1 and not rise:
            return controls[0]
        contact = self.contact_of(self._model)
        plane = plane_at_largest_load(path, contact, self.parts.surface)
        assert plane is not None
        return Control(approach=plane.approach + rise, tilt=path.tilt)

    def _rise(self) -> float:
        """Return how much further the face comes than under the contact alone [mm]; collective.

        Other loads raise it. Shear turns a body over, so that one side of it bears more.
        """
        rise = self.bodies.largest_preload() if self.scene.loads_bodies else 0.0
        if (friction := self.scene.friction) is not None:
            rise += _TURNED_OVER * friction.coefficient * max(self.parts.plane.approach, 0.0)
        return rise

    # --- load steps

    def _make_model(self) -> Model:
        """Make what finds load steps: on the mesh, or on the compliance of patches.

        A free plane turns as it did in the rows of its laws.
        """
        table = self.make_laws()
        if table.path is not None and self._pressed_evenly:
            return FreePlaneContact(table, self.bodies.patch_displacements(self.table_rows))
        if self.condensed:
            return PatchContact(table, self.bodies.compliance_under(table.touched))
        from patchlaw.macro import LawContactProblem

        face = self.bodies.contact_face
        mode, section = self.scene.coupling.interface, self.scene.friction
        friction = None if section is None else Friction(coefficient=section.coefficient)
        problem = LawContactProblem(face, table.together(), mode=mode, friction=friction)
        return FaceContact(problem, table, face)

    def contact(self, step: LoadStep, latest: Any) -> tuple[dict[str, Any], ContactState] | None:
        """Solve the contact problem that laws stand for, under the plane of a load step."""
        on_it = not self.scene.patches_alone or isinstance(self.micro, HalfSpaceModel)
        contact = self.contact_of(self.model_on_body() if on_it else self.micro)
        solved = contact.press(step.under_its_plane)
        detail = contact.detail(contact.latest)
        peak = {"peak_pressure_MPa": solved.peak_pressure_MPa}
        return None if detail is None else (peak, detail)


def _ends(model: MicroModel, largest: Control) -> tuple[float, float]:
    """Return the approaches at the largest load, and under a millionth of its force [mm]."""
    end = model.press(largest)
    slight = Control(force=1e-6 * end.force, tilt=largest.tilt)
    return end.approach, model.press(slight).approach
