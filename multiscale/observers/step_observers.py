"""What sees the load steps of a run: contacts, stiffness, energies, errors, and states of fields.

An observer is what is read off load steps: it returns columns of them, says what a report says of
them, and has its figures. A run makes those that its scene asks for; they see the columns of those
before them.

The elastic energy is a convex function of the motions of the plane, and the forces on it are its
gradient. From one load step to the next it therefore rises by no less than the first forces, and by
no more than the last ones, times the motion between them. Under a hardness the same holds of
elastic energy and plastic work together where the plane comes nearer.

Theory: docs/theory.md, section 14.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from patchlaw.multiscale.loading.load_step import LoadStep, with_exact_zeros
from patchlaw.multiscale.models import describe
from patchlaw.multiscale.models.coupling import Coupling
from patchlaw.multiscale.models.measured_errors.errors import error_notes
from patchlaw.multiscale.results.contacts import ContactRecord
from patchlaw.multiscale.results.history import History
from patchlaw.support import Array, InputError, NotConverged
from patchlaw.support.readable import Caution, Detail, number, percent, quantities, quantity

T = TypeVar("T")
Columns = Mapping[str, Any]
"""Values of a load step's columns, or of its other fields, by name."""

_NO_GAP_LEFT = (
    "in full contact of a period, or shortly before, other grids have no gap left at its approach"
)
_AFTER_UNLOADING = (
    "errors of load steps after unloading are not measured: the plastic depth there is that of the "
    "load steps before"
)


class StepObserver:
    """Sees every load step as it is accepted, and returns columns of it; this one none.

    Args:
        coupling: What finds the load steps.
    """

    def __init__(self, coupling: Coupling) -> None:
        self._coupling = coupling
        self._failures: dict[str, None] = {}

    def observe(self, step: LoadStep, past: Sequence[LoadStep], *, last: bool) -> Columns:
        """Return columns of a load step.

        Args:
            step: The load step just accepted, counted from first touch.
            past: All load steps before it.
            last: Whether no other follows.

        Note:
            Collective.
        """
        return {}

    def notes(self, steps: Sequence[LoadStep]) -> Iterator[str]:
        """Yield what a report says of what the observer saw.

        Args:
            steps: All load steps.
        """
        yield from self._failures

    def results(self, step: LoadStep) -> Iterator[tuple[str, str]]:
        """Yield what a report lists of the last load step beside its columns: name and value.

        Args:
            step: The load step.
        """
        return iter(())

    def figures(self, history: History) -> Iterator[tuple[str, str, tuple[Any, ...]]]:
        """Yield figures: file, function in `multiscale.results.figures`, and its arguments.

        Args:
            history: All load steps.
        """
        return iter(())

    @property
    def fluid(self) -> Any:
        """The `multiscale.observers.leak.FluidMap` of the last load step; None without."""
        return None

    def write_files(self, folder: Path) -> None:
        """Write files beside those of the fields; collective.

        Args:
            folder: Where they go.
        """

    def release(self) -> None:
        """Let go of what holds bodies in memory."""

    def _tried(self, what: str, solve: Callable[[], T]) -> T | None:
        """Return what is solved for; None where there is no solution, which is noted."""
        try:
            return solve()
        except NotConverged as error:
            self._failures[f"{what}: {error}"] = None
            return None

    def _checks(self, last: bool) -> bool:
        """Tell whether errors are to be measured at a load step, the last one or another."""
        check = self._coupling.scene.output.check
        return check == "all" or (check == "last" and last)

    def _plastic_past(self, step: LoadStep, past: Sequence[LoadStep]) -> bool:
        """Tell whether the plastic depth is not that of rising loads, which checks solve for."""
        if not self._coupling.scene.hardness_key:
            return False
        return step.force_N < (1.0 - 1e-6) * max((one.force_N for one in past), default=0.0)


class EnergyObserver(StepObserver):
    """Adds the work of the plane since the start to load steps; says what yields and is stored."""

    def observe(self, step: LoadStep, past: Sequence[LoadStep], *, last: bool) -> Columns:
        """Return the work of the plane."""
        return {"work_mJ": work_of(step, past[-1] if past else None)}

    def notes(self, steps: Sequence[LoadStep]) -> Iterator[str]:
        """Yield what yields or would, and the energies at the last load step."""
        parts, said = self._coupling.parts, describe.hardnesses(self._coupling.parts)
        # peaks of samples are those of means
        if said or parts.regions is None:
            yield from yielding_notes(steps, parts.scene.micro.hardness, said)
        yield from energy_notes(steps, conservative=not self._coupling.friction_is_coupled)


class StiffnessObserver(StepObserver):
    """Adds the stiffnesses to load steps, where it is known, and says of which way."""

    def observe(self, step: LoadStep, past: Sequence[LoadStep], *, last: bool) -> Columns:
        """Return the stiffnesses."""
        stiffness = self._coupling.model.stiffness()
        columns: dict[str, Any] = {
            "linear_iterations": step.linear_iterations + stiffness.iterations
        }
        if (own := stiffness.interface) is not None:
            columns["interface_stiffness_N_per_mm"] = own
            columns["interface_stiffness_MPa_per_mm"] = own / self._coupling.parts.area
        if (whole := stiffness.approach) is not None:
            columns["approach_stiffness_N_per_mm"] = whole
            columns["stiffness_scatter"] = stiffness.scatter
        return columns

    def notes(self, steps: Sequence[LoadStep]) -> Iterator[str]:
        """Yield which stiffnesses are those of further loading, and which those of unloading."""
        known = [one for one in steps if one.plastic_depth_mm and one.interface_stiffness_N_per_mm]
        back = [one.step for one in known if not one.stiffness_scatter]
        if len(known) > len(back):
            yield (
                f"at {len(known) - len(back)} of {len(steps)} load steps cells yield: the "
                "stiffness there is the slope of the force as the load rises further"
            )
        if back:
            yield (
                f"at {len(back)} of {len(steps)} load steps, the last of them load step "
                f"{back[-1]}, no cell yields further: the stiffness there is the slope of "
                "unloading, and of loading again up to the largest load so far"
            )


class ContactRecorder(StepObserver):
    """Records contacts as the scene's ``output.contact`` says.

    Args:
        coupling: What finds the load steps.

    Attributes:
        records: The contacts so far, counted from first touch, the same on every rank.
    """

    def __init__(self, coupling: Coupling) -> None:
        super().__init__(coupling)
        asked = coupling.scene.output.contact
        self._asked = "none" if coupling.scene.by_laws and asked == "auto" else asked
        self.records: list[ContactRecord] = []
        self._state: Any = None
        self._seen, self._unloading = 0, False

    def observe(self, step: LoadStep, past: Sequence[LoadStep], *, last: bool) -> Columns:
        """Record the contact of a load step if it is requested."""
        self._state, self._seen = self._coupling.model.latest, step.step
        self._unloading = step.is_unloading(past[-1] if past else None)
        return self.recorded(step) if last or self._asked == "all" else {}

    def recorded(self, step: LoadStep) -> Columns:
        """Record the contact of a load step, once; return columns that a contact behind laws tells.

        Args:
            step: The load step seen last, or the last one of a run that ended early.
        """
        known = bool(self.records) and self.records[-1].step == step.step
        if self._asked == "none" or known:
            return {}
        if self._seen != step.step and not self._coupling.scene.by_laws:
            return {}  # a step of an earlier call, whose state is gone
        columns: Columns = {}
        number, solve = step.step, partial(self._coupling.contact, step, self._state)
        contact = self._tried(f"contact of load step {number} not found", solve)
        if contact is not None:
            columns, detail = contact
            lengths = self._coupling.parts.surface.lengths
            record = ContactRecord.of(detail, step, lengths, unloading=self._unloading)
            self.records.append(record)
        self.release()
        return columns

    def notes(self, steps: Sequence[LoadStep]) -> Iterator[str]:
        """Yield what a report says of contacts that laws stand for, and of those not found."""
        yield from super().notes(steps)
        if self.records and self._coupling.scene.by_laws:
            last = self.records[-1]
            yield Detail(
                f"contact of load step {last.step}: the contact problem behind the laws, solved "
                f"under the plane of the step, with a force of {quantity(last.force_N, 'N', 5)}"
            )

    def release(self) -> None:
        """Let go of the contact, whose blocks stay in memory as long as it is held."""
        self._state = None


class ErrorCheck(StepObserver):
    """Adds measured errors to load steps, as the scene's ``output.check`` says."""

    def observe(self, step: LoadStep, past: Sequence[LoadStep], *, last: bool) -> Columns:
        """Return the errors, where they are to be measured."""
        coupling = self._coupling
        if not (self._checks(last) and coupling.causes) or coupling.about.unmeasured():
            return {}
        normal = not self._plastic_past(step, past)
        if not normal:
            self._failures[_AFTER_UNLOADING] = None
            if coupling.scene.friction is None:
                return {}
        with coupling.clock.phase("check"):
            solve = partial(coupling.measured_errors, step, past, normal=normal)
            what = f"errors of load step {step.step} not measured"
            try:
                found = self._tried(what, solve)
                return with_exact_zeros(step, found) if found else {}
            except InputError as error:
                reason = _NO_GAP_LEFT if coupling.scene.surface.periodic else error
                self._failures[f"{what}: {reason}"] = None
                return {}

    def notes(self, steps: Sequence[LoadStep]) -> Iterator[str]:
        """Yield why errors were not measured, and those that were."""
        yield from super().notes(steps)
        yield from error_notes(list(steps))
        if steps:
            yield from self._coupling.error_notes(steps)


class FieldRecorder(StepObserver):
    """Keeps the states that fields are written from.

    Args:
        coupling: What finds the load steps.

    Attributes:
        kept: States by number of the load step, see `Model.field_state`.
        records: What makes them again in a resumed run, likewise; see `Model.field_record`.
    """

    def __init__(self, coupling: Coupling) -> None:
        super().__init__(coupling)
        self._wanted = coupling.scene.output.wants_fields
        self.kept: dict[int, Any] = {}
        self.records: dict[int, Any] = {}

    def observe(self, step: LoadStep, past: Sequence[LoadStep], *, last: bool) -> Columns:
        """Keep the state of a load step whose fields may be wanted."""
        if self._coupling.scene.has_body and self._wanted(step.step, last=True):
            if not self._wanted(step.step, last=False):
                self.kept.clear()  # only those of the last load step are wanted
                self.records.clear()
            model = self._coupling.model
            state = model.field_state(step, self._coupling.field_parts)
            self.kept[step.step], self.records[step.step] = state, model.field_record(state)
        return {}

    def write(self, path: Path, steps: Sequence[LoadStep], *, finished: bool) -> None:
        """Write the fields as XDMF and VTX.

        Args:
            path: File to write, ending in ``.xdmf``.
            steps: The load steps.
            finished: Whether none follows. States of an earlier call are then made again.

        Note:
            Collective.
        """
        with self._coupling.clock.phase("field"):
            for step in steps if finished else ():
                wanted = self._wanted(step.step, last=step is steps[-1])  # may be others by now
                if wanted and step.step in self.records and step.step not in self.kept:
                    record, parts = self.records[step.step], self._coupling.field_parts
                    again = self._coupling.model.field_state_again(record, step, parts)
                    self.kept[step.step] = again
            model, coupling = self._coupling.model, self._coupling
            if model.on_mesh:
                model.write_fields(path, self.kept)
            else:
                from patchlaw.macro.fields import write_solved

                face = coupling.bodies.contact_face
                write_solved(path, face, coupling.field_parts, self.kept)


BALANCE = 1e-3
"""Energy that may be missing, relative to the largest, before a run says so. In 150 load steps on
64² cells (half-space and cube, level and free planes) no bound was broken; work and energy differed
by 6e-5, 6e-4 and 1e-3 at rms gradients of 0.2, 0.4 and 0.8, whose second order is no gradient of an
energy, and by 5e-6 without finite slopes, which the trapezoidal rule leaves."""
_ROUNDING = 1e-6
"""Changes of the force, over the largest, that count as none."""


def work_of(step: LoadStep, before: LoadStep | None) -> float | None:
    """Return the work of the plane since the start [mJ]; None without energies.

    Up to the first load step it is the energy that is stored by then, elastic and plastic. Between
    load steps it is that of the trapezoidal rule, with its end correction where the stiffness is
    known and the slopes stay or have no moment: by stiffnesses or, where it is smaller, by their
    inverses, since stiffnesses grow without bound towards full contact of a period. Where nothing
    yields anew after cells have yielded, the load may have turned back at the step before, whose
    stiffness is then that of the other side: instead, the forces are a parabola with the stiffness
    of this step.

    Args:
        step: A load step.
        before: The one before it; None for the first.
    """
    if step.elastic_energy_mJ is None:
        return None
    if before is None:
        return step.elastic_energy_mJ + (step.plastic_work_mJ or 0.0)
    motion, load, ahead = _motion(step) - _motion(before), _load(before), _load(step)
    work = 0.5 * float((load + ahead) @ motion)
    turning = np.abs(motion[1:]) @ (np.abs(load[1:]) + np.abs(ahead[1:]))
    stiffness, earlier = step.approach_stiffness_N_per_mm, before.approach_stiffness_N_per_mm
    if earlier is not None and stiffness is not None and turning <= 1e-6 * abs(work):
        rise = float(ahead[0] - load[0])
        if before.plastic_work_mJ and not step.stiffness_scatter:
            bent = motion[0] * (rise - motion[0] * stiffness)
        else:
            bent = 0.5 * motion[0] ** 2 * (earlier - stiffness)
            if earlier > 0.0 and stiffness > 0.0:
                bent = min(bent, 0.5 * rise**2 * (1.0 / stiffness - 1.0 / earlier), key=abs)
        work += bent / 6.0
    return (before.work_mJ or 0.0) + work


def missing_energy(steps: Sequence[LoadStep]) -> float:
    """Return the largest energy by which load steps break the balance, relative to the largest.

    Args:
        steps: Load steps one after another.
    """
    known = [step for step in steps if step.elastic_energy_mJ is not None]
    if known and known[-1].slid_mm:  # what wears off takes energy with it
        known = [step for step in known if not step.slid_mm]
    motions, loads = (np.reshape([of(one) for one in known], (-1, 3)) for of in (_motion, _load))
    stored = np.array(
        [(one.elastic_energy_mJ or 0.0) + (one.plastic_work_mJ or 0.0) for one in known]
    )
    moved, rise, forces = np.diff(motions, axis=0), np.diff(stored), np.diff(loads[:, 0])
    # The approach of a period in full contact falls with finite slopes as the force rises. Its
    # energy is convex together with that of a smooth body below it, with which none falls.
    counts = np.abs(forces) > _ROUNDING * loads[:, 0].max(initial=0.0)
    softer = np.max(-moved[counts, 0] / forces[counts], initial=0.0)
    least, most = np.sort([(one * moved).sum(axis=1) for one in (loads[:-1], loads[1:])], axis=0)
    beyond = np.maximum(least - rise, rise - most) - 0.5 * softer * forces**2
    worst, largest = beyond.max(initial=0.0), stored.max(initial=0.0)
    return float(worst / largest) if largest else 0.0


def _motion(step: LoadStep) -> Array:
    return np.array([step.approach_mm, *step.tilt])


def _load(step: LoadStep) -> Array:
    return np.array([step.force_N, *step.moment_N_mm])


def yielding_notes(steps: Sequence[LoadStep], hardness: float | None, said: str) -> Iterator[str]:
    """Yield what has yielded or, of elastic contacts, what would bear their pressures.

    Args:
        steps: The load steps.
        hardness: Largest contact pressure of cells [MPa]; None where these are elastic.
        said: The hardness in words, by region where these have their own; empty where nothing
            yields.
    """
    if not said:
        yield from _strength_notes(steps)
        return
    known = [step for step in steps if step.plastic_depth_mm is not None]
    if not known:
        yield (
            f"hardness {said}: the laws are those of rising loads; no plastic "
            "depth stands behind them"
        )
        return
    last = known[-1]
    assert hardness is not None, "cells that yield have one"
    volume = (last.plastic_work_mJ or 0.0) / hardness
    most = max(known, key=lambda step: step.yielding_area_fraction or 0.0)
    depth = quantity(last.plastic_depth_mm or 0.0, "mm")
    yield (
        f"hardness {said}: after load step {last.step} a plastic volume of "
        f"{number(1e9 * volume)} µm³ and a depth of up to {depth} are left; at most "
        f"{percent(most.yielding_area_fraction or 0.0, 3)} of the nominal area bears the "
        f"hardness, at load step {most.step}"
    )


def _strength_notes(steps: Sequence[LoadStep]) -> Iterator[str]:
    """Yield the largest and the mean pressure of elastic contacts, and what bears them."""
    known = [step for step in steps if step.peak_pressure_MPa and step.contact_area_fraction]
    if not known:
        return
    step = max(known, key=lambda each: each.peak_pressure_MPa or 0.0)
    peak = step.peak_pressure_MPa or 0.0
    mean = step.mean_pressure_MPa / step.contact_area_fraction
    # hardness over yield strength of metals, Tabor 1951, ch. 3
    highest, inner, low, high = quantities((peak, mean, peak / 3.0, peak / 2.8), "MPa", 3)
    if peak < mean:  # spheres: below half a cell of contact radius, and from one cell on never
        yield Caution(
            f"elastic contacts: peaks of the pressure are not known at load step {step.step}, as "
            f"contacts are smaller than cells: cells bear up to {highest}, and the real contact "
            f"area {inner} in the mean. More cells (surface.grid) tell them"
        )
        return
    yield (
        f"elastic contacts: pressures up to {highest}, in the mean of the real "
        f"contact area {inner}, at load step {step.step}. A hardness above the "
        "first bears them without yielding, that is a yield strength of "
        f"{low} to {high} (hardness is 2.8 "
        "to 3 times the yield strength: Tabor 1951); for less, state micro.hardness"
    )


def energy_notes(steps: Sequence[LoadStep], *, conservative: bool = True) -> Iterator[str]:
    """Yield the energies at the last load step, and a warning where they are not balanced.

    Args:
        steps: The load steps.
        conservative: Whether the forces are the gradient of these energies. They are not where
            tractions displace the surface across: these store energy too, and friction loses some.
    """
    known = [step for step in steps if step.elastic_energy_mJ is not None]
    if not known:
        return
    last = known[-1]
    parts = {
        "elastic": last.elastic_energy_mJ or 0.0,
        "plastic work": last.plastic_work_mJ or None,
        "work of the plane": last.work_mJ,
    }
    shown = {name: one for name, one in parts.items() if one is not None}
    energies = quantities(shown.values(), "mJ")
    text = ", ".join(" ".join(pair) for pair in zip(shown, energies, strict=True))
    worn = "; the rest went with what has worn off" if last.slid_mm else ""
    yield f"energies at load step {last.step}: {text} (trapezoidal rule between load steps{worn})"
    missing = missing_energy(known) if conservative else 0.0
    if missing > BALANCE:
        yield Caution(
            f"warning: energies are not balanced: {percent(missing)} of the largest is missing "
            "between two load steps; finite slopes of steep surfaces may be the cause "
            "(micro.finite_slopes = false leaves them out)"
        )
