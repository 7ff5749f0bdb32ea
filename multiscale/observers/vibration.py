"""Natural modes about load steps, where a scene asks for them.

Theory: docs/theory.md, section 17.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from patchlaw.micro.half_space.error_probe import ZERO
from patchlaw.multiscale.loading.column import Mode, merged
from patchlaw.multiscale.loading.load_step import LoadStep
from patchlaw.multiscale.models.measured_errors.faces import (
    MOST_CHECKED_UNKNOWNS,
    OF_LINEAR,
    OF_QUADRATIC,
)
from patchlaw.multiscale.observers.step_observers import Columns, StepObserver
from patchlaw.multiscale.results.history import History
from patchlaw.support import Array, located
from patchlaw.support.readable import Caution, measured, number, quantity

_DRAWN = 6
"""Modes that are drawn."""
_PARTICIPATION = [f"participation_{axis}" for axis in "xyz"]


class _Seen(NamedTuple):
    """The vibration about the latest load step."""

    found: Any
    springs: Any
    rows: tuple[Mode, ...]
    surfaces: list[tuple[Array, Array]]


class VibrationObserver(StepObserver):
    """Adds natural modes to load steps, with the errors of their frequencies."""

    _coupling: Any
    _latest: _Seen | None = None
    _made: Any = None

    def observe(self, step: LoadStep, past: Sequence[LoadStep], *, last: bool) -> Columns:
        """Return the modes."""
        self._latest = None  # that of an earlier load step, where these are not found
        with self._coupling.clock.phase("vibration"):
            what = f"modes of load step {step.step} not found"
            rows = self._tried(what, lambda: self._modes(step, last=last))
        if not rows:
            return {}
        first = rows[0]
        return {
            "modes": rows,
            "first_frequency_Hz": first.frequency_Hz,
            "first_frequency_error_Hz": first.frequency_error_Hz,
            "least_damping_per_s": min(one.damping_per_s for one in rows),
        }

    def _modes(self, step: LoadStep, *, last: bool) -> tuple[Mode, ...]:
        """Solve for the modes about the latest load step; collective."""
        from patchlaw.macro.contact.face_vibration import FaceVibration, face_springs
        from patchlaw.macro.fields import surface_shapes

        scene, model = self._coupling.scene, self._coupling.model
        section = scene.vibration
        plane = None if section.plane == "held" else section.plane
        direction = None
        if section.sliding is not None:
            direction = np.array(section.sliding) / np.hypot(*section.sliding)
        mode, tangents = model.vibration_tangents(direction)
        if self._made is None:
            self._made = FaceVibration(model.face, mode, plane)
        with located(key="vibration.modes"):
            found, shares, moved = self._made.modes(tangents, section.modes)
        frequency = found.frequencies
        # the stiffness of rough contacts goes with their pressure, which under a force has no zero
        others = (one for cause, one in step.errors if not (step.by_force and cause == ZERO))
        uncertain = sum(map(abs, others)) / (step.force_N or 1.0)
        by_load = 0.5 * shares * frequency * uncertain
        by_elements = self._element_errors(tangents, frequency, plane, last=last)
        whole = by_load + frequency * found.residuals
        if by_elements is not None:
            whole = whole + by_elements
        columns = {
            "frequency_Hz": frequency,
            "frequency_error_Hz": whole if step.errors or by_elements is not None else None,
            "damping_per_s": found.damping,
            "contact_share": shares,
            **dict(zip(_PARTICIPATION, moved.T, strict=True)),
            "residual": found.residuals,
            "element_error_Hz": by_elements,
        }
        known = {name: values for name, values in columns.items() if values is not None}
        rows = tuple(
            Mode(mode=k, **dict(zip(known, map(float, row), strict=True)))
            for k, row in enumerate(zip(*known.values(), strict=True), 1)
        )
        surfaces = []
        if last:
            shown = found.shapes[:, :_DRAWN].real
            surfaces = [surface_shapes(*one) for one in self._made.by_body(shown)]
        springs = face_springs(model.face, mode, tangents)
        self._latest = _Seen(found, springs, rows, surfaces)
        return rows

    def _element_errors(
        self, tangents: Array, frequency: Array, plane: float | None, *, last: bool
    ) -> Array | None:
        """Return errors by the elements, from modes on linear or on quadratic ones (n,) [Hz]."""
        from patchlaw.macro.contact.face_vibration import FaceVibration
        from patchlaw.macro.contact.other_elements import bodies_of, face_on, quadratic_dofs

        check, face = self._coupling.scene.output.check, self._coupling.model.face
        if not (check == "all" or (check == "last" and last)):
            return None
        bodies = bodies_of(face)
        quadratic = max(body.degree for body in bodies) == 2
        if not quadratic and sum(map(quadratic_dofs, bodies)) > MOST_CHECKED_UNKNOWNS:
            return None

        def other(body: Any) -> Any:
            if quadratic:
                return body.linear if body.degree == 2 else body
            return body.as_quadratic()

        there = FaceVibration(face_on(face, other), self._made.mode, plane)
        if there.unknowns < len(frequency):
            return None  # linear elements of a coarse mesh have fewer modes
        found, *_ = there.modes(tangents, len(frequency))
        factor = OF_QUADRATIC if quadratic else OF_LINEAR
        return np.asarray(factor * abs(found.frequencies[: len(frequency)] - frequency))

    def notes(self, steps: Sequence[LoadStep]) -> Iterator[str]:
        """Yield the first modes, those that have merged, and what the errors leave out."""
        yield from super().notes(steps)
        known = [step for step in steps if step.modes]
        if not known:
            return
        step = known[-1]
        if self._latest is None and steps[-1].modes:
            yield Caution(
                f"vibration: the modes about load step {step.step} were found before this run was "
                "resumed, which keeps no shapes: it writes no modes.xdmf, contact_stiffness.* and "
                "vibration.png; a run from the start does"
            )
        first = ", ".join(
            measured(one.frequency_Hz, one.frequency_error_Hz, "Hz") for one in step.modes[:3]
        )
        yield f"vibration: the first modes about load step {step.step}: {first}"
        for one, other in merged(step.modes):
            yield Caution(
                f"vibration: modes {one.mode} and {other.mode} have merged at "
                f"{quantity(one.frequency_Hz, 'Hz', 4)}, and one of them grows by "
                f"{number(-one.damping_per_s, 3)} 1/s"
            )
        slides = self._coupling.scene.vibration.sliding is not None
        if slides and step.modes[0].frequency_error_Hz is not None:
            yield (
                "vibration: near merging the errors of frequencies are larger than stated, which "
                "are those of modes that stay apart"
            )
        if step.modes[0].element_error_Hz is None and step.errors:
            yield "vibration: the errors of frequencies leave out that of the elements"

    def results(self, step: LoadStep) -> Iterator[tuple[str, str]]:
        """Yield the frequencies of the first modes, and of those that grow."""
        for one in step.modes:
            grows = bool(one.damping_per_s < 0.0)
            if one.mode <= _DRAWN or grows:
                told = measured(one.frequency_Hz, one.frequency_error_Hz, "Hz")
                yield f"mode {one.mode}", told + f", grows by {-one.damping_per_s:.3g} 1/s" * grows

    def figures(self, history: History) -> Iterator[tuple[str, str, tuple[Any, ...]]]:
        """Yield the picture of the first modes about the last load step."""
        if self._latest is not None and self._latest.surfaces:
            rows = self._latest.rows[:_DRAWN]
            yield "vibration", "observed.modes_figure", (rows, self._latest.surfaces, history)

    def write_files(self, folder: Path) -> None:
        """Write the modes about the last load step, and the stiffness of its contact."""
        if self._latest is None:
            return
        from patchlaw.macro.fields import write_contact_stiffness, write_shapes

        found, springs, *_ = self._latest
        face = self._coupling.model.face
        write_shapes(folder / "modes.xdmf", face, found)
        if len(face.sides) == 1:
            sticks = self._coupling.scene.vibration.sliding is None
            for ending in ("mtx", "inp") if sticks else ("mtx",):
                write_contact_stiffness(folder / f"contact_stiffness.{ending}", springs, face.space)

    def release(self) -> None:
        """Let go of the matrices."""
        self._made = None
