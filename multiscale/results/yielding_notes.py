"""What a report says of yielding, of the pressures of elastic contacts, and of energies.

Theory: docs/theory.md, section 14.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from multiscale.loading.energy import BALANCE, missing_energy
from multiscale.loading.load_step import LoadStep
from multiscale.readable import Caution, number, percent, quantity


def yielding_notes(steps: Sequence[LoadStep], hardness: float | None) -> Iterator[str]:
    """Yield what has yielded or, of elastic contacts, what would bear their pressures.

    Args:
        steps: The load steps.
        hardness: Largest contact pressure [MPa]; None for elastic contacts.
    """
    if hardness is None:
        yield from _strength_notes(steps)
        return
    known = [step for step in steps if step.plastic_depth_mm is not None]
    if not known:
        yield (
            f"hardness {quantity(hardness, 'MPa')}: the laws are those of rising loads; no plastic "
            "depth stands behind them"
        )
        return
    last = known[-1]
    volume = (last.plastic_work_mJ or 0.0) / hardness
    most = max(known, key=lambda step: step.yielding_area_fraction or 0.0)
    depth = quantity(last.plastic_depth_mm or 0.0, "mm")
    yield (
        f"hardness {quantity(hardness, 'MPa')}: after load step {last.step} a plastic volume of "
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
    least, most = 2.8, 3.0  # hardness over yield strength of metals, Tabor 1951, ch. 3
    yield (
        f"elastic contacts: pressures up to {quantity(peak, 'MPa', 3)}, in the mean of the real "
        f"contact area {quantity(mean, 'MPa', 3)}, at load step {step.step}. A hardness above the "
        "first bears them without yielding, that is a yield strength of "
        f"{quantity(peak / most, 'MPa', 3)} to {quantity(peak / least, 'MPa', 3)} (hardness is 2.8 "
        "to 3 times the yield strength: Tabor 1951); for less, state micro.hardness"
    )


def energy_notes(steps: Sequence[LoadStep]) -> Iterator[str]:
    """Yield the energies at the last load step, and a warning where they are not balanced.

    Args:
        steps: The load steps.
    """
    known = [step for step in steps if step.elastic_energy_mJ is not None]
    if not known:
        return
    last, elastic = known[-1], known[-1].elastic_energy_mJ or 0.0
    plastic = (
        f", plastic work {quantity(last.plastic_work_mJ, 'mJ')}" if last.plastic_work_mJ else ""
    )
    work = "" if last.work_mJ is None else f", work of the plane {quantity(last.work_mJ, 'mJ')}"
    yield (
        f"energies at load step {last.step}: elastic {quantity(elastic, 'mJ')}{plastic}"
        f"{work} (trapezoidal rule between load steps)"
    )
    missing = missing_energy(known)
    if missing > BALANCE:
        yield Caution(
            f"warning: energies are not balanced: {percent(missing)} of the largest is missing "
            "between two load steps; finite slopes of steep surfaces may be the cause "
            "(micro.finite_slopes = false leaves them out)"
        )
