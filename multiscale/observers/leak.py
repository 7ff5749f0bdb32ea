"""The leak at load steps: through the gaps of all cells, over a face, or from patch to patch.

The error of the grid is measured like that of the force: the contact and the flow through its gaps
are solved again on half and a quarter as many cells a side, under the same load. Channels close as
cells become coarser, so that most of the error is that of the gaps, not that of the flow through
them. Next to closing wider gaps tell it; see `multiscale.laws.transmissivity.error_of_grid`.

At every point of a face the law of samples tells the mean separation and, from their gaps under a
plane at that separation, the transmissivity. The flow over the face is two-dimensional. It is
solved again with each cause of its error varied, the steps of wear by what the mean gap errs by
them: the harmonic mean of a facet's points instead of their mean, gaps on half as many cells, the
transmissivity from half of its rows, and the mean of the samples as much too low as it may be.

Of consistent laws every patch has one transmissivity, that of its own gaps between walls. The flow
from patch to patch is that through the cells of a map. It lies beside that through the gaps of all
cells, which `coupling.kind = "concurrent"` finds: paths that cross the borders of patches elsewhere
than in the mean are not known.

Theory: docs/theory.md, section 16.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from patchlaw.micro.gap_cells import cell_network, turned
from patchlaw.micro.transport import GapFlow, gap_flows, widened_gap
from patchlaw.multiscale.laws.rows import CAUSES
from patchlaw.multiscale.laws.transmissivity import ROUGH, error_of_grid, next_to_closing
from patchlaw.multiscale.loading.column import WAYS, Leak
from patchlaw.multiscale.loading.load_step import LoadStep
from patchlaw.multiscale.models.coupling import Coupling
from patchlaw.multiscale.models.measured_errors.samples import mean_error
from patchlaw.multiscale.observers.step_observers import Columns, StepObserver
from patchlaw.support import Array, Indices, InputError, located, on_root_alone
from patchlaw.support.network import network_flow
from patchlaw.support.readable import (
    WHOLE,
    Caution,
    number,
    percent,
    quantity,
    usual,
    usual_unit,
    with_most,
)

if TYPE_CHECKING:  # finite elements are imported only by scenes that need them
    from patchlaw.macro.contact.face_leak import LeakingFace
    from patchlaw.multiscale.results.history import History

_AFTER_UNLOADING = (
    "the error of the leak after unloading is not measured: the plastic depth there is that of the "
    "load steps before"
)
_WEAR = "wear"
"""A cause of the error: the steps of wear."""
_UNCERTAIN = 0.3
"""Error over the leak from which on a report warns."""
_REMEDIES = {
    "mesh": "it varies within facets of the contact face, and may differ by {} (finer mesh there)",
    "grid": "on finer cells it may differ by {}, as channels are few cells wide (finer "
    "surface.grid)",
    "rows": "between the rows of its table it may differ by {}",
    "wear": "by the steps of wear it may differ by {} (load.sliding at more distances)",
    "samples": "between samples it differs by {} (more law.seeds, or larger samples)",
}
"""What is said of a leak that is not certain, by the cause of most of its error."""


class LeakObserver(StepObserver):
    """Adds what leaks to load steps and, where errors are measured, their error by cause.

    Args:
        coupling: What finds the load steps.

    Attributes:
        causes: Causes of the error.
    """

    causes: Sequence[str]
    unknown = ""
    """What the error does not hold, in words."""
    own_share = 1
    """Time that the leak takes over that of a cause of its error, roughly."""

    def __init__(self, coupling: Coupling) -> None:
        super().__init__(coupling)
        section = coupling.scene.leak
        assert section is not None
        self._section = section
        self._scale = section.drop / (12.0 * section.viscosity_MPa_s)
        self._by_wear = (_WEAR,) if coupling.scene.loading.slides else ()

    @abstractmethod
    def _leaks(self, step: LoadStep) -> tuple[Leak, ...]:
        """Return the leaks along all ways; collective."""

    @abstractmethod
    def _varied(self, step: LoadStep, cause: str) -> Sequence[float]:
        """Return their flow rates with a cause of their error varied; collective."""

    def observe(self, step: LoadStep, past: Sequence[LoadStep], *, last: bool) -> Columns:
        """Return the leaks."""
        with self._coupling.clock.phase("leak"):
            self._tell(0)
            leaks = self._leaks(step)
            if self._checks(last) and self._measures(step, past):
                leaks = self._with_errors(step, leaks)
        return {"leaks": leaks}

    def _tell(self, done: int) -> None:
        """Tell how much is done: the leak first, then each cause of its error."""
        parts = self.own_share + len(self.causes)
        solved = self.own_share + done - 1 if done else 0
        self._coupling.clock.tell("leak", WHOLE * solved // parts, WHOLE)

    def _measures(self, step: LoadStep, past: Sequence[LoadStep]) -> bool:
        """Tell whether the error of a load step can be measured; where it cannot be, note why."""
        if self._plastic_past(step, past):
            self._failures[_AFTER_UNLOADING] = None
            return False
        return True

    def _with_errors(self, step: LoadStep, leaks: tuple[Leak, ...]) -> tuple[Leak, ...]:
        """Return the leaks with their errors."""

        def each() -> dict[str, Sequence[float]]:
            found = {}
            for done, cause in enumerate(self.causes, 1):
                self._tell(done)
                found[cause] = self._varied(step, cause)
            return found

        varied = self._tried(f"error of the leak at load step {step.step} not measured", each)
        if varied is None:
            return leaks
        return tuple(
            one.with_errors({cause: abs(rates[k] - one.rate) for cause, rates in varied.items()})
            for k, one in enumerate(leaks)
        )

    def notes(self, steps: Sequence[LoadStep]) -> Iterator[str]:
        """Yield what a report says of the leak."""
        for way, name in WAYS.items():
            known = [(step.step, leak) for step in steps if (leak := step.leak(way)) is not None]
            if not known:
                continue
            number_of_last, last = known[-1]
            yield f"leak {name} at load step {number_of_last}: {_whole_text(last, self.unknown)}"
            closed = [step for step, leak in known if not leak.rate]
            if closed and len(closed) < len(known):
                yield (
                    f"the gap is closed {name} at {len(closed)} of {len(known)} load steps, first "
                    f"at load step {closed[0]}"
                )
            if last.causes and (last.error or 0.0) > _UNCERTAIN * abs(last.rate):
                cause, error = max(last.causes, key=lambda one: one[1])
                text = _REMEDIES[cause].format(*_as_the_leak(last, [error]))
                yield Caution(f"the leak {name} is uncertain: {text}")
        yield from super().notes(steps)

    def results(self, step: LoadStep) -> Iterator[tuple[str, str]]:
        """Yield the leak along every way."""
        for way, where in WAYS.items():
            if (leak := step.leak(way)) is not None:
                yield f"leak {where}", leak_text(leak)

    def figures(self, history: History) -> Iterator[tuple[str, str, tuple[Any, ...]]]:
        """Yield the flow at the last recorded load step, and the leak at all of them."""
        periodic = self._coupling.scene.surface.periodic
        about = history, history.contact, self._section, periodic, self.fluid
        yield "leak", "observed.leak_figure", about


class GapLeakObserver(LeakObserver):
    """Adds what leaks through the gaps of all cells."""

    own_share = 4

    def __init__(self, coupling: Coupling) -> None:
        super().__init__(coupling)
        self.causes = ["grid", *self._by_wear]
        self._latest: tuple[Leak, ...] = ()

    def _leaks(self, step: LoadStep) -> tuple[Leak, ...]:
        model, ways = self._coupling.model, self._section.directions
        self._latest = on_root_alone(
            self._coupling.comm, lambda: tuple(map(self._leak, ways, self._through(model.gaps)))
        )
        return self._latest

    def _varied(self, step: LoadStep, cause: str) -> Sequence[float]:
        def rates(gap: Array | None) -> Array:
            comm = self._coupling.comm
            return np.array(
                on_root_alone(comm, lambda: list(map(self._rate, self._through(gap, ROUGH))))
            )

        if cause == _WEAR:
            return list(rates(self._coupling.other_gap(step, worn=True)))
        half, quarter = (rates(self._coupling.other_gap(step, factor)) for factor in (2, 4))
        own, wider = np.array([one.rate for one in self._latest]), None
        if next_to_closing(own, half, quarter).any():
            gap, periodic = self._coupling.model.gaps, self._coupling.scene.surface.periodic
            wider = rates(None if gap is None else widened_gap(gap, periodic=periodic))
        return list(own + error_of_grid(own, half, quarter, wider))

    def _through(self, gap: Array | None, tolerance: float = 1e-7) -> list[GapFlow]:
        """Return the flows through a map of gaps; on one process."""
        assert gap is not None, "scenes whose coupling knows no gaps of cells are refused"
        axes = ["xy".index(way) for way in self._section.directions]
        lengths = self._coupling.parts.surface.lengths
        periodic = self._coupling.scene.surface.periodic
        return gap_flows(gap, lengths, axes=axes, periodic=periodic, tolerance=tolerance)

    def _rate(self, flow: GapFlow) -> float:
        return flow.rate(self._section.drop, self._section.viscosity_MPa_s)

    def _leak(self, way: str, flow: GapFlow) -> Leak:
        return Leak(
            way=way,
            rate=self._rate(flow),
            transmissivity=flow.transmissivity,
            flow_factor=flow.flow_factor if flow.gap.any() else None,
            constriction=flow.constriction.share if flow.constriction else None,
        )


def leak_text(leak: Leak) -> str:
    """Return a leak with its error, or that the gap is closed.

    Args:
        leak: The leak.
    """
    if not leak.rate:
        closed = "closed, nothing leaks"
        return f"{closed} (or up to {usual(leak.error, 'mm³/s', 2)})" if leak.error else closed
    name, size = usual_unit([leak.rate], "mm³/s")
    return f"{with_most(leak.rate / size, (leak.error or 0.0) / size, 4)} {name}"


def _as_the_leak(leak: Leak, errors: Iterable[float]) -> list[str]:
    """Return errors in the unit that a leak is shown in."""
    name, size = usual_unit([leak.rate], "mm³/s")
    return [f"{number(error / size, 2)} {name}" for error in errors]


def _whole_text(leak: Leak, unknown: str) -> str:
    text = leak_text(leak)
    if not leak.rate:
        return f"{text}: the surfaces touch everywhere along a line across the flow"
    if len(leak.causes) > 1:
        names, errors = zip(*leak.causes, strict=True)
        causes = zip(names, _as_the_leak(leak, errors), strict=True)
        text += f" ({', '.join(map(' '.join, causes))}{unknown and f'; {unknown}'})"
    if leak.hydraulic_gap is not None:
        text += f"; hydraulic gap {quantity(leak.hydraulic_gap, 'mm', 3)}"
    if leak.flow_factor is not None:
        text += f", flow factor {number(leak.flow_factor, 3)}"
    if leak.constriction is not None:
        text += f", {percent(leak.constriction)} of it through the channel of the narrowest "
        text += "constriction"
    return text


_MESH, _FINER = "mesh", 2.0
"""A cause of the error, and its part by linear elements over what cutting each into four changes:
4/3 where the fluid's pressure is smooth, more beside its corners."""
_ALIKE = 2.0
"""Ratio of the transmissivities along x and y from which on their axes need a statement."""
_ROUNDER = 4.0 / 3.0
"""What straight sides leave of a curved border, over what a node more on each of them changes."""


class FluidMap(NamedTuple):
    """The fluid on the triangles of a contact face.

    Attributes:
        triangles: Corners of the triangles in the frame of the face, shape (n, 3, 2) [mm].
        pressure_MPa: Fluid pressures at the corners, NaN where no fluid comes, (n, 3) [MPa].
        leaving_mm3_per_s: Part of the flow rate that leaves from each triangle, (n,) [mm³/s].
    """

    triangles: Array
    pressure_MPa: Array
    leaving_mm3_per_s: Array


class FaceLeakObserver(LeakObserver):
    """Adds what leaks over the contact face to load steps.

    Args:
        coupling: What finds the load steps, with laws of samples on a mesh.

    Raises:
        InputError: When the body has no such faces, or they share no edge with the contact face.

    Note:
        Everything is collective.
    """

    def __init__(self, coupling: Any) -> None:
        super().__init__(coupling)
        self._known: tuple[int, Any] | None = None
        first = coupling.bodies.first
        assert first is not None, "scenes without a body on a mesh are refused"
        tagged = first.body.mesh
        with located(coupling.scene.file):
            tags = [
                tagged.facet_tag(getattr(self._section, key), key=f"leak.{key}")
                for key in ("inlet", "outlet")
            ]
        edges = tuple(tagged.facet_tags.find(tag) for tag in tags)
        self._face = self._leaking(edges)  # refuses edges that do not fit before all else
        self._errors = [mean_error(region.surfaces, 2) for region in coupling.parts.samples]
        causes = [one for one in CAUSES if one != "samples" or any(self._errors)]
        self.causes = [_MESH, *causes, *self._by_wear]
        if not all(self._errors):
            alone = zip(coupling.parts.samples, self._errors, strict=True)
            names = ", ".join(region.name for region, error in alone if not error)
            self.unknown = f"what other samples than the one of {names} would change is not known"
        coupling.further_fields.append(self.fluid_pressure)

    def _leaking(self, edges: tuple[Indices, ...]) -> LeakingFace:
        """Return the contact face with the facets of inlet and outlet."""
        from patchlaw.macro.contact.face_leak import LeakingFace

        whole, law = self._coupling.bodies.contact_face, self._coupling.scene.law
        first, axes = whole.sides[0], law.axes or "x"
        where: Any = (first.space.mesh, first.facets, first.quadrature, edges, whole.on_both)
        with located(self._coupling.scene.file, "leak"):
            return LeakingFace(*where, axes=axes, centre=law.centre)

    def observe(self, step: LoadStep, past: Sequence[LoadStep], *, last: bool) -> Columns:
        """Return the leak, and what of it leaves from each region."""
        columns, flow = super().observe(step, past, last=last), self._flow_at(step)
        leaving = self._face.leaving_from(flow, len(self._errors)) * self._scale
        return {**columns, "patches": replace(step.patches, leak_mm3_per_s=leaving)}

    def _leaks(self, step: LoadStep) -> tuple[Leak, ...]:
        return (Leak(way="face", rate=self._scale * self._flow_at(step).total),)

    def _varied(self, step: LoadStep, cause: str) -> Sequence[float]:
        if cause != _MESH:
            return [self._scale * self._face.flow(self._at_points(cause)).total]
        face, points, own = self._face, self._at_points(None), self._flow_at(step).total
        in_series = face.flow(points, harmonic=True).total
        finer = face.flow(points, quartered=True).total
        bent = face.most_bent
        rounder = face.flow(points, quartered=True, bent=bent).total
        off = abs(in_series - own) + _FINER * abs(finer - own)
        off += _ROUNDER * abs(rounder - finer) / bent
        return [self._scale * (own + off)]

    def fluid_pressure(self, step: LoadStep) -> Any:
        """Return the fluid pressure at a load step just solved, as a function on the mesh [MPa]."""
        flow = self._flow_at(step)
        return self._face.pressure(flow, *self._section.pressures, "fluid_pressure")

    def notes(self, steps: Sequence[LoadStep]) -> Iterator[str]:
        """Yield what a report says of the leak, and of axes that it depends on unstated."""
        yield from super().notes(steps)
        table = self._coupling.table
        if not steps or table is None or self._coupling.scene.law.axes is not None:
            return
        at = np.array([steps[-1].mean_separation_mm])
        for region, law in zip(self._coupling.parts.samples, table.laws, strict=True):
            flow = law.transmissivity
            (both,) = np.ones((1, 2)) if flow is None else flow.at(at)
            if both.max() > _ALIKE * both.min():
                more, less = "yx" if both[1] > both[0] else "xy"
                said = f"fluid flows along {more} of samples alone"
                if both.min():
                    ratio = number(both.max() / both.min(), 2)
                    said = (
                        f"the transmissivity along {more} of samples is {ratio} times that along "
                        f"{less}"
                    )
                yield Caution(
                    f"{region.name}: {said}, and lies along {more} of the face; state law.axes: "
                    "'polar' where the lay follows a turned face, else 'x'"
                )

    @property
    def fluid(self) -> FluidMap | None:
        """The fluid on the face at the load step solved last; None before the first."""
        if self._known is None:
            return None
        section, flow = self._section, self._known[1]
        return FluidMap(
            triangles=self._face.triangles,
            pressure_MPa=section.pressures[1] + flow.pressure * section.drop,
            leaving_mm3_per_s=flow.leaving * self._scale,
        )

    def _flow_at(self, step: LoadStep) -> Any:
        """Return the flow at the load step solved last, solved once."""
        known = self._known
        if known is not None and known[0] == step.step:
            return known[1]
        flow = self._face.flow(self._at_points(None))
        if known is None or known[0] < step.step:  # fields of earlier load steps are made again
            self._known = step.step, flow
        return flow

    def _at_points(self, cause: str | None) -> Array:
        """Return the transmissivities at this rank's points of the face, shape (n, 2) [mm³]."""
        model: Any = self._coupling.model
        values = model.point_transmissivities(cause, self._errors)
        return np.asarray(model.face.on_first(values))


_LEAST_CELLS = 4
"""Cells of a patch along a side, of which half are tried too."""


class PatchLeakObserver(LeakObserver):
    """Adds what leaks from patch to patch.

    Args:
        coupling: What finds the load steps, with consistent laws.

    Raises:
        InputError: When patches have too few cells.
    """

    def __init__(self, coupling: Coupling) -> None:
        super().__init__(coupling)
        self.causes = ["grid", "rows", *self._by_wear]
        cells = coupling.parts.cells or coupling.parts.surface.grid
        most = tuple(count // _LEAST_CELLS for count in cells)
        if np.greater(coupling.parts.patches.grid, most).any():
            raise InputError(
                f"leaves patches fewer than {_LEAST_CELLS} cells a side, too few for a leak",
                key="patches.grid",
                value=list(coupling.parts.patches.grid),
                allowed=f"{most[0]} × {most[1]} at most",
                file=coupling.scene.file,
            )

    def _leaks(self, step: LoadStep) -> tuple[Leak, ...]:
        patches, leaks = self._coupling.parts.patches, []
        for way, total in zip(self._section.directions, self._totals(step, None), strict=True):
            axis = "xy".index(way)
            cubed = total * patches.lengths[axis] / patches.lengths[1 - axis]
            factor = cubed / step.mean_separation_mm**3 if step.mean_separation_mm else None
            rate = self._scale * total
            leaks.append(Leak(way=way, rate=rate, transmissivity=cubed, flow_factor=factor))
        return tuple(leaks)

    def _varied(self, step: LoadStep, cause: str) -> Sequence[float]:
        return [self._scale * total for total in self._totals(step, cause)]

    def _totals(self, step: LoadStep, cause: str | None) -> list[float]:
        """Return the flows along all ways, with a cause of their error varied [mm³]; collective."""
        coupling: Any = self._coupling
        wider = 0.0
        if cause == _WEAR:
            cause, wider = None, coupling.errors_of_wear(step)[3]

        def solve() -> list[float]:
            through = coupling.model.transmissivities(step, cause, wider)
            return [self._total(through, "xy".index(way)) for way in self._section.directions]

        return on_root_alone(self._coupling.comm, solve)

    def _total(self, transmissivity: Array, axis: int) -> float:
        """Return the flow through patches of T along x and y, shape (N, 2) [mm³]."""
        patches = self._coupling.parts.patches
        maps = (transmissivity[:, k].reshape(patches.grid) for k in (axis, 1 - axis))
        (along, lengths), (across, _) = (turned(one, patches.lengths, axis) for one in maps)
        return network_flow(cell_network(along, lengths, across=across)).total

    def notes(self, steps: Sequence[LoadStep]) -> Iterator[str]:
        """Yield what a report says of the leak, and of patches in its place."""
        yield from super().notes(steps)
        if steps:
            count = self._coupling.parts.patches.count
            yield (
                f"the leak is that through {count} patches of one transmissivity each; "
                "coupling.kind = 'concurrent' finds that through all gaps"
            )
