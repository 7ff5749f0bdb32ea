"""Conductance of load steps and of laws, where a scene asks for it.

Theory: docs/theory.md, section 14.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from micro.conductance import (
    conductance_per_area,
    gas_conductance,
    pair_conductivity,
    radiation_conductance,
    total_conductance,
)
from multiscale.couplings.contact import ContactCoupling
from multiscale.couplings.law_couplings import EmbeddedCoupling
from multiscale.exports.sampling import Conducts
from multiscale.loading.load_step import LoadStep
from multiscale.loading.stepper import Coupling
from multiscale.readable import Caution, quantity
from multiscale.scene.conductance_section import ConductanceSection
from multiscale.setup.problem import ProblemSetup

Array = NDArray[np.float64]

_MM2_PER_M2 = 1e6


@dataclass(frozen=True, kw_only=True, eq=False)
class Conductances:
    """Turns interfacial stiffnesses of a scene into conductances.

    Args:
        modulus: E* of the pair of materials [MPa].
        areas: Nominal areas of the patches or regions, shape (N,) [mm²].
        section: What the scene asks for.
    """

    modulus: float
    areas: Array
    section: ConductanceSection

    @classmethod
    def of(
        cls, setup: ProblemSetup, section: ConductanceSection, areas: Array | None = None
    ) -> Self:
        """Return that of a problem.

        Args:
            setup: The problem.
            section: What its scene asks for.
            areas: Areas of regions, where the laws are those of samples [mm²].
        """
        if areas is None:
            areas = np.full(setup.patches.count, setup.patches.area)
        return cls(modulus=setup.materials.contact_modulus, areas=areas, section=section)

    @property
    def thermal(self) -> float | None:
        """Conductivity of the pair [W/m/K]; None where it is not about heat."""
        given = self.section.conductivity
        return None if given is None else pair_conductivity(given)

    @property
    def electrical(self) -> float | None:
        """Electrical conductivity of the pair [S/m]; None where it is not about currents."""
        given = self.section.resistivity
        return None if given is None else pair_conductivity([1.0 / one for one in given])

    def per_area(self, stiffness: Array) -> dict[str, Array]:
        """Return conductances per area by column name, of the contacts alone.

        Args:
            stiffness: Stiffnesses dp/dc of laws, of any shape [MPa/mm].
        """
        names = "thermal_conductance_W_per_m2K", "electrical_conductance_S_per_m2"
        known = zip(names, (self.thermal, self.electrical), strict=True)
        return {
            name: conductance_per_area(stiffness, self.modulus, k)
            for name, k in known
            if k is not None
        }

    def with_conductance(self, step: LoadStep, coupling: Coupling) -> LoadStep:
        """Return a load step with the conductances of its contacts and gaps.

        Without laws they are those of all contacts together on half-spaces, by one more linear
        solution. With laws they are the sums over the patches, side by side.

        Args:
            step: The load step accepted last.
            coupling: What found it.

        Note:
            Collective.
        """
        if isinstance(coupling, ContactCoupling):
            stiffness = coupling.interface_stiffness()
        elif step.patches.stiffness_MPa_per_mm is not None:
            stiffness = float(step.patches.stiffness_MPa_per_mm @ self.areas)
        else:
            return step
        found: dict[str, Any] = {}
        if self.thermal is not None:
            gap = self._gap(step, coupling)
            found["gap_conductance_W_per_K"] = gap
            contacts = total_conductance(stiffness, self.modulus, self.thermal)
            found["thermal_conductance_W_per_K"] = contacts + gap
        if self.electrical is not None:
            conductance = total_conductance(stiffness, self.modulus, self.electrical)
            found["electrical_conductance_S"] = conductance
        return replace(step, **found)

    def _gap(self, step: LoadStep, coupling: Coupling) -> float:
        """Return the conductance of gas and radiation outside of the contacts [W/K]."""
        section, found = self.section, 0.0
        gas, jump, share = section.gas, section.temperature_jump or 0.0, step.contact_area_fraction
        if gas is not None and isinstance(coupling, ContactCoupling):
            found = coupling.over_gaps(lambda gap: gas_conductance(gap, gas, jump))
        elif gas is not None:  # laws know the mean gap: the mean of k/(g + M) is no less
            open_gap = step.mean_separation_mm / (1.0 - share) if share < 1.0 else 0.0
            found = (1.0 - share) * gas_conductance(open_gap, gas, jump)
        if section.temperature is not None and section.emissivity is not None:
            found += (1.0 - share) * radiation_conductance(section.temperature, section.emissivity)
        return found * float(self.areas.sum()) / _MM2_PER_M2


def conducting(step: LoadStep, coupling: Coupling, setup: ProblemSetup) -> LoadStep:
    """Return a load step with its conductances, if its scene asks for any.

    Args:
        step: The load step accepted last.
        coupling: What found it.
        setup: The problem.

    Note:
        Collective.
    """
    section, areas = setup.scene.conductance, None
    if section is None:
        return step
    if setup.samples and isinstance(coupling, EmbeddedCoupling):
        areas = coupling.face.areas
    return Conductances.of(setup, section, areas).with_conductance(step, coupling)


def conducts_of(setup: ProblemSetup) -> Conducts | None:
    """Return conductances per area at stiffnesses of laws; None where the scene asks for none.

    Args:
        setup: The problem.
    """
    section = setup.scene.conductance
    return None if section is None else Conductances.of(setup, section).per_area


def conductance_notes(
    steps: Sequence[LoadStep], section: ConductanceSection, *, with_laws: bool
) -> Iterator[str]:
    """Yield what a report says of conductances.

    Args:
        steps: The load steps.
        section: What the scene asks for.
        with_laws: Whether patch laws stand for the contacts.
    """
    known = [
        step
        for step in steps
        if (step.thermal_conductance_W_per_K, step.electrical_conductance_S) != (None, None)
    ]
    if not known:
        return
    step, parts = known[-1], []
    if step.thermal_conductance_W_per_K is not None:
        gap = step.gap_conductance_W_per_K or 0.0
        through = f", {quantity(gap, 'W/K')} of it through the gaps" if gap else ""
        parts.append(f"thermal {quantity(step.thermal_conductance_W_per_K, 'W/K', 5)}{through}")
    if step.electrical_conductance_S is not None:
        parts.append(f"electrical {quantity(step.electrical_conductance_S, 'S', 5)}")
    what = (
        "the sum over patches or regions side by side, without what the bodies add"
        if with_laws
        else "that of all contacts between half-spaces"
    )
    yield (
        f"conductance at load step {step.step}: {'; '.join(parts)}; it is {what}, for which it "
        "follows exactly from the stiffness (Barber 2003); finite bodies and oxide films are left "
        "out"
    )
    if section.gas is None or not step.contact_area_fraction:
        return
    if with_laws:
        yield (
            "gas in the gaps: laws know the mean gap, and a layer as thick as that is the least "
            "that the gas conducts (coupling.kind = 'concurrent' integrates over the gaps)"
        )
    elif not section.temperature_jump:
        yield Caution(
            "warning: gaps close towards contacts, where the gas conducts without bound as no "
            "conductance.temperature_jump is stated: its conductance depends on the grid (air at "
            "1 bar: about 0.4 um)"
        )
