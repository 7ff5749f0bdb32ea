"""The contact problem of a micro model, solved at every load step.

Theory: docs/theory.md, sections 3 and 7.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, Any, NamedTuple, Self

import numpy as np

from patchlaw.geometry import (
    Control,
    Material,
    MaterialPair,
    PatchGrid,
    Surface,
    overlaps,
    patch_means,
)
from patchlaw.geometry.contact_state import ContactState, ShearState, Start
from patchlaw.geometry.spring_bed import Coefficient
from patchlaw.geometry.statistics import check_finite_slopes
from patchlaw.micro import FrictionModel, HalfSpaceModel, MicroModel, NormalStiffness, Stiffness
from patchlaw.micro.boundary_elements.finite_slopes import SLOPES
from patchlaw.micro.friction.coupled import coupled_stiffness, press_coupled
from patchlaw.micro.wear import slide, worn_depths
from patchlaw.multiscale.bodies.bodies import on_body
from patchlaw.multiscale.bodies.face_terms import ElasticBlock
from patchlaw.multiscale.loading.load_step import LOOSE, LoadStep, PatchState
from patchlaw.multiscale.models.problem import Model, Slid, in_one_line
from patchlaw.support import Array, InputError, NotBalanced, on_root, on_root_alone
from patchlaw.support.arguments import Comm, Has, Limits, PositivePressure, checked

Pressed = Annotated[MicroModel, Has("a micro model such as a HalfSpaceModel", ("press",))]


class Past(NamedTuple):
    """What load steps left behind; on rank 0 alone.

    Attributes:
        start: What the next solution starts from; None begins anew. Under a hardness, with wear and
            with friction, the next load step depends on it.
        latest: The contact at the latest load step.
        shear: Its shear; None before any.
        control: What was prescribed, without its shear.
        before: What the latest normal contact started from, where shear alone may change.
        slid: Distance that the surfaces have slid.
        stiffness: The normal stiffness at the latest load step, once it is known.
    """

    start: Start | None = None
    latest: ContactState | None = None
    shear: ShearState | None = None
    control: Control | None = None
    before: Start | None = None
    slid: Slid = Slid()
    stiffness: NormalStiffness | None = None

    @property
    def solved(self) -> ContactState:
        """The contact at the latest load step.

        Raises:
            ValueError: Before the first load step.
        """
        if self.latest is None:
            raise ValueError("no load step is solved yet")
        return self.latest


class CellContact(Model):
    """Solves the contact problem itself at every load step, without laws; rank 0 solves for all.

    Args:
        model: Micro model of the whole surface, with the body that it is pressed on.
        patches: Partition that the results are summed over; it does not change the solution. The
            whole surface when not given.
        mean_heights: Mean height of each patch, shape (N,) [mm]; those of the model's surface when
            not given.
        comm: MPI communicator (mpi4py) or None.
        friction: Friction of the surface; none when not given.
        wear: Depth that wears off per distance slid and pressure [mm²/N]; nothing when 0. With
            friction cells wear by their own slip where load steps shear.

    Attributes:
        past: What the load steps so far left behind; set it to take load steps back.
        held: Where supports hold the sides of the face, see `FaceTerms.held`; nowhere at first.
    """

    @checked
    def __init__(
        self,
        model: Pressed,
        patches: PatchGrid | None = None,
        mean_heights: Array | None = None,
        comm: Comm | None = None,
        friction: FrictionModel | None = None,
        wear: Annotated[float, Limits(ge=0)] = 0.0,
    ) -> None:
        if patches is None:
            if not isinstance(model, HalfSpaceModel):
                raise InputError("summits need patches", allowed="a PatchGrid")
            patches = PatchGrid(grid=(1, 1), lengths=model.surface.lengths)
        means = np.zeros(patches.count) if mean_heights is None else mean_heights
        if means.shape != (patches.count,) or not np.isfinite(means).all():
            allowed = f"a finite number for each of {patches.count} patches"
            raise InputError("does not fit", key="mean_heights", allowed=allowed)
        if friction is not None:
            wear = wear or friction.wear
            friction = replace(friction, wear=wear)
        if wear and not isinstance(model, HalfSpaceModel):
            problem = "does not go without cells"
            raise InputError(problem, key="wear", value=wear, allowed="a HalfSpaceModel; or 0")
        self._model, self._patches = model, patches
        self._options: dict[str, Any] = {"patches": patches, "mean_heights": mean_heights}
        self._comm, self._friction = comm, friction
        self._wear, self.wears = wear, wear > 0.0
        self.past = Past()
        self._worn_model: tuple[Array, HalfSpaceModel] | None = None
        self.held: Sequence[tuple[float, float] | None] = ()

    @classmethod
    @checked
    def of(
        cls,
        surface: Surface,
        body: Material | ElasticBlock,
        *,
        counter: Material | None = None,
        hardness: PositivePressure | None = None,
        friction: Coefficient | None = None,
        finite_slopes: bool = True,
        periodic: bool = False,
        wear: Annotated[float, Limits(ge=0)] = 0.0,
        patches: PatchGrid | None = None,
        comm: Comm | None = None,
    ) -> Self:
        """Return the contact of a rough surface on a body, without a scene.

        Args:
            surface: The rough surface.
            body: What it belongs to: a block, or the material of a half-space.
            counter: Material of an elastic half-space that presses it; a rigid plane otherwise.
            hardness: Hardness of the softer body, the largest pressure [MPa]; none when not given.
            friction: Coefficient of friction μ; none when not given. Pressures do not see
                tractions.
            finite_slopes: Whether the finite slopes of the surface count, to second order.
            periodic: Whether the surface continues periodically, on a half-space.
            wear: Depth that wears off per distance slid and pressure [mm²/N], where load steps
                slide or, with friction, cells slip under a shear.
            patches: Partition that the results are summed over; the whole surface when not given.
            comm: MPI communicator (mpi4py); None for this process alone.

        Raises:
            InputError: When something does not fit, or the surface is too steep for its slopes to
                count.

        Note:
            Collective.
        """
        terms = rubs = tractions = None
        if isinstance(body, ElasticBlock):
            if periodic:
                allowed = "the Material of a half-space"
                raise InputError("does not continue periodically", key="body", allowed=allowed)
            terms = body.terms(surface.lengths)
            if friction is not None:
                whole = body.terms(surface.lengths, side_term=False)
                tractions = whole.traction_term(comm)
        material = body.material if isinstance(body, ElasticBlock) else body
        pair = MaterialPair(first=material, second=counter)
        if finite_slopes:
            check_finite_slopes(surface)
        micro = HalfSpaceModel(
            surface, contact_modulus=pair.contact_modulus, hardness=hardness, periodic=periodic
        )
        put = on_body(terms, pair, None, comm=comm)
        if friction is not None:
            rubs = FrictionModel(
                materials=pair,
                coefficient=friction,
                spacing=surface.spacing,
                periodic=periodic,
                body=tractions,
            )
        return cls(put(micro, SLOPES if finite_slopes else 0), patches, None, comm, rubs, wear)

    def press(self, control: Control) -> LoadStep:
        """Solve one load step; see `Model.press`."""

        def solve() -> LoadStep:
            now = self._pressed(control)
            state, shear, products = now.solved, now.shear, 0
            if any(self.held):
                self._check_supports(control, state)
            if shear is not None and control.shear is not None:
                state, products = replace(state, shear=shear, heat=shear.heat), shear.products
            elif self._friction is not None and self.wears:
                heat = self._friction.coefficient / self._wear * _worn_depth(state)
                state = replace(state, heat=heat)
            self.past = now._replace(latest=state, start=state.start)
            area, fractions = self._patches.area, state.patch_area / self._patches.area
            return LoadStep.of_patches(
                self._patches,
                plane=(state.approach, *state.tilt),
                load=(state.force, *state.moment),
                patches=PatchState(state.patch_closure, state.patch_force / area, fractions),
                separation=state.mean_separation,
                contacts=state.contacts,
                newton_iterations=state.iterations + products,
                warnings=(
                    *filter(None, (state.warning,)),
                    *(LOOSE,) * (control.tilt is None and _rests_on_a_line(state)),
                ),
                peak_pressure_MPa=state.peak_pressure,
                shear=state.shear,
                **self._of_cells(),
            )

        return on_root_alone(self._comm, solve)

    def _check_supports(self, control: Control, state: ContactState) -> None:
        """Refuse contacts at a side that supports hold: nothing there can give way.

        The smaller the cells, the larger the force would be, without limit.
        """
        if state.pressure is None or not isinstance(self._model, HalfSpaceModel):
            return
        surface = self._model.surface
        for number, span in enumerate(self.held):
            axis, high = divmod(number % 4, 2)
            places = (surface.y, surface.x)[axis]
            touching = np.take(state.pressures, -high, axis=axis) > 0.0
            if span is not None and (touching & (places > span[0]) & (places < span[1])).any():
                side = f"{('low', 'high')[high]} {'xy'[axis]}"
                raise NotBalanced(
                    f"the contact of the surface at {control}",
                    reason=f"SUPPORT_IN_CONTACT: the plane touches the face at its {side} side, "
                    "which a support holds",
                    iterations=state.iterations,
                    remedy="hold the body apart from its contact, or press less far",
                )

    def _pressed(self, control: Control) -> Past:
        """Solve the contact and its shear; the normal contact anew unless shear alone changes."""
        friction, past, normal = self._friction, self.past, replace(control, shear=None)
        if control.slid:
            self._check_slid(control)
        if friction is None or control.shear is None:
            state, slid = self._press(control, past.start)
            return past._replace(latest=state, control=normal, slid=slid, stiffness=None)
        if self._in_turn:
            assert isinstance(self._model, HalfSpaceModel)
            at = self._model, friction, control, past.shear
            state, shear = press_coupled(*at, start=past.start, **self._options)
            slid = past.slid
            if friction.wear and shear.dissipated_in_step:  # the mean, in proportion to pressures
                further = shear.dissipated_in_step / (float(shear.bound.sum()) * friction.cell)
                slid = slid._replace(distance=slid.distance + further)
            return Past(latest=state, shear=shear, control=normal, before=past.before, slid=slid)
        if past.latest is not None and past.control == normal:
            past = past._replace(latest=replace(past.latest, iterations=0))
        else:
            state, slid = self._press(control, past.start)
            past = Past(
                latest=state, shear=past.shear, control=normal, before=past.start, slid=slid
            )
        return past._replace(
            shear=friction.advance(past.shear, past.solved.pressures, control.shear)
        )

    def _check_slid(self, control: Control) -> None:
        """Refuse distances that nothing wears by, that fall, or beside a shear."""
        problem, allowed = "", ""
        if not self.wears:
            problem, allowed = (
                "changes nothing",
                "a model with wear, as CellContact.of(…, wear=1e-8)",
            )
        elif control.shear is not None or self.past.shear is not None:
            problem, allowed = "slides as a whole what is sheared", "either slid or shear"
        elif control.slid < self.past.slid.distance:
            problem, allowed = "falls", f"{self.past.slid.distance:.6g} mm or more"
        if problem:
            raise InputError(problem, key="slid", value=control.slid, allowed=allowed)

    def _of_cells(self) -> dict[str, Any]:
        """Return the energies at the latest load step, and what has yielded, where known."""
        state = self.latest
        if state is None or state.pressure is None:
            return {}
        columns = {"elastic_energy_mJ": state.elastic_energy, "plastic_work_mJ": state.plastic_work}
        if state.plastic_depth is not None and state.yielding is not None:
            columns["yielding_area_fraction"] = float(np.mean(state.yielding))
            columns["plastic_depth_mm"] = float(state.plastic_depth.max())
        if self.wears:
            columns |= self._of_wear(state)
        if (shear := state.shear) is not None:
            # which part of the contact slips; its area is measured finer than by whole cells
            part = shear.slipping.sum() / max(int(shear.closed.sum()), 1)
            columns["slip_area_fraction"] = float(part) * state.contact_area_fraction
        return columns

    def _of_wear(self, state: ContactState) -> dict[str, Any]:
        """Return what has worn off at the latest load step."""
        (mean, largest), heat = worn_depths(state), {}
        if state.heat is not None and state.shear is None:
            heat["dissipated_mJ"] = float(state.heat.mean()) * state.nominal_area
        return {
            "slid_mm": self.past.slid.distance,
            "worn_volume_mm3": mean * state.nominal_area,
            "mean_worn_depth_mm": mean,
            "worn_depth_mm": largest,
        } | heat

    def tangential_stiffness(self) -> Stiffness:
        """Return the derivative of the shear force along the shift at the latest load step."""

        def stiffness() -> Stiffness:
            state, friction, model = self.past.solved, self._friction, self._model
            control = self.past.control
            if friction is None or state.shear is None or control is None:
                return Stiffness(None, 0)
            if friction.coupled and isinstance(model, HalfSpaceModel):
                worn = self._as_worn(state.start)
                assert isinstance(worn, HalfSpaceModel)
                found = coupled_stiffness(worn, friction, control, state, state.shear)
            else:
                found = friction.stiffness(state.shear)
            value, used = found
            return Stiffness(value if np.isfinite(value) else None, used)

        return on_root_alone(self._comm, stiffness)

    @property
    def latest(self) -> ContactState | None:
        """The contact at the latest load step; on rank 0 alone."""
        return self.past.latest

    def field_state(self, step: LoadStep, parts: PatchGrid) -> Array:
        """Return the mean stresses of parts of the contact face at the latest load step.

        Their forces add up to those on the plane. A spot that is not made of cells counts for the
        part that holds its largest pressure.

        Args:
            step: The load step.
            parts: The N parts.

        Returns:
            The pressures, shape (N,), with friction those and the tractions along x and y, shape
            (3, N) [MPa]; with wear the worn depths in a last row, shape (2, N) or (4, N) [mm].
        """

        def stresses() -> Array:
            if isinstance(self._model, HalfSpaceModel):
                state, surface = self.past.solved, self._model.surface
                fields = state.pressures
                if self.past.shear is not None:
                    fields = np.concatenate([fields[None], self.past.shear.traction])
                if self.wears:
                    worn = _worn_depth(state)
                    fields = np.concatenate([fields.reshape(-1, *worn.shape), worn[None]])
                x, y = overlaps(parts, surface.lengths, surface.grid)
                means = x @ fields @ y.T / parts.area
                return np.asarray(means.reshape(*fields.shape[:-2], -1))
            spots = self.past.solved.spots
            assert spots is not None
            owner = parts.index_of(*spots.place.T)
            return np.bincount(owner, spots.force, minlength=parts.count) / parts.area

        return on_root(self._comm, stresses)

    def stiffness(self) -> NormalStiffness:
        """Return −dF/dū and dF/dδ at the latest load step."""

        def stiffness() -> NormalStiffness:
            state, control, known = self.past.solved, self.past.control, self.past.stiffness
            if known is not None:  # shear alone has changed
                return known._replace(iterations=0)
            turns = control is not None and control.tilt is None
            found = self._as_worn(state.start).stiffness(state, turns=turns)
            self.past = self.past._replace(stiffness=found)
            return found

        return on_root_alone(self._comm, stiffness)

    def conducting_stiffness(self, step: LoadStep) -> float:
        """Return the elastic stiffness of the interface; see `Model`.

        Raises:
            InputError: When the micro model has no cells.
        """

        def stiffness() -> float:
            known = self.past.stiffness
            if known is None or known.interface is None or known.scatter:
                state = self.past.solved
                model = self._as_worn(state.start)
                if not isinstance(model, HalfSpaceModel):
                    raise InputError("contacts without cells have no conductance")
                known = model.unloading_stiffness(state)
            return np.nan if known.interface is None else known.interface

        return on_root_alone(self._comm, stiffness)

    @property
    def gaps(self) -> Array | None:
        """Gaps of all cells at the latest load step; see `Model.gaps`."""
        state = self.latest
        return None if state is None or state.gap is None else state.open_gap

    def detail(self, latest: Any) -> ContactState | None:
        """Return the spots and fields of a contact, the same on every rank."""
        return on_root_alone(self._comm, lambda: latest)

    def state(self) -> Any:
        """Return what later load steps depend on; it is whole on rank 0 alone.

        It is the latest solution, and what finite slopes remember of all. Where shear alone may
        change, what the normal contact was found from belongs to it: the contact is then the same
        to the last digit, and cells that have yielded tell from which side the plane came.
        """
        past, alone = self.past, self._friction is None
        learnt = self._model.learnt if alone and isinstance(self._model, HalfSpaceModel) else []
        return [past.start, past.shear, past.before, past.control, learnt, *past.slid]

    def restore(self, state: Any) -> None:
        """Go on from a state."""
        if state is None:
            return
        start, shear, before, control, learnt, *slid = state
        self.past = Past(start, None, shear, control, before, Slid(*slid))
        if learnt and isinstance(self._model, HalfSpaceModel):
            self._model.relearn(learnt)
        if self._friction is not None and control is not None and not self._in_turn:
            self.past = self.past._replace(latest=self._press(control, before)[0])

    @property
    def _in_turn(self) -> bool:
        """Whether pressures and tractions are solved in turn."""
        friction = self._friction
        return friction is not None and friction.in_turn and isinstance(self._model, HalfSpaceModel)

    def _press(self, control: Control, start: Start | None) -> tuple[ContactState, Slid]:
        """Solve the normal contact, at the end of what the surfaces slide."""
        model, slid, options = self._as_worn(start), self.past.slid, self._options
        further = control.slid - slid.distance
        if not (self.wears and further > 0.0 and isinstance(model, HalfSpaceModel)):
            return model.press(control, start=start, **options), slid
        start = start or model.press(control, **options).start
        worn = slide(model, control, start, self._wear * further, **options)
        errors = np.add(slid.errors, worn.errors)
        apart = slid.apart + worn.apart
        return worn.state, Slid(control.slid, tuple(errors.tolist()), apart=apart)

    def _as_worn(self, start: Start | None) -> MicroModel:
        """Return the model with finite slopes of the surface as it has worn."""
        depth = None if start is None else start.worn_depth
        if depth is None or not isinstance(self._model, HalfSpaceModel):
            return self._model
        if self._worn_model is None or self._worn_model[0] is not depth:
            self._worn_model = depth, self._model.worn(depth)
        return self._worn_model[1]

    @property
    def lowered(self) -> Array | None:
        """What the heights are lower by at the latest load step, (nx, ny) [mm]; on rank 0 alone."""
        return None if self.past.start is None else self.past.start.lowered

    @property
    def wear_errors(self) -> tuple[float, ...]:
        """Errors by the steps of wear, see `micro.wear.Worn`; on rank 0 alone."""
        return self.past.slid.errors


def _rests_on_a_line(state: ContactState) -> bool:
    """Tell whether all cells in contact that do not yield lie in one line, if there are any.

    Those that yield bear the hardness wherever the plane is, as far as they do.
    """
    if state.pressure is None or not state.force > 0.0:
        return False
    holds = state.pressures > 0.0
    if state.yielding is not None:
        holds &= ~state.yielding
    return in_one_line(np.stack(np.nonzero(holds)).astype(float))


def _worn_depth(state: ContactState) -> Array:
    """Return the depth that has worn off the cells, shape (nx, ny) [mm]."""
    return np.zeros(state.pressures.shape) if state.worn_depth is None else state.worn_depth


def on_few_cells(model: HalfSpaceModel) -> CellContact:
    """Return what solves the contact of a half-space on few cells, which estimate planes.

    On 1024² cells with waves down to a 256th of the side the approach was within 1.5 %.

    Args:
        model: The half-space on the cells of the surface.
    """
    surface = model.surface
    x, y = (min(count, 96) for count in surface.grid)
    whole = PatchGrid(grid=(1, 1), lengths=surface.lengths)
    return CellContact(model.resampled((x, y)), whole, patch_means(surface, whole))
