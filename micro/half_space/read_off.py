"""What is read off contacts on cells: spots, sums over patches, and stiffnesses.

Theory: docs/theory.md, sections 3 and 4.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple, Protocol, Self

import numpy as np
import scipy
from numpy.typing import NDArray

from patchlaw.geometry import Control, PatchGrid, RigidPlane, Surface, overlaps
from patchlaw.geometry.contact_state import ContactState, Spots, Start, peaks_of, sum_of
from patchlaw.micro.boundary_elements.finite_slopes import FiniteSlopes
from patchlaw.micro.complementarity.cell_problem import CellProblem, ContactPressures
from patchlaw.micro.complementarity.solver import approach_rate, pressure_rates
from patchlaw.micro.model import LEAST_CLOSING, NormalStiffness
from patchlaw.support import Array, Flags, InputError, NotConverged, blas_threads, on_rows

_AWAY, _CELLS, _FORWARD = 0.1, 100, (0.75, 1.5)
"""Part of the largest interference that the plane is moved by where cells yield anew and this many
are in contact, both ways; and where it is moved forward alone, over that. With more cells it is
their root of fifth degree smaller: then the scatter by single cells and the error of a parabola
fall alike."""
_BY_CELLS, _BENT = 0.3, 0.015
"""Error of a stiffness there over 1/√n, where n cells begin to touch or to yield on the way, and
part of it that it has besides, by what no parabola shows. On 42 drawn contacts, 34 of which had 30
yielding cells and more, the slope of a smooth curve on four times as many cells a side was within
1.5 times it on all, 5 % in the median, and the true error was 1 %. Forward alone it is twice that:
slopes were off by 3 % where they were off by 1.3 %."""
_ROUGH = 5e-5
"""Residual of the solutions there. On 11 contacts of 192² cells stiffnesses differed by 4e-5 at
most from those with 1e-7, on periods by 6e-4; with 1e-5 they differed by as much."""
_GROWTH = 2.0
"""Power of the largest interference that what finite slopes add grows as. On 24 steep contacts (rms
slopes of 0.4, 11 to 84 cells) stiffnesses were off by 0.7 % in the median and 0.18 × the stated
error at most, with what slopes add here on all planes by 5 %; on ground steel by 0.04 %."""
_NO_MOTIONS = np.zeros(3, bool)
_ROUNDING = 1e-7
"""Plastic depth, relative to the largest interference, that counts as none."""
_LEFT = 0.05
"""Part of the plastic depth that may lie in cells which do not yield where a load is one of the
first loading."""


_RAISED_PEAK, _RAISED_FORCE = 0.5, 0.02
"""Pressure of cells that finite slopes raise by more than the plane presses them, over the largest,
and their share of the force, above which these pressures are taken for wrong. Of 30 drawn
blocks that are pressed to 35 to 95 % of their range of heights 6 exceed one of them: the three of
these that could be meshed bear 2 to 8 % too much, seven of the others up to 2.1 %."""


class CellLoad(NamedTuple):
    """What presses a surface.

    Attributes:
        control: What is prescribed of the plane.
        start: What the solution may start from.
        before: The load before, whose `Start.lowered` the heights are lower by; None: nothing.
        displaced: What other loads than pressures displace the surface by, into the body, shape
            (nx, ny) [mm]; None: nothing.
    """

    control: Control
    start: Start | None = None
    before: Start | None = None
    displaced: Array | None = None

    @property
    def lowered(self) -> Array | None:
        """What the heights are lower by before the load, shape (nx, ny) [mm]; None: nothing."""
        return None if self.before is None else self.before.lowered


class ModelOfCells(Protocol):
    """What the stiffness follows from; see `HalfSpaceModel`."""

    @property
    def surface(self) -> Surface:
        """The surface."""
        ...

    @property
    def contact_modulus(self) -> float:
        """E* [MPa]."""
        ...

    @property
    def periodic(self) -> bool:
        """Whether surface and pressures continue periodically."""
        ...

    @property
    def tolerance(self) -> float:
        """Largest residual of a solution."""
        ...

    @property
    def hardness(self) -> float | None:
        """Hardness of the softer body [MPa]."""
        ...

    def interference(self, plane: RigidPlane, depth: Array | None = None) -> Array:
        """Return the interference of a plane and the surface [mm]."""
        ...

    def problem(self, interference: Array, free: Flags, loads: Array) -> CellProblem:
        """Return the contact problem of a plane."""
        ...

    def with_slopes(self, slopes: tuple[FiniteSlopes, ...]) -> Self:
        """Return the model with other finite slopes."""
        ...

    def pressures_under(
        self, load: CellLoad, *, tolerance: float
    ) -> tuple[ContactPressures, RigidPlane]:
        """Return pressures and the plane."""
        ...


def stiffness(model: ModelOfCells, state: ContactState, *, turns: bool) -> NormalStiffness:
    """Return the stiffnesses of the curve that the load goes on along.

    They follow from a linear solution, unless cells yield further. Then they are the slopes of
    parabolas through the root of the force, over the mean gap or the approach, at this plane and
    two others: cells keep entering that soon carry the hardness, which the derivative for a fixed
    set of cells leaves out. One plane is nearer and one further away, on the curve of the first
    loading; where the load is none of that, both are nearer. What finite slopes add is not worked
    out there, but grows with the largest interference about as the force does.

    Args:
        model: The surface and what it lies on.
        state: A solution of the model.
        turns: Whether the plane turns so that its moments stay.
    """
    largest = float(model.interference(state.plane).max())  # whatever has yielded before
    if not _yields_anew(model, state, largest):
        return unloading_stiffness(model, state, turns=turns)
    assert state.gap is not None
    pressures, here = state.pressures, state.start
    away = _AWAY * largest * min(1.0, (_CELLS / np.count_nonzero(pressures)) ** 0.2)
    both = _is_first_loading(state)
    cell, gap = float(np.prod(model.surface.spacing)), float(state.gap.mean())
    small, slopes = model.with_slopes(()), state.by_slopes
    tilt, used, start = None if turns else state.tilt, 0, here
    ways, known = (1.0, -1.0) if both else _FORWARD, {0.0: pressures}
    rows: list[list[float]] = []
    for way in ways:
        try:
            control = Control(approach=state.approach + way * away, tilt=tilt)
            grown = None if slopes is None else (1.0 + way * away / largest) ** _GROWTH * slopes
            displaced = sum_of(state.displaced, grown)
            load = CellLoad(control, start, None if both else here, displaced)
            found, plane = small.pressures_under(load, tolerance=_ROUGH)
        except NotConverged as error:
            return NormalStiffness(iterations=used + error.iterations)
        known[way] = found.pressure
        start = here.towards(Start(plane=plane, values=found.pressure), ways[1] / ways[0])
        force = float(found.pressure.sum()) * cell
        closed = gap - _mean_gap(model, found, plane, load)
        rows.append([way * away, closed, math.sqrt(force) - math.sqrt(state.force)])
        used += found.iterations + 1
    further, closing, risen = np.transpose(rows)
    before, after, hardness = known[min(known)], known[max(known)], model.hardness or 0.0
    touched, yielded = (before > 0.0) != (after > 0.0), (before >= hardness) != (after >= hardness)
    changed = np.count_nonzero(touched | yielded)
    share = (1.0 if both else 2.0) * (_BY_CELLS / math.sqrt(max(changed, 1)) + _BENT)
    # by the root of the force, which is closer to a straight line
    twice = 2.0 * math.sqrt(state.force)
    whole = twice * _slope_at_0(further, risen)
    stiff = max(0.0, whole), used  # where all that touches yields it is rounding of either sign
    if not min(closing / further) > LEAST_CLOSING:  # no gap closes
        return NormalStiffness(None, *stiff, share)
    own = twice * _slope_at_0(closing, risen)
    return NormalStiffness(max(0.0, own), *stiff, share)


def _slope_at_0(x: Array, y: Array) -> float:
    """Return the slope at 0 of the parabola through 0 and two points, shapes (2,)."""
    first, second = y / x
    return float((first * x[1] - second * x[0]) / (x[1] - x[0]))


def _is_first_loading(state: ContactState) -> bool:
    """Tell whether a contact is as if it had been loaded once, by this load.

    All that has yielded then yields at it. What has worn off depends on the way there.
    """
    assert state.plastic_depth is not None and state.yielding is not None
    left = np.where(state.yielding, 0.0, state.plastic_depth)
    return state.worn_depth is None and bool(left.sum() <= _LEFT * state.plastic_depth.sum())


def _mean_gap(
    model: ModelOfCells, found: ContactPressures, plane: RigidPlane, load: CellLoad
) -> float:
    """Return the mean gap of a solution, the plastic depth that it leaves included [mm].

    Args:
        model: The surface and what it lies on.
        found: The solution.
        plane: The plane there.
        load: What presses.
    """
    below = model.interference(plane, load.lowered)
    problem = model.problem(below, _NO_MOTIONS, np.zeros(3))
    gap = problem.grid.displacement(found.pressure) - problem.interference
    if load.displaced is not None:
        gap += load.displaced
    gap[(found.pressure >= problem.hardness) & (gap < 0.0)] = 0.0
    return float(gap.mean())


def raised_by_slopes(
    pressure: Array, yielding: Flags, by_slopes: Array, interference: Array
) -> str:
    """Return a warning where cells bear much that finite slopes alone press; empty elsewhere.

    There, as in corners far below the plane, the expansion in heights does not hold. Whatever lifts
    a cell by more than the plane presses it is no correction.

    Args:
        pressure: Pressures of a solution, shape (nx, ny) [MPa].
        yielding: Cells that bear the hardness, whose pressure tells nothing.
        by_slopes: What finite slopes add to the displacements, shape (nx, ny) [mm].
        interference: That of the plane and the surface without load, shape (nx, ny) [mm].
    """
    raised = (pressure > 0.0) & (by_slopes < 0.0) & (interference + by_slopes < 0.0)
    if not raised.any():
        return ""
    largest = float(pressure[raised & ~yielding].max(initial=0.0))
    share = float(pressure[raised].sum() / pressure.sum())
    if largest <= _RAISED_PEAK * float(pressure.max()) and share <= _RAISED_FORCE:
        return ""
    return (
        f"finite slopes raise {np.count_nonzero(raised)} cells by more than the plane presses them,"
        f" and these bear {share:.2g} of the force and up to {float(pressure[raised].max()):.4g}"
        " MPa: the theory does not hold there; press less far, set micro.finite_slopes = false, or"
        " mesh the slopes (coupling.kind = 'reference')"
    )


def unloading_stiffness(
    model: ModelOfCells, state: ContactState, *, turns: bool = False
) -> NormalStiffness:
    """Return the stiffnesses of the cells in contact, by a linear solution.

    They are those of unloading: cells that yield bear less than the hardness then.

    Args:
        model: The surface and what it lies on.
        state: A solution of the model.
        turns: Whether the plane turns so that its moments stay.
    """
    problem = _problem_at(model, state, np.array([False, turns, turns]))
    pressure = state.pressures
    with blas_threads(1):
        found = approach_rate(problem, pressure)
        if state.force and not found.total > 0.0:
            # the approach of a period near full contact may turn back, with finite slopes
            return NormalStiffness(iterations=found.products)
        closed = 1.0 - found.mean_displacement(problem)
    approach = found.total * float(np.prod(model.surface.spacing))
    own = approach / closed if closed > LEAST_CLOSING else None  # in full contact no gap closes
    return NormalStiffness(own, approach, found.products + 1)


def rates_of_pressures(
    model: ModelOfCells, state: ContactState, free: Flags, displaced: Array, residual: float
) -> tuple[Array, int]:
    """Return what displacements change in the pressures of a contact, to first order.

    Args:
        model: The surface and what it lies on.
        state: A solution of the model, none of whose cells yields.
        free: Which of approach and slopes of the plane are free, their loads fixed, shape (3,).
        displaced: The displacements into the body, shape (nx, ny) [mm].
        residual: Largest part of them that the pressures leave.

    Returns:
        The changes, shape (nx, ny) [MPa], NaN where the iteration does not converge, and the
        products of the compliance.
    """
    with blas_threads(1):
        problem = _problem_at(model, state, free)
        return pressure_rates(problem, state.pressures, -displaced, residual)


def _problem_at(model: ModelOfCells, state: ContactState, free: Flags) -> CellProblem:
    """Return the contact problem whose solution a state is."""
    lowered_before = sum_of(state.earlier_depth, state.worn_depth)
    interference = model.interference(state.plane, lowered_before)
    problem = model.problem(interference, free, np.zeros(3))
    if state.by_slopes is None:
        return problem
    lowered = state.by_slopes
    return replace(problem, interference=interference - lowered, lowered=lowered)


def _yields_anew(model: ModelOfCells, state: ContactState, largest: float) -> bool:
    """Tell whether the load of a state has left plastic depth; ``largest`` is interference."""
    if state.plastic_depth is None or not state.force:
        return False
    before = 0.0 if state.earlier_depth is None else state.earlier_depth
    anew = float((state.plastic_depth - before).max())
    return anew > max(_ROUNDING, 10.0 * model.tolerance) * largest


Labels = NDArray[np.integer]

EDGE_EXCESS = (np.pi - 1.0 + np.log(2.0)) / 24.0
"""Area, in cells, by which an edge of the counted contact makes it too large on average."""


def find_spots(
    pressure: Array,
    spacing: tuple[float, float],
    *,
    periodic: bool,
    hardness: Array | float | None = None,
) -> tuple[Spots, Array]:
    """Find the contacts of a map of pressures, connected over the edges of its cells.

    Args:
        pressure: Pressures ≥ 0, shape (nx, ny) [MPa].
        spacing: Sides of a cell [mm].
        periodic: Whether contacts continue over the borders.
        hardness: Largest pressure that the cells can bear [MPa], shape (nx, ny) or a number; none
            when not given. The load of a cell needs p/H of its area at least, so that cells that
            yield are in contact whole.

    Returns:
        The spots, their areas corrected by the perimeter; and the part of every cell that is in
        contact, likewise, shape (nx, ny).
    """
    contact = pressure > 0.0
    labels, count = scipy.ndimage.label(contact)
    cells = np.flatnonzero(contact)
    which, load = labels.take(cells) - 1, pressure.take(cells)
    if periodic and count:
        name, count = _joined(labels, count)
        which = name[which]
    cell = np.float64(spacing[0] * spacing[1])
    share = true_area(contact, periodic=periodic)
    if hardness is not None:
        np.maximum(share, pressure / hardness, out=share)
    top = cells[peaks_of(which, load, count)]
    middle = np.stack(np.unravel_index(top, pressure.shape), axis=1) + 0.5
    spots = Spots(
        place=np.multiply(middle, spacing),
        area=np.bincount(which, share.take(cells), minlength=count) * cell,
        force=np.bincount(which, load, minlength=count) * cell,
        peak_pressure=pressure.ravel()[top],
    )
    return spots, share


def true_area(contact: Flags, *, periodic: bool) -> Array:
    """Return the part of every cell that is in contact, corrected for the jagged perimeter.

    Cells that the true perimeter crosses carry a pressure as wholes, too many of them on average.
    Each edge between a cell in contact and one that is not takes (π − 1 + ln 2)/24 of the cell's
    area off; on cells that are not square too, where the source has squares. Borders where a
    surface ends are no edges.

    Args:
        contact: Cells in contact, shape (nx, ny).
        periodic: Whether the map continues over its borders.

    Returns:
        Shares, 0 outside the contact, shape (nx, ny).

    Source:
        Yastrebov, Anciaux & Molinari 2017, doi 10.1016/j.triboint.2017.04.023.
    """
    share, inner = np.empty(contact.shape), slice(1, -1)
    around = np.empty([count + 2 for count in contact.shape], bool)
    around[inner, inner] = contact
    first, last = (-2, 1) if periodic else (1, -2)
    around[0], around[-1] = around[first], around[last]
    around[:, 0], around[:, -1] = around[:, first], around[:, last]

    def work(rows: slice) -> None:
        here, edges = contact[rows], np.zeros(contact[rows].shape, np.int8)
        beside = around[rows.start : rows.stop + 2]
        sides = (beside[2:, inner], beside[:-2, inner], beside[inner, 2:], beside[inner, :-2])
        for neighbour in sides:
            edges += here > neighbour
        np.subtract(here, np.multiply(edges, EDGE_EXCESS, dtype=float), out=share[rows])

    on_rows(work, contact.shape)
    return share


def _joined(labels: Labels, count: int) -> tuple[Labels, int]:
    """Return the numbers of contacts whose parts meet over a period's borders, and their count."""
    sides = ((labels[0], labels[-1]), (labels[:, 0], labels[:, -1]))
    one, other = (np.concatenate(part) for part in zip(*sides, strict=True))
    both = (one > 0) & (other > 0)
    name = np.arange(count)
    for pair in {*zip(one[both] - 1, other[both] - 1, strict=True)}:  # quicker than a sparse matrix
        first, last = np.sort(name[[*pair]])
        name[name == last] = first
    kept, name = np.unique(name, return_inverse=True)
    return name, len(kept)


def sums_of(
    model: ModelOfCells, pressure: Array, plane: RigidPlane, patches: PatchGrid
) -> dict[str, Any]:
    """Return pressures, and sums of them and their spots, by the names that `ContactState` has.

    Args:
        model: The surface and what it lies on.
        pressure: Pressures of all cells, shape (nx, ny) [MPa].
        plane: The plane, about whose centre moments are.
        patches: The patches.
    """
    surface, hardness = model.surface, model.hardness
    spots, share = find_spots(pressure, surface.spacing, periodic=model.periodic, hardness=hardness)
    along_x, along_y = overlaps(patches, surface.lengths, surface.grid)
    cell = surface.spacing[0] * surface.spacing[1]
    moment_x, moment_y = plane.moment(surface.x[:, None], surface.y, pressure)
    return {
        "x": surface.x,
        "y": surface.y,
        "pressure": pressure,
        "force": cell * float(pressure.sum()),
        "moment": (cell * moment_x, cell * moment_y),
        "contact_area": float(spots.area.sum()),
        "contacts": len(spots),
        "peak_pressure": float(pressure.max()),
        "patch_force": (along_x @ pressure @ along_y.T).ravel(),
        "patch_area": (along_x @ share @ along_y.T).ravel(),
        "patch_contacts": spots.per_patch(patches),
        "spots": spots,
    }


def check_plane(
    control: Control, beyond: float, area: float, slopes: Sequence[FiniteSlopes], bounded: bool
) -> None:
    """Refuse a plane that is not level, an approach beyond full contact, a force beyond all.

    Args:
        control: What is prescribed.
        beyond: Mean interference at zero free motions [mm].
        area: Area of the period [mm²].
        slopes: What finite slopes of the bodies add.
        bounded: Whether no approach closes all gaps, as cells yield or wear.

    Raises:
        InputError: When there is no such contact.
    """
    if control.tilt is None or any(control.tilt):
        problem, value = "a plane over a periodic surface must be level", control.tilt or "free"
        raise InputError(problem, value=value, allowed="tilt (0, 0)")
    # finite slopes change the last one
    if control.approach is not None and beyond >= 0.0 and not (bounded or slopes):
        raise no_gap_left(control.approach, beyond)
    young = min((one.material.young_modulus for one in slopes), default=np.inf)
    mean = 0.0 if control.force is None else control.force / area
    if mean >= young:
        problem = "finite slopes end where the mean pressure is the Young's modulus"
        raise InputError(problem, value=control.force, allowed=f"a pressure < {young:.6g} MPa")


def no_gap_left(approach: float, beyond: float) -> InputError:
    """Return the error on an approach at which no gap is left.

    Args:
        approach: The approach [mm].
        beyond: How far it is beyond the last one with a gap [mm].
    """
    allowed = f"< {approach - beyond:.6g} mm; beyond it give the force"
    problem = "a periodic surface has no gap left at this approach"
    return InputError(problem, value=approach, allowed=allowed)
