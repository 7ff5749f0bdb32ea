"""What conducts and what rubs at the interface: observers of conductance and of friction.

Conductances follow from the stiffness of the interface; friction adds tangential stiffness, or the
power that it takes, and what a report says of its limits.

Theory: docs/theory.md, sections 14 and 15.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from patchlaw.micro.half_space.error_probe import error_by_cells
from patchlaw.micro.transport import (
    conductance_per_area,
    gas_conductance,
    pair_conductivity,
    radiation_conductance,
    total_conductance,
)
from patchlaw.multiscale.laws.exported_law import Conducts
from patchlaw.multiscale.loading.load_step import LoadStep
from patchlaw.multiscale.models.coupling import Coupling
from patchlaw.multiscale.models.measured_errors.errors import shear_error_notes
from patchlaw.multiscale.observers.step_observers import Columns, StepObserver
from patchlaw.multiscale.results.history import History
from patchlaw.multiscale.scene.sections import ConductanceSection
from patchlaw.support import Array, InputError, on_root
from patchlaw.support.readable import (
    Caution,
    Detail,
    measured,
    number,
    percent,
    quantity,
    usual_unit,
)

_PER_AREA = {
    "thermal_conductance_W_per_K": "thermal_conductance_W_per_m2K",
    "electrical_conductance_S": "electrical_conductance_S_per_m2",
}
"""Names of the conductances of load steps, and of those per area of laws."""
_OF_GAS = 2.0
"""Error by the cells of what gas conducts, over that of what errs in proportion to their sides:
next to contacts gaps go with the distance to the power of 3/2. On 24 half-spaces of 24² to 48²
cells, 1 to 45 % in contact, the true error against four times as many a side was at most 2.6 × the
latter, with a temperature jump of 0.014 to 2.9 µm and sides of 1 mm."""
_OF_LAYERS = 0.9
"""Error of what a layer of gas as thick as the mean gap conducts, over that and x/(1 + x)^⅔, x the
open gap over the temperature jump M: beside contacts gaps go with the distance to the power of 3/2,
and the gas from M on there conducts as M^-⅓. On 56 periods of 256² cells, 2 to 43 % in contact, x
from 0.3 to 440, cells conducted 1.04 to 9.4 times as much as layers. That was at most 1.25 × this
error, half of it in the median; it was set on the first 28. Twice the layers for all x, the rule
before, was exceeded by more than 1.5 × on 10. On 12 other samples, of which 8 were no period and 8
three to eight times as long along one axis, 2 to 24 % in contact, x from 1.5 to 600, the true error
was at most 0.8 × this one; on 8 faces with laws of samples of another roughness (half the slope, or
without the long or the short waves) at most 1.4 ×."""

_WITHOUT_JUMP = (
    "; as no conductance.temperature_jump is stated (air at 1 bar: about 0.4 um), the most has no "
    "bound, and the gas no error"
)


def _conductivities(section: ConductanceSection) -> dict[str, float]:
    """Return the conductivities of the pair by name of the conductance [W/m/K or S/m]."""
    thermal, resistivity = section.conductivity, section.resistivity
    electrical = None if resistivity is None else [1.0 / one for one in resistivity]
    pairs = zip(_PER_AREA, (thermal, electrical), strict=True)
    return {name: pair_conductivity(given) for name, given in pairs if given is not None}


def conducts_of(coupling: Coupling) -> Conducts | None:
    """Return conductances per area at stiffnesses of laws; None where the scene asks for none.

    Args:
        coupling: The coupling.
    """
    section, modulus = coupling.scene.conductance, coupling.parts.materials.contact_modulus
    if section is None:
        return None
    known = _conductivities(section)

    def per_area(stiffness: Array) -> dict[str, Array]:
        return {
            _PER_AREA[name]: conductance_per_area(stiffness, modulus, conductivity)
            for name, conductivity in known.items()
        }

    return per_area


class ConductanceObserver(StepObserver):
    """Adds the conductances of contacts and gaps to load steps.

    They are those of the interface alone and follow from its stiffness.

    Args:
        coupling: What finds the load steps.
    """

    def __init__(self, coupling: Coupling) -> None:
        super().__init__(coupling)
        section = coupling.scene.conductance
        assert section is not None
        self._section = section
        self._unknown: dict[int, bool] = {}  # load steps, and whether all of the face touches there

    def observe(self, step: LoadStep, past: Sequence[LoadStep], *, last: bool) -> Columns:
        """Return the conductances."""
        coupling, modulus = self._coupling, self._coupling.parts.materials.contact_modulus
        stiffness = coupling.model.conducting_stiffness(step)
        if stiffness is None:
            return {}
        touches = step.contact_area_fraction >= 1.0  # a stiffness would be that of rounding
        if touches or not math.isfinite(stiffness):
            self._unknown[step.step] = touches
            return {}
        columns: dict[str, Any] = {
            name: total_conductance(stiffness, modulus, conductivity)
            for name, conductivity in _conductivities(self._section).items()
        }
        if "thermal_conductance_W_per_K" in columns:
            gap = columns["gap_conductance_W_per_K"] = self._of_gaps(step)
            columns["thermal_conductance_W_per_K"] += gap
            if self._checks(last) and not self._plastic_past(step, past):
                columns["gap_conductance_error_W_per_K"] = self._error_of_gas(step, gap)
        return columns

    def _error_of_gas(self, step: LoadStep, gap: float) -> float | None:
        """Return what gas conducts otherwise between finer cells [W/K]; None without cells.

        Most of it is next to contacts, where a gap of half a cell stands for those from nothing on.
        It is infinite where fewer cells have no solution. Laws know the least that it conducts.

        Args:
            step: The load step.
            gap: What the gaps conduct [W/K].
        """
        section, coupling = self._section, self._coupling
        if section.gas is None:
            return None
        if coupling.scene.by_laws:
            return self._error_of_layers(step, gap)
        gas, jump = section.gas, section.temperature_jump or 0.0
        what = f"error of the conductance of gaps at load step {step.step} not measured"
        try:
            maps = self._tried(what, lambda: [coupling.other_gap(step, n) for n in (2, 4)])
        except InputError:  # fewer cells of a period may have no gap left
            maps = None
        if maps is None:
            return math.inf

        def error() -> float | None:
            gaps = [one for one in (coupling.model.gaps, *maps) if one is not None]
            found = [gas_conductance(one, gas, jump) for one in gaps]
            return float(error_by_cells(*found)) if len(found) == 3 else None

        per_area = on_root(coupling.comm, error)
        return None if per_area is None else _OF_GAS * per_area * self._area / 1e6

    def _error_of_layers(self, step: LoadStep, gap: float) -> float:
        """Return what gas conducts between cells beyond layers as thick as the mean gap [W/K].

        Without a temperature jump it has no bound.

        Args:
            step: The load step.
            gap: What the layers conduct [W/K].
        """
        share, jump = step.contact_area_fraction, self._section.temperature_jump or 0.0
        if not gap or share >= 1.0:
            return 0.0
        if not jump:
            return math.inf
        over_jump = step.mean_separation_mm / (1.0 - share) / jump
        return _OF_LAYERS * gap * over_jump / (1.0 + over_jump) ** (2.0 / 3.0)

    def _of_gaps(self, step: LoadStep) -> float:
        """Return the conductance of gas and radiation outside of the contacts [W/K]."""
        section, share = self._section, step.contact_area_fraction
        jump, per_area = section.temperature_jump or 0.0, 0.0
        if (gas := section.gas) is not None:

            def through_gas() -> float:
                gaps = self._coupling.model.gaps
                if gaps is not None:
                    return gas_conductance(gaps, gas, jump)
                # laws know the mean gap: the mean of k/(g + M) is no less
                open_gap = step.mean_separation_mm / (1.0 - share) if share < 1.0 else 0.0
                return (1.0 - share) * gas_conductance(open_gap, gas, jump)

            per_area = on_root(self._coupling.comm, through_gas)
        if section.temperature is not None and section.emissivity is not None:
            radiation = radiation_conductance(section.temperature, section.emissivity)
            per_area += (1.0 - share) * radiation
        return per_area * self._area / 1e6  # from mm² to m²

    @property
    def _area(self) -> float:
        """Nominal area of the contact [mm²]."""
        face = self._coupling.model.face if self._coupling.parts.regions else None
        return self._coupling.parts.area if face is None else float(np.sum(face.areas))

    def notes(self, steps: Sequence[LoadStep]) -> Iterator[str]:
        """Yield what a report says of conductances."""
        for full, why in {
            True: "without bound, as the surfaces touch everywhere",
            False: "not found: the mean gap hardly closes, or a linear solution did not converge",
        }.items():
            numbers = [number for number, touches in self._unknown.items() if touches is full]
            if numbers:
                yield (
                    f"conductance at {len(numbers)} of {len(steps)} load steps, the last of them "
                    f"load step {numbers[-1]}: {why}"
                )
        known = [
            step
            for step in steps
            if (step.thermal_conductance_W_per_K, step.electrical_conductance_S) != (None, None)
        ]
        if known:
            yield (
                f"conductance at load step {known[-1].step}: {_conductances(known[-1])}; it is "
                "that of the interface alone and follows from its stiffness (Barber 2003); the "
                "bodies around it and oxide films are left out"
            )
            yield from self._gas_notes(known[-1])

    def _gas_notes(self, step: LoadStep) -> Iterator[str]:
        """Yield what is doubtful of the gas in the gaps."""
        section = self._section
        if section.gas is None or not 0.0 < step.contact_area_fraction < 1.0:
            return
        if self._coupling.scene.by_laws:
            yield (
                "gas in the gaps: laws know the mean gap, and a layer as thick as that is the "
                "least that the gas conducts (coupling.kind = 'concurrent' integrates over the "
                "gaps)" + _WITHOUT_JUMP * (not section.temperature_jump)
            )
        elif not section.temperature_jump:
            yield Caution(
                "warning: gaps close towards contacts, where the gas conducts without bound as "
                "no conductance.temperature_jump is stated: its conductance depends on the grid "
                "(air at 1 bar: about 0.4 um)"
            )


def _conductances(step: LoadStep) -> str:
    """Return the conductances of a load step that are known, in words."""
    parts = []
    if (thermal := step.thermal_conductance_W_per_K) is not None:
        gap = step.gap_conductance_W_per_K or 0.0
        whole = measured(thermal, step.thermal_conductance_error_W_per_K, "W/K", 5)
        name, size = usual_unit([thermal], "W/K")
        through = f", {number(gap / size, 4)} {name} of it through the gaps" if gap else ""
        parts.append(f"thermal {whole}{through}")
    if (electrical := step.electrical_conductance_S) is not None:
        error = step.electrical_conductance_error_S
        parts.append(f"electrical {measured(electrical, error, 'S', 5)}")
    return "; ".join(parts)


_SAME = 1e-9
"""Distance of two shears, relative to the largest, at which a loop counts as closed."""
_MUCH = 0.1
"""Neglected share of the shear force from which on a run warns of it."""


class FrictionObserver(StepObserver):
    """Adds tangential stiffness or power to load steps with friction; notes what is left out.

    Args:
        coupling: What finds the load steps, with friction.
    """

    _coupling: Any

    def __init__(self, coupling: Coupling) -> None:
        super().__init__(coupling)
        self._finds_stiffness = coupling.scene.output.contact != "none"

    def observe(self, step: LoadStep, past: Sequence[LoadStep], *, last: bool) -> Columns:
        """Return the tangential stiffness."""
        scene = self._coupling.scene
        if scene.loading.slides:
            return {"friction_power_W": self._power(step)}
        if not self._finds_stiffness:
            return {}
        found = self._coupling.model.tangential_stiffness()
        return {
            "tangential_stiffness_N_per_mm": found.value,
            "linear_iterations": step.linear_iterations + found.iterations,
        }

    def _power(self, step: LoadStep) -> float | None:
        """Return the power of faces that slide as wholes [W]; None where their speed is unknown."""
        scene, model = self._coupling.scene, self._coupling.model
        force, (own, *others) = step.force_N, scene.coefficients
        if others:
            each = np.array([own, *others]) * step.patches.pressure_MPa
            own, force = 1.0, float(each @ model.face.areas)
        speed = scene.friction.speed
        return None if speed is None else own * force * speed  # N m/s

    def notes(self, steps: Sequence[LoadStep]) -> Iterator[str]:
        """Yield what the last loop lost, and what friction leaves out."""
        if loop := last_loop(steps):
            yield loop
        by_laws = self._coupling.scene.rubs_on_mesh
        yield from self._law_notes() if by_laws else self._coupling_notes()
        yield from shear_error_notes(steps)

    def figures(self, history: History) -> Iterator[tuple[str, str, tuple[Any, ...]]]:
        """Yield what sticks and slips at the last recorded load step, and the loop of the shear."""
        contact = history.contact
        if contact is not None and contact.slipping is not None:
            yield "shear", "contact.shear_figure", (history, contact)
        elif self._coupling.made_model and (found := self._coupling.model.facet_shear()):
            yield "shear", "contact.face_shear_figure", (history, *found)

    def _coupling_notes(self) -> Iterator[str]:
        """Yield what cells leave out of shear: the body, and what pressures and tractions do."""
        coupling, friction = self._coupling, self._coupling.scene.friction
        beta = coupling.parts.materials.dundurs_beta
        if coupling.scene.loading.slides:
            yield (
                "friction: energy is lost as the faces slide as wholes, μ times pressure and "
                "distance; what their tractions do to the pressures is left out"
            )
            return
        if coupling.friction_is_coupled:
            yield "friction: pressures and tractions were solved in turn at every load step" + (
                ", as without (friction.coupled = false) the shear would differ by more than 10 %, "
                "or it is not known by how much" * (friction.coupled is None)
            )
        elif beta or coupling.scene.has_body:
            yield (
                f"friction after Goodman: that pressures pull the surface sideways and tractions "
                f"lift it (Dundurs' β = {number(beta, 3)}"
                f"{', and a finite body' * coupling.scene.has_body}) is left out; "
                "friction.coupled = true takes it into account"
            )
        else:
            yield "friction: two like bodies, whose pressures and tractions do not see each other"

    def _law_notes(self) -> Iterator[str]:
        """Yield how close the springs of laws are, and what they leave out."""
        table, beta = self._coupling.table, self._coupling.parts.materials.dundurs_beta
        laws = [law for law in table.laws if not law.is_flat] if table else []
        laws = [law for law in laws if len(law.springs)]
        beds = [law.springs for law in laws]
        if not beds:
            return
        fewest, most = min(map(len, beds)), max(map(len, beds))
        count = f"{most}" if fewest == most else f"{fewest} to {most}"
        off = max(law.springs.path_error(law.stiffness_ratio) for law in laws)
        yield Detail(
            f"friction of laws: {count} springs each, within {percent(off)} of the bound of "
            "friction on any path; shift and tangential stiffness are those of contact and body"
        )
        missed = max(bed.missed for bed in beds)
        if missed > _MUCH:
            yield Caution(
                f"friction of laws: a law whose stiffness falls is no bed of springs; they are "
                f"scaled by up to {percent(missed)} to bear its pressure, and partial slip is as "
                "uncertain"
            )
        if beta:
            yield (
                "friction of laws after Goodman: that pressures of single contacts pull the "
                f"surface sideways (Dundurs' β = {number(beta, 3)}) is left out; what pressures on "
                "the whole face do is part of the mesh"
            )


def last_loop(steps: Sequence[LoadStep]) -> str:
    """Return what the last closed loop of the shear lost; empty where there is none.

    The loss factor is the energy lost over 2π times ½ F s, with half the largest changes F of the
    force and s of the shift.

    Args:
        steps: The load steps.
    """
    sheared = [step for step in steps if step.shear_force_x_N is not None]
    if not sheared:
        return ""
    last, largest = sheared[-1], max(_size(_shift(step)) for step in sheared)

    def returns(step: LoadStep) -> bool:
        moved = _size(_shift(step) - _shift(last)) <= _SAME * largest
        return moved and abs(step.force_N - last.force_N) <= _SAME * last.force_N

    first = next((k for k in range(len(sheared) - 2, -1, -1) if returns(sheared[k])), None)
    if first is None:
        return ""
    loop = sheared[first:]
    force, shift = (
        0.5 * float(np.ptp([along(step) for step in loop], axis=0).max())
        for along in (_force, _shift)
    )
    if not (force and shift):
        return ""
    lost = (last.dissipated_mJ or 0.0) - (loop[0].dissipated_mJ or 0.0)
    factor = lost / (np.pi * force * shift)
    return (
        f"friction: the loop from load step {loop[0].step} to {last.step} loses "
        f"{quantity(lost, 'mJ', 4)}, with an amplitude of {quantity(shift, 'mm', 4)} and "
        f"{quantity(force, 'N', 4)}; loss factor {number(factor, 3)}"
    )


def _force(step: LoadStep) -> np.ndarray:
    return np.array([step.shear_force_x_N or 0.0, step.shear_force_y_N or 0.0])


def _shift(step: LoadStep) -> np.ndarray:
    return np.array([step.shear_x_mm or 0.0, step.shear_y_mm or 0.0])


def _size(pair: np.ndarray) -> float:
    return float(np.hypot(*pair))
