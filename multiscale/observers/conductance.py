"""Conductance of load steps and of laws, where a scene asks for it.

Theory: docs/theory.md, section 14.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from patchlaw.micro.transport import (
    conductance_per_area,
    gas_conductance,
    pair_conductivity,
    radiation_conductance,
    total_conductance,
)
from patchlaw.multiscale.laws.sampling import Conducts
from patchlaw.multiscale.loading.load_step import LoadStep
from patchlaw.multiscale.models.couplings.coupling import Coupling
from patchlaw.multiscale.observers.step_observers import Columns, StepObserver
from patchlaw.multiscale.readable import Caution, measured, number, usual_unit
from patchlaw.multiscale.scene.interface import ConductanceSection
from patchlaw.support.arrays import Array
from patchlaw.support.parallel import on_root

_PER_AREA = {
    "thermal_conductance_W_per_K": "thermal_conductance_W_per_m2K",
    "electrical_conductance_S": "electrical_conductance_S_per_m2",
}
"""Names of the conductances of load steps, and of those per area of laws."""


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
        return columns

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
        face = self._coupling.model.face if self._coupling.parts.regions else None
        area = self._coupling.parts.area if face is None else float(np.sum(face.areas))
        return per_area * area / 1e6  # from mm² to m²

    def notes(self, steps: Sequence[LoadStep]) -> Iterator[str]:
        """Yield what a report says of conductances."""
        section, with_laws = self._section, self._coupling.traits.has_laws
        for full, why in (
            (True, "without bound, as the surfaces touch everywhere"),
            (
                False,
                "not found: the mean gap hardly closes, or the linear solution did not converge",
            ),
        ):
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
        if not known:
            return
        step, parts = known[-1], []
        if (thermal := step.thermal_conductance_W_per_K) is not None:
            gap = step.gap_conductance_W_per_K or 0.0
            whole = measured(thermal, step.thermal_conductance_error_W_per_K, "W/K", 5)
            name, size = usual_unit([thermal], "W/K")
            through = f", {number(gap / size, 4)} {name} of it through the gaps" if gap else ""
            parts.append(f"thermal {whole}{through}")
        if (electrical := step.electrical_conductance_S) is not None:
            error = step.electrical_conductance_error_S
            parts.append(f"electrical {measured(electrical, error, 'S', 5)}")
        yield (
            f"conductance at load step {step.step}: {'; '.join(parts)}; it is that of the "
            "interface alone and follows from its stiffness (Barber 2003); the bodies around it "
            "and oxide films are left out"
        )
        if section.gas is None or not 0.0 < step.contact_area_fraction < 1.0:
            return
        if with_laws:
            yield (
                "gas in the gaps: laws know the mean gap, and a layer as thick as that is the "
                "least that the gas conducts (coupling.kind = 'concurrent' integrates over the "
                "gaps)"
            )
        elif not section.temperature_jump:
            yield Caution(
                "warning: gaps close towards contacts, where the gas conducts without bound as "
                "no conductance.temperature_jump is stated: its conductance depends on the grid "
                "(air at 1 bar: about 0.4 um)"
            )
