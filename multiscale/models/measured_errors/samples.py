"""What samples of laws err by: their cells, finite slopes, scatter and edges, told in the run.

The cells and the finite slopes of samples are judged as those of any contact problem, by
`micro.half_space.error_probe`, at the closure whose pressure is next to that of every region. The
relative errors fall as pressures rise: they are kept up to twice the pressure. The scatter among
samples gives the error of their mean that is not exceeded in 19 of 20 sets of as many samples, by
Student's t.

Theory: docs/theory.md, section 13.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
import scipy

from patchlaw.geometry import Control, Surface
from patchlaw.geometry.contact_state import ContactState
from patchlaw.micro import FiniteSlopes, FrictionModel, HalfSpaceModel
from patchlaw.micro.boundary_elements.finite_slopes import SLOPES
from patchlaw.micro.half_space.error_probe import ErrorProbe, error_by_cells, read, stated
from patchlaw.multiscale.bodies.bodies import on_body
from patchlaw.multiscale.laws.law_table import LawTable
from patchlaw.multiscale.laws.patch_law import PatchLaw
from patchlaw.multiscale.laws.refinement import LEAST_LOAD
from patchlaw.multiscale.models.measured_errors.edges import edge_width
from patchlaw.multiscale.scene.surfaces import RegionSamples
from patchlaw.support import Array, InputError, NotConverged, shared
from patchlaw.support.readable import WHOLE, ProgressObserver, unobserved

_SHARE = 0.975
"""Share of sets of samples whose mean lies less than the stated error too low, or too high."""
_KNOWN = 13
"""Numbers that a sample on its cells tells: two errors of the force, the width at edges, the force;
errors of what is read off by cells and by slopes, three each; what is read off under the mean
pressure. Of gaps they are over that of the law."""
_ROUNDED, _OF_EDGES = 1.001, 1.25
"""Ratios of pressures that samples and their edges are solved under. Errors jump where one cell
more is touched: that of the area of a worn contact was 12 to 15 % less with 1.005, 1.05 and 1.2
than with 1.001, 1.002, 1.02 and none. Widths at edges change by less than their own square root of
the pressure."""
KEPT = 2.0
"""Ratio of loads up to which relative errors of rough contacts are kept as loads rise. On 50
periodic surfaces under eight loads those by the grid held in 97 % (force), 98 % (area) and 100 %
(gap) within 1.5 ×, measured at every load in 99.5, 99.8 and 100 %; in the median they are as much.
"""
NEAR = 1.01
"""Ratio of loads that count as one, which errors are kept to as loads fall."""
_RESIDUAL = 1e-5
"""Residual of the contacts of samples whose errors are measured, as of those that tell these."""
_LEAST_SEPARATION = 1e-3
"""Separation at which samples near full contact are judged, over that at zero closure."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SampleCells:
    """Half-space models of samples, and what else is solved on their cells.

    Args:
        model: The periodic half-space of one of the samples.
        finite_slopes: Whether finite slopes of the samples count.
        has_edges: Whether the contact face ends at free edges.

    Attributes:
        ends: By what tells cells from others, the last two ends of paths in shear that were gone on
            them, each with the way to it.
        forces: Forces of samples at approaches without shear, by region, sample and approach [N].
    """

    model: HalfSpaceModel
    finite_slopes: bool
    has_edges: bool
    ends: dict[Hashable, list[tuple[list[Control], Any]]] = field(default_factory=dict, init=False)
    forces: dict[Hashable, float] = field(default_factory=dict, init=False)

    def model_of(self, region: RegionSamples, sample: Surface) -> HalfSpaceModel:
        """Return the periodic model of a sample, with the slopes of its bodies where they count.

        Args:
            region: The samples of its region.
            sample: The sample.
        """
        model = self._flat_model(region, sample)
        if not self.finite_slopes:
            return model
        sides = region.sides_of(sample)
        return replace(model, slopes=tuple(FiniteSlopes(*one, periodic=True) for one in sides))

    def _flat_model(self, region: RegionSamples, sample: Surface) -> HalfSpaceModel:
        modulus = region.materials.contact_modulus
        model = replace(self.model, surface=sample, contact_modulus=modulus)
        return replace(model, hardness=region.hardness)

    def friction_of(self, region: RegionSamples, sample: Surface) -> FrictionModel:
        """Return the friction of a sample's cells, whose pressures and tractions see each other.

        Args:
            region: The samples of its region.
            sample: The sample.
        """
        return FrictionModel(
            materials=region.materials,
            coefficient=region.coefficient,
            spacing=sample.spacing,
            periodic=True,
            coupled=True,
        )

    def probe_of(self, region: RegionSamples, sample: Surface) -> ErrorProbe:
        """Return what measures the errors of a contact of one sample.

        Args:
            region: The samples of its region.
            sample: The sample.
        """
        return ErrorProbe(
            model=self._flat_model(region, sample),
            on_body=on_body(None, region.materials, region.above_of(sample)),
            order=SLOPES if self.finite_slopes else 0,
        )

    def edge_width_of(
        self, region: RegionSamples, sample: Surface, law: PatchLaw, closure: float
    ) -> float:
        """Return the width along the edges of the face that the law of a sample errs by [mm].

        Args:
            region: The samples of its region.
            sample: The sample.
            law: The law.
            closure: Its closure, at which it bears something [mm].
        """
        if not self.has_edges:
            return 0.0
        model, at = self._flat_model(region, sample), _rounded(law, closure, _OF_EDGES)
        try:
            return edge_width(model, law, at, region.materials.first)
        except NotConverged:
            return math.inf


@dataclass(frozen=True, kw_only=True, eq=False)
class SampleProbe:
    """Tells what samples of laws on their cells err by.

    Args:
        table: The laws of the regions.
        samples: Their samples.
        cells: The contact problems on the cells of these.
        told: What earlier load steps told, see `Coupling.told`: what it is of, the load there, and
            the values.
        coarser: By the id of a worn sample those that wore on half and on a quarter of its cells.
        tell: Told how many of the samples are done, in percent.
        comm: MPI communicator; None for this process alone.
    """

    table: LawTable
    samples: Sequence[RegionSamples]
    cells: SampleCells
    told: list[tuple[Hashable, float, Array]] = field(default_factory=list)
    coarser: Mapping[int, Sequence[Surface]] = field(default_factory=dict)
    tell: ProgressObserver = unobserved
    comm: Any = None

    def recalled(self, of: Hashable, load: float, rise: float, fall: float) -> Array | None:
        """Return what was told at the nearest load of the same; None where none is near.

        Args:
            of: What it was told of.
            load: The load.
            rise: How many times the load there it is at most.
            fall: How many times the load it is there at most.
        """
        known = [
            (max(load / at, at / load), values)
            for one, at, values in self.told
            if one == of and load / rise <= at <= load * fall
        ]
        return min(known, key=operator.itemgetter(0))[1] if known else None

    def tell_later(self, of: Hashable, load: float, values: Array) -> None:
        """Keep values for later load steps, unless some are not known; see `recalled`."""
        if np.isfinite(values).all():
            self.told.append((of, load, values))

    def of_cells(
        self, closures: Array, forces: Array, factors: Array
    ) -> tuple[Array, dict[str, Array]]:
        """Return what samples on their cells err by.

        Args:
            closures: Mean closures of the regions, weighted by pressure, shape (regions,) [mm].
            forces: Forces on them [N].
            factors: Errors of means of samples over the scatter among them, shape (regions,).

        Returns:
            Relative errors of the force by cells and by finite slopes, and widths at edges, shape
            (3, regions); and by cause errors of area, mean gap and stiffness under the force, the
            first and last relative, shape (3,), weighted by forces.
        """
        sums, whole = np.zeros((4, len(self.samples))), float(forces.sum())
        of_regions = {cause: np.zeros(3) for cause in ("grid", "slopes", "samples")}
        laws, known = self.table.laws, dict[int, Array]()
        places = [_rounded(law, at) for law, at in zip(laws, closures, strict=True)]
        loads = [float(law.pressure(at)) for law, at in zip(laws, places, strict=True)]
        # as samples wear, their laws begin later, at the same separation
        names = [("cells", one, law.first_touch) for one, law in enumerate(laws)]
        for number in np.flatnonzero(forces > 0.0).tolist():
            before = self.recalled(names[number], loads[number], KEPT * NEAR, NEAR)
            if before is not None:
                known[number] = before
        unknown = [force > 0.0 and one not in known for one, force in enumerate(forces)]
        tell = partial(self._told_by, closures=places)
        for number, own, _ in self.of_regions("check of samples", tell, unknown):
            known[number] = own
            self.tell_later(names[number], loads[number], own)
        for number, own in known.items():
            areas = np.array([sample.area for sample in self.samples[number].surfaces])
            sums[:, number] = own[:, :4].sum(axis=0)
            gap = _gap(laws[number], closures[number])
            part = forces[number] / whole * np.array([1.0, gap, 1.0])
            weights = own[:, 3] / (own[:, 3].sum() or 1.0)
            of_regions["grid"] += part * (weights @ own[:, 4:7])
            of_regions["slopes"] += part * (weights @ own[:, 7:10])
            of_regions["samples"] += part * factors[number] * _scatter(areas, own[:, 10:])
        means = np.divide(sums[:2], sums[3], out=np.zeros_like(sums[:2]), where=sums[3] > 0.0)
        return np.array([*means, sums[2]]), of_regions

    def of_regions(
        self, what: str, tell: Callable[[int, Surface], Array], some: Sequence[Any]
    ) -> Iterator[tuple[int, Array, Array]]:
        """Yield what is told of the samples of a region, and their areas [mm²]; collective.

        Args:
            what: Name of what is told, for whom follows the progress.
            tell: Tells it of one of the samples of a region, by the number of the region.
            some: Which regions it is told of.

        Returns:
            The numbers of these regions, what is told of each of their samples, and the areas.
        """
        samples = self.samples
        tasks = [(k, one) for k, of in enumerate(samples) if some[k] for one in of.surfaces]

        def observe(done: int) -> None:
            self.tell(what, WHOLE * done // max(len(tasks), 1), WHOLE)

        observe(0)
        found = shared(self.comm, len(tasks), lambda task: tell(*tasks[task]), observe=observe)
        for number in dict.fromkeys(number for number, _ in tasks):
            own = [one for (of, _), one in zip(tasks, found, strict=True) if of == number]
            areas = [sample.area for sample in samples[number].surfaces]
            yield number, np.array(own), np.array(areas)

    def _told_by(self, number: int, sample: Surface, closures: Sequence[float]) -> Array:
        """Return what a sample on its cells tells, shape (_KNOWN,).

        Args:
            number: Number of its region.
            sample: The sample.
            closures: Closures of the regions, shape (regions,) [mm].
        """
        region, law, closure = self.samples[number], self.table.laws[number], closures[number]
        sizes = np.array([1.0, _gap(law, closure), 1.0])
        probe, known = self.cells.probe_of(region, sample), np.zeros(_KNOWN)
        reference = probe.model.reference_height - sample.mean_height
        approach = reference - separation_of(law, float(closure), reference)
        model = replace(probe.on_body(probe.model, probe.order), tolerance=_RESIDUAL)
        state, pressure = model.press(Control(approach=approach)), float(law.pressure(closure))
        if pressure and sample is region.surfaces[0]:  # the roughness of others ends alike
            known[2] = self.cells.edge_width_of(region, sample, law, float(closure))
        if len(region.surfaces) > 1:
            mean = Control(force=pressure * sample.area)
            known[10:] = _read(model, model.press(mean, start=state.guess)) / sizes
        if not state.force:  # the closure is that of others of the samples
            return known
        area, _, stiffness = _read(model, state)
        if pressure and (others := self.coarser.get(id(sample))):
            probe = replace(probe, by_cells=self._by_cells(probe, others, law, float(closure)))
        asked = read(state), approach, (0.0, 0.0)
        stiffnesses = stiffness * sample.area, math.nan
        errors = dict.fromkeys(("grid", "slopes"), np.full(4, math.inf))
        with suppress(InputError):  # near full contact other cells may have no gap left there
            errors = probe.measure(
                *asked, start=state.guess, by_force=True, stiffnesses=stiffnesses
            ).by_cause
        known[3] = state.force
        for row, cause in enumerate(("grid", "slopes")):
            known[row], *others = errors[cause][:4]
            known[4 + 3 * row : 7 + 3 * row] = others / sizes / [area, 1.0, 1.0]
        return known

    def _by_cells(
        self, probe: ErrorProbe, others: Sequence[Surface], law: PatchLaw, closure: float
    ) -> Array:
        """Return errors by the cells of a worn sample, which wore on fewer cells once more.

        Near full contact its force is steep over the approach: all are those under its pressure.

        Args:
            probe: What has the model of the sample.
            others: The samples that wore on fewer cells.
            law: The law of the sample.
            closure: Its closure [mm].

        Returns:
            Errors of the force at the approach, contact area fraction and mean gap, shape (3,).
        """
        surface, found = probe.model.surface, []
        control = Control(force=float(law.pressure(closure)) * surface.area)
        for one in (surface, *others):
            model = replace(probe.model, surface=one, highest=probe.model.reference_height)
            state = probe.on_body(model, probe.order).press(control)
            found.append([state.approach, state.contact_area_fraction, state.mean_separation])
        nearer, area, gap = error_by_cells(*found)
        return np.array([nearer * float(law.stiffness(closure)) * surface.area, area, gap])


def _rounded(law: PatchLaw, closure: float, ratio: float = _ROUNDED) -> float:
    """Return the closure nearest to a law's [mm] with its largest pressure over a power of one."""
    pressure, largest = law.pressure(np.array([closure, law.range[1]])).tolist()
    if not pressure:
        return closure
    power = ratio ** round(math.log(pressure / largest, ratio))
    return float(law.closure_under(largest * power))


def _gap(law: PatchLaw, closure: float) -> float:
    """Return the mean gap of a law at a closure, or the least one that samples are judged at."""
    point = law.at(closure, extend=True)
    return max(float(point.separation), _LEAST_SEPARATION * law.initial_separation)


def _read(model: HalfSpaceModel, state: ContactState) -> tuple[float, float, float]:
    """Return area fraction, mean gap [mm] and stiffness −dp/dū [MPa/mm] of a sample."""
    stiffness = model.stiffness(state, turns=False).interface or math.nan
    return state.contact_area_fraction, state.mean_separation, stiffness / model.surface.area


def _scatter(areas: Array, read: Array) -> Array:
    """Return standard deviations of area, mean gap and stiffness among samples, shape (3,).

    Those of area and stiffness are relative, those of the gap as it is; 0 of a single sample.

    Args:
        areas: Areas of the samples, which they count by, shape (n,) [mm²].
        read: What `_read` returns of them under one mean pressure, shape (n, 3).
    """
    if len(areas) < 2:
        return np.zeros(3)
    shares = areas / areas.sum()
    means = shares @ read
    apart = np.sqrt(shares @ (read - means) ** 2 / (1.0 - shares @ shares))
    return stated(apart / [means[0], 1.0, means[2]])


def separation_of(law: PatchLaw, closure: float, reference: float) -> float:
    """Return the height of the plane over the mean plane of samples at a closure [mm].

    Args:
        law: Their law.
        closure: The closure [mm].
        reference: Height of the plane at zero approach over the mean plane [mm].
    """
    return max(law.initial_separation - closure, _LEAST_SEPARATION * reference)


def interpolation_errors(law: PatchLaw, closure: Array) -> Array:
    """Return what a law may err between its rows at closures [MPa].

    Its error is relative to the pressure, or to a small share of its largest where that is more.

    Args:
        law: The law.
        closure: Closures, shape (n,) [mm].
    """
    least = LEAST_LOAD * float(law.rows.pressure.max(initial=0.0))
    return np.asarray(law.interpolation_error * np.maximum(law.pressure(closure), least))


def mean_error(samples: Sequence[Surface], pooled: int = 1) -> float:
    """Return the error of the mean of samples over the standard deviation among them.

    It is not exceeded in 19 of 20 sets of as many; 0 for a single sample, whose scatter is unknown.

    Args:
        samples: The samples, which count by their areas.
        pooled: Number of quantities whose variances are averaged.

    Source:
        Student, Biometrika 6 (1908), 1-25.
    """
    areas = np.array([sample.area for sample in samples])
    count = float(areas.sum() ** 2 / (areas @ areas))
    if count <= 1.0:
        return 0.0
    return float(scipy.special.stdtrit(pooled * (count - 1.0), _SHARE)) / math.sqrt(count)
