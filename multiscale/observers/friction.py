"""What friction adds to load steps: tangential stiffness, and what a report says of its limits.

Theory: docs/theory.md, section 15.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from patchlaw.multiscale.loading.load_step import LoadStep
from patchlaw.multiscale.models.coupling import Coupling
from patchlaw.multiscale.models.measured_errors.errors import shear_error_notes
from patchlaw.multiscale.observers.step_observers import Columns, StepObserver
from patchlaw.multiscale.readable import Caution, Detail, number, percent, quantity
from patchlaw.multiscale.results.history import History

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
        if scene.loading.slides and not scene.rubs_on_mesh:
            power = None
            if scene.friction.speed is not None:  # N m/s
                power = scene.friction.coefficient * step.force_N * scene.friction.speed
            return {"friction_power_W": power}
        if not self._finds_stiffness:
            return {}
        found = self._coupling.model.tangential_stiffness()
        return {
            "tangential_stiffness_N_per_mm": found.value,
            "linear_iterations": step.linear_iterations + found.iterations,
        }

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
