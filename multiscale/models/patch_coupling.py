"""The couplings with a law for every patch: consistent and isolated laws.

Theory: docs/theory.md, sections 10 and 11.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from patchlaw.geometry import Control, Friction, roughness
from patchlaw.geometry.contact_state import ContactState
from patchlaw.geometry.patches import field_means
from patchlaw.micro import HalfSpaceModel, MicroModel
from patchlaw.micro.boundary_elements.finite_slopes import SLOPES
from patchlaw.multiscale.bodies.bodies import on_body
from patchlaw.multiscale.laws.law_table import LawTable
from patchlaw.multiscale.laws.of_patches import consistent_laws, isolated_laws
from patchlaw.multiscale.laws.refinement import MOST_ROWS
from patchlaw.multiscale.laws.worn_laws import WornLaws
from patchlaw.multiscale.loading.load_step import LoadStep
from patchlaw.multiscale.models.cell_coupling import CellCoupling, as_worn
from patchlaw.multiscale.models.face_contact import FaceContact
from patchlaw.multiscale.models.patch_contact import PatchContact, PathContact
from patchlaw.multiscale.models.problem import Model, Problem, plane_at_largest_load
from patchlaw.support import Array, NotConverged, on_root, on_root_alone
from patchlaw.support.readable import ProgressObserver, times, unobserved

if TYPE_CHECKING:  # finite elements are imported only by scenes that need them
    from patchlaw.macro import FacePair, LawContactProblem, LoadedFace

_TURNED_OVER = 1.0
"""Part of the approach, times μ, that laws are made further under friction. On a cube with 3 × 3
patches that slides as a whole closures needed 0.4 at μ = 0.5."""
FIRST_DEPTH = 1e-3
"""First depth that laws of worn surfaces are made for, over the rms height."""
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
    def way_of_steps(self) -> str:
        """How load steps are found, in words."""
        if self._follows_rows:
            return "along the rows of the laws"
        return "condensed to the patches" if self.condensed else super().way_of_steps

    @property
    def _follows_rows(self) -> bool:
        """Whether load steps lie on the rows of the laws: free planes, and what wears."""
        free = self.parts.path.tilt is None and self._pressed_evenly
        return not self.scene.patches_alone and (free or self.scene.wear is not None)

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
            _ = self._model  # in a phase of its own
        return super().make_laws()

    @cached_property
    def _model(self) -> MicroModel:
        """The micro model that laws are made with, on the body."""
        return self.model_on_body()

    def _make_table(self, observe: ProgressObserver, before: LawTable | None = None) -> LawTable:
        if before is not None and self.scene.patches_alone:  # no point comes further than the plane
            return before
        options = self._options(observe)
        if self.scene.patches_alone:
            ends, love = self.parts.largest_closures + self._rise(), self.scene.coupling.love
            alone, patches = self.model_alone(), self.parts.patches
            return isolated_laws(alone, patches, closure_ends=ends, love=love, **options)
        try:
            table = self._consistent(self._model, self._largest_control(), before=before, **options)
        except NotConverged:
            if before is None:
                raise
            return before  # no pressure presses the surface further, as at its hardness
        if table is before:
            return table
        return self._with_leak(table, self._model, None, self._largest_control())

    def _options(self, observe: ProgressObserver = unobserved) -> dict[str, Any]:
        return {
            "mean_heights": self.parts.mean_heights,
            "tolerance": self.table_tolerance,
            "most_rows": self.table_rows,
            "comm": self.comm,
            "observe": observe,
        }

    def _consistent(self, model: MicroModel, largest: Control, **options: Any) -> LawTable:
        """Return the laws of patches of a surface that is pressed as a whole; collective."""
        return consistent_laws(
            model,
            self.parts.patches,
            largest=largest,
            displacements=self.bodies.patch_displacements(self.table_rows),
            pointwise=self.scene.coupling.interface == "pointwise",
            **options,
        )

    # --- wear

    @cached_property
    def worn_depths(self) -> list[tuple[float, Array, Array, Array]]:
        """Distances slid [mm], what cells are lower by and what has worn off, and its errors.

        Depths have the shape (nx, ny) [mm]; they differ by what has yielded. Errors are those by
        the steps of wear, see `micro.wear.Worn`.

        The surface slides as a whole through all load steps, as it would without laws; where these
        may be halved, by way of distances that double from that of the first depth on.

        Note:
            Collective.
        """
        assert self.scene.wear is not None
        surface, path = self.parts.surface, self.parts.path
        per_way = self.scene.wear.coefficient * self._largest_force / surface.area
        if per_way == 0.0:  # nothing is touched, so nothing wears
            return []
        first = FIRST_DEPTH * roughness(surface).sq / per_way
        halved = self.scene.loading.force_change is not None
        doublings = math.log2(max(path[-1].slid / first, 1.0)) if halved else 0.0
        doubled = first * 2.0 ** np.arange(doublings)
        steps, before = [], None
        found: dict[float, tuple[Array, Array, Array]] = {}
        for step in path:
            began = 0.0 if before is None else before.slid
            between = doubled[(doubled > began) & (doubled < step.slid)] - began
            steps += [step.part(way / (step.slid - began), before) for way in between]
            steps.append(before := step)
        contact = self.contact_of(self.model_on_body())
        for one in Problem(contact, steps).steps():
            if one.slid_mm and one.slid_mm not in found:
                lowered = on_root(self.comm, lambda: contact.lowered)
                assert lowered is not None, "what slides under a load has worn"
                errors = on_root(self.comm, lambda: np.array(contact.wear_errors))
                worn = on_root(self.comm, lambda: contact.past.start.worn_depth)
                found[one.slid_mm] = lowered, worn, errors
        return [(slid, *those) for slid, those in found.items()]

    @property
    def _largest_force(self) -> float:
        """Force of the new surface under the largest load [N]; collective."""
        contact, path = self.contact_of(self.model_on_body()), self.parts.path
        alone = [replace(one, slid=0.0) for one in path.largest_controls]
        return max(contact.press(one).force_N for one in alone)

    def _with_wear(self, table: LawTable) -> LawTable:
        """Return the laws with those of the surface as it runs in; collective."""
        parts, worn, error = self.parts, [], table.force_error
        lengths, tilt = parts.surface.lengths, parts.path.tilt
        load = Control(force=self._largest_force, tilt=tilt)
        for slid, depth, wear, _ in self.worn_depths:
            means, lower = (field_means(one, lengths, parts.patches) for one in (wear, depth))
            options = self._options() | {"mean_heights": parts.mean_heights - lower}
            model = self._worn_model(depth)
            made = self._with_leak(self._consistent(model, load, **options), model, depth, load)
            laws = tuple(law.shifted(-one) for law, one in zip(made.laws, means, strict=True))
            worn.append(WornLaws(depth=means, laws=laws, slid=slid, path=made.path))
            error = max(error, made.force_error)
        return replace(table, worn=tuple(worn), force_error=error)

    def _worn_model(self, depth: Array) -> MicroModel:
        """Return the model of the surface as it has worn, on the body; collective."""
        assert isinstance(self.micro, HalfSpaceModel)
        worn = as_worn(self.micro, depth)
        return self.put_on_body(worn, SLOPES if self.parts.finite_slopes else 0)

    def _worn_by(self, step: LoadStep) -> Array | None:
        """Return what has worn off the cells behind laws at a load step; None where nothing has."""
        if not (step.slid_mm and self.worn_depths):
            return None
        depths = [np.zeros(()), *(lowered for _, lowered, _, _ in self.worn_depths)]
        means = [0.0, *(float(worn.mean()) for _, _, worn, _ in self.worn_depths)]
        place = float(np.interp(step.mean_worn_depth_mm or 0.0, means, np.arange(len(means))))
        below = min(int(place), len(depths) - 2)
        return np.asarray(depths[below] + (place - below) * (depths[below + 1] - depths[below]))

    def errors_of_wear(self, step: LoadStep) -> tuple[float, ...]:
        """Return the errors by the steps of wear of the laws' surface.

        The largest depth is that of patches, which errs at most as that of cells.
        """
        slid = step.slid_mm or 0.0
        before = [errors for way, _, _, errors in self.worn_depths if way <= slid]
        return tuple(before[-1].tolist()) if before else super().errors_of_wear(step)

    def model_alone(self) -> MicroModel:
        """Return the micro model on a half-space, which patches are pressed on alone."""
        if not isinstance(self.micro, HalfSpaceModel):
            return self.micro
        return on_body(None, self.parts.materials, None)(self.micro, 0)

    def _with_leak(
        self, table: LawTable, model: MicroModel, depth: Array | None, largest: Control
    ) -> LawTable:
        """Return laws with the transmissivities of their patches, where fluid leaks; collective.

        Args:
            table: The laws.
            model: The surface that they were made from, on its body.
            depth: What has worn off its cells, shape (nx, ny) [mm]; None of a new one.
            largest: The largest load.
        """
        if self.scene.leak is None:
            return table
        from patchlaw.multiscale.laws.transmissivity import patch_grids, patch_transmissivities

        parts, probe = self.parts, self.error_probe()
        assert parts.cells is not None, "scenes of summits are refused"
        assert isinstance(model, HalfSpaceModel)
        whole = probe.model if depth is None else as_worn(probe.model, depth)
        # worn surfaces have coarser grids of their own: relative errors of new ones held for 38 of
        # 40 flows worn by a tenth of the rms height, and for 6 of 16 by 0.4 of it (20 surfaces)
        grids = patch_grids(parts.cells, parts.patches)
        coarser = [probe.on_body(whole.resampled(grid), probe.order) for grid in grids]
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

        Other loads raise it. What shears a face, or holds it, turns its body over, so that one side
        of it bears more; one that slides and wears is not sheared.
        """
        rise = self.bodies.largest_preload() if self.scene.loads_bodies else 0.0
        if (friction := self.scene.friction) is not None and self.scene.wear is None:
            rise += _TURNED_OVER * friction.coefficient * max(self.parts.plane.approach, 0.0)
        return rise

    # --- load steps

    def _make_model(self) -> Model:
        """Make what finds load steps, see `way_of_steps`."""
        table, section, tilt = self.make_laws(), self.scene.wear, self.parts.path.tilt
        if section is not None and not table.worn:  # kept laws are those of new surfaces
            with self.clock.phase("laws"):
                table = self.table = self._with_wear(table)
        if self._follows_rows:
            moved, rubs = self.bodies.patch_displacements(self.table_rows), self.scene.friction
            wear, rubbed = (one.coefficient if one and section else 0.0 for one in (section, rubs))
            face = self.bodies.contact_face if self.scene.vibration else None
            return PathContact(table, moved, tilt, wear=wear, friction=rubbed, face=face)
        if self.condensed:
            return PatchContact(table, self.bodies.compliance_under(table.touched))
        face = self.bodies.contact_face
        return FaceContact(self._problem(face, table), table, face, longer=self._longer)

    def _problem(self, face: LoadedFace | FacePair, table: LawTable) -> LawContactProblem:
        """Return a contact face with the laws on it, or at its points."""
        from patchlaw.macro import LawContactProblem

        mode, rubs = self.scene.coupling.interface, self.scene.friction
        friction = Friction(coefficient=rubs.coefficient) if rubs else None
        return LawContactProblem(face, table.together(), mode=mode, friction=friction)

    def contact(self, step: LoadStep, latest: Any) -> tuple[dict[str, Any], ContactState] | None:
        """Solve the contact problem that laws stand for, under the plane of a load step."""
        on_it = not self.scene.patches_alone or isinstance(self.micro, HalfSpaceModel)
        worn = self._worn_by(step)
        model = self._worn_model(worn) if worn is not None else self.model_on_body()
        contact = self.contact_of(model if on_it else self.micro)
        plane = Control(approach=step.approach_mm, tilt=step.tilt, body_state=step.body_state)
        solved = contact.press(plane)
        detail = contact.detail(contact.latest)
        peak = {"peak_pressure_MPa": solved.peak_pressure_MPa}
        return None if detail is None else (peak, detail)


def _ends(model: MicroModel, largest: Control) -> tuple[float, float]:
    """Return the approaches at the largest load, and under a millionth of its force [mm]."""
    end = model.press(largest)
    slight = Control(force=1e-6 * end.force, tilt=largest.tilt)
    return end.approach, model.press(slight).approach
