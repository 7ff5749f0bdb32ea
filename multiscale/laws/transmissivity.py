"""Transmissivities of gaps over the mean separation: of samples, or of the patches of a surface.

Each row is solved on the cells of the surface and on half and a quarter as many a side, whose
differences are the error of the grid. Next to closing they tell little of it, and what flows where
contact ends half a cell earlier tells more.

Theory: docs/theory.md, section 16.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from patchlaw.geometry import Control, PatchGrid
from patchlaw.geometry.contact_state import Start
from patchlaw.geometry.patches import field_means
from patchlaw.micro import HalfSpaceModel, press_along
from patchlaw.micro.transport import gap_flows, open_gaps, widened_gap
from patchlaw.multiscale.laws.rows import Transmissivity
from patchlaw.support import Array, Flags, shared

_CELL, _FURTHER, _TABLED = 170.0, 5.2e6, 450.0
"""Memory of a cell of flows along both axes, with their constrictions [B], and what small maps take
besides at most: both flows together on up to 192² cells, or factors of bands. Sparse factors take
1000 a cell where multigrid does not converge: on none of 30 maps of contacts on 200² to 330² cells,
and one of 30 drawn without. And what a table of leaks keeps for every cell of its samples [B]:
pressures that further rows start from on all grids, and gaps on the finest: 15 for a row, 20 to 30
of which ten samples of 64² to 256² cells had."""


def flow_memory(cells: int, tabled: int = 0) -> float:
    """Return the memory that flows through a map of gaps take [B].

    Args:
        cells: Number of cells.
        tabled: Number of cells of samples whose leaks a process tabulates.
    """
    return cells * _CELL + min(1e3 * cells, _FURTHER) + tabled * _TABLED


ROUGH = 1e-4
"""Error of flows that does no harm where they tell an error, or lie in a table whose rows tell them
to some 10⁻³."""
_HALF, _QUARTER, _LEAST = 1.2, 0.25, 0.01
"""Parts that the error of a hydraulic gap is at least: of its change from half as many cells a
side, and from a quarter to half as many, as either may vanish by chance; of the gap itself."""
_APART, _CLOSING, _WIDER, _ENDS = 3.0, 0.4, 0.6, 0.05
"""Next to closing, that is where one of these grids is closed, or a flow and that on half as many
cells differ by a factor of 3, the same: of the change from half as many; of what the hydraulic gap
grows by as contact ends half a cell earlier; and of the larger one on both grids."""


def error_of_grid(
    flow: ArrayLike, half: ArrayLike, quarter: ArrayLike, wider: ArrayLike | None = None
) -> Array:
    """Return what flows through gaps may be off by as cells are not finer.

    The larger the load, the smaller the hydraulic gap, the cube root of T: it falls almost
    linearly, and finer cells shift this line. So the differences between grids tell the error of
    the hydraulic gap, where factors between flows overstate it. Next to closing they tell little,
    and the widening of all gaps by a part of a cell does. The constants above were set on 460
    surfaces, and on 74 about closing (`benchmarks/leak_error.py`).

    Args:
        flow: Flows, or transmissivities, of any shape and sign.
        half: The same on half as many cells a side.
        quarter: The same on a quarter as many.
        wider: The same through `widened_gap`, as far as `next_to_closing`; None where it is not
            known, and the others alone tell the error.
    """
    own, on_half, on_quarter = (np.cbrt(np.abs(one)) for one in (flow, half, quarter))
    change = np.abs(own - on_half)
    error = np.maximum(_HALF * change, _QUARTER * np.abs(on_half - on_quarter))
    error = np.maximum(error, _LEAST * own)
    if wider is not None:
        grown = _WIDER * (np.cbrt(np.abs(wider)) - own)
        least = np.maximum(_CLOSING * change, _ENDS * np.maximum(own, on_half))
        closing = next_to_closing(flow, half, quarter)
        error = np.where(closing, np.maximum(grown, least), error)
    return np.asarray((own + error) ** 3 - own**3)


def next_to_closing(flow: ArrayLike, half: ArrayLike, quarter: ArrayLike) -> Flags:
    """Return which flows are so near to closing that coarser grids do not tell their error.

    Args:
        flow: See `error_of_grid`.
        half: Likewise.
        quarter: Likewise.
    """
    own, half, quarter = map(np.abs, (flow, half, quarter))
    closed = (own == 0.0) | (half == 0.0) | (quarter == 0.0)
    return np.asarray(closed | (own > _APART * half) | (half > _APART * own))


_ROWS = 7
"""Separations from first touch to the end of a law that are solved first; those after the first
that is closed are left out."""
_OFF, _MOST, _OF_GRID, _FINEST, _PASSES = 0.05, 0.25, 0.75, 8e-3, 8
"""Rows are added on both sides of one whose T the others miss by more than `_OF_GRID` times the
error of the grid, which counts as `_OFF` times T at least and `_MOST` times T at most, until rows
are as near as `_FINEST` times the separation at first touch, in `_PASSES` passes at most. Ten
samples, isotropic and turned, down to a fifth of that separation or to closing, had 7 to 26 rows,
whose T between them erred by 0.1 % in the median, 1 % in 95 % of 354 flows and 11 % next to
closing. Every second row left out told as much in 99 % of them, and together with the error of the
grid in all (`benchmarks/leak_rows.py`). With half of T as the most, errors between rows were wrong
by a factor of ten next to closing."""
_BEYOND = 0.02
"""Way that rows go beyond the end of a law, over the way to it."""
_PATCH_ROWS = 17
"""Approaches of a whole surface, from first touch to the largest load."""
_TOLERANCE = 1e-5
"""Tolerance of contacts in tables: T differs by 10⁻⁶ of itself, and by 10⁻⁴ next to closing."""
_FEWEST_CELLS = 16
"""Cells along a side below which half of them are not tried."""


def sample_transmissivity(
    models: Sequence[HalfSpaceModel],
    pressure_at: Callable[[Array], Array],
    comm: Any = None,
    *,
    least: float = 0.0,
) -> Transmissivity:
    """Tabulate the transmissivity of periodic samples, the mean of them at equal separations.

    Args:
        models: The periodic models of the samples, which count by their areas.
        pressure_at: Mean pressures of their law at separations, [mm] to [MPa].
        least: Least separation that it is asked for, where the law ends [mm].
        comm: MPI communicator, whose ranks share the samples; None for this process alone.

    Returns:
        The transmissivity, the same on every rank.

    Raises:
        NotConverged: When a contact problem or a flow cannot be solved.

    Note:
        Collective.
    """
    touch = max(_separation(model, model.first_touch) for model in models)
    areas = np.array([model.surface.area for model in models])
    shares = areas / areas.sum()
    least = max(least - _BEYOND * (touch - least), 0.0)
    separation = np.unique(least + (touch - least) * np.linspace(0.0, 1.0, _ROWS) ** 2)[::-1]
    samples = [_Sample(model, coarser) for model in models for coarser in (1, 2, 4)]
    rows = _solved(samples, separation, comm)  # by sample, grid and row: T along x and y, pressure
    for _ in range(_PASSES):
        known, *coarser = np.tensordot(shares, rows[..., :2], 1)
        error = _OF_GRID * error_of_grid(known, *coarser)
        off = _missed(separation, known, np.clip(error, _OFF * known, _MOST * known))
        closes = ((known[:-1] > 0.0) & (known[1:] == 0.0)).any(axis=1)
        wide = (off[1:] | off[:-1] | closes) & (-np.diff(separation) > _FINEST * touch)
        wide &= known[:-1].any(axis=1)
        if not wide.any():
            break
        middles = 0.5 * (separation[1:] + separation[:-1])[wide]
        rows = np.concatenate((rows, _solved(samples, middles, comm)), axis=2)
        separation = np.append(separation, middles)
        order = np.argsort(-separation, kind="stable")
        separation, rows = separation[order], rows[:, :, order]
    fine, half, quarter = np.tensordot(shares, rows[..., :2], 1)
    wider, closing = fine.copy(), next_to_closing(fine, half, quarter).any(axis=1)
    if closing.any():  # and from there on until wider gaps are closed, too
        last = slice(int(np.argmax(closing)), None)
        wider[last] = np.tensordot(shares, _widened(samples, separation[last], comm), 1)
    coarse = fine + error_of_grid(fine, half, quarter, wider)
    gap = np.cbrt(fine)
    apart = _scatter(rows[:, 0], shares, pressure_at(separation))[:, None]
    scatter = apart * (3.0 * gap * (gap + apart) + apart**2)  # (gap + apart)³ − gap³, never < 0
    is_open = np.flatnonzero(np.maximum(fine, coarse).any(axis=1))
    kept = slice(int(is_open[-1]) + 1, None, -1)  # with one closed row
    return Transmissivity(
        separation=separation[kept].copy(),
        hydraulic_gap=gap[kept],
        on_half=np.cbrt(coarse[kept]),
        scatter=scatter[kept],
    )


def _missed(separation: Array, known: Array, allowed: Array) -> Flags:
    """Return which rows the others miss by more than is allowed, shape (m,).

    Args:
        separation: Their separations, falling, shape (m,) [mm].
        known: T along x and y, shape (m, 2) [mm³].
        allowed: What they may miss it by, shape (m, 2) [mm³].
    """
    off, gap = np.zeros(len(separation), bool), np.cbrt(known)
    for row in range(1, len(separation) - 1):
        rest = np.flatnonzero(np.arange(len(separation)) != row)[::-1]
        curve: Any = scipy.interpolate.PchipInterpolator(separation[rest], gap[rest])
        off[row] = (np.abs(curve(separation[row]) ** 3 - known[row]) > allowed[row]).any()
    return off


def _scatter(rows: Array, shares: Array, pressure: Array) -> Array:
    """Return standard deviations of T^(1/3) among samples at mean pressures, shape (m,) [mm].

    Along x and y they are pooled: a sample's channels along x tell little of those along y, so that
    a few samples tell the scatter of both as twice as many would that of one (`mean_error`).

    Their T themselves are far from a normal distribution, the more the nearer to closing. So are
    their T^(1/3) once some are closed, all at the same 0: samples differ by the pressure at which
    they close. Beyond it their T^(1/3) go on falling here, as `_beyond_closing` tells.

    Args:
        rows: T along x and y and the mean pressure of the samples, shape (n, m, 3).
        shares: Shares of the samples in the area of all, shape (n,).
        pressure: Mean pressures of the rows, rising, shape (m,) [MPa].
    """
    if len(shares) == 1:
        return np.zeros(len(pressure))
    each = np.cbrt(rows[..., :2])  # at first touch, where pressures do not tell the separation
    loaded = pressure > 0.0
    for one, sample in zip(each, rows, strict=True):
        known = sample[:, 2]
        some = ~np.isnan(known)
        some[: max(int((known == 0.0).sum()) - 1, 0)] = False
        for axis, gap in enumerate(np.cbrt(sample[some, :2]).T):
            one[loaded, axis] = _beyond_closing(pressure[loaded], known[some], gap)
    apart = (each - np.tensordot(shares, each, 1)) ** 2
    variance = np.tensordot(shares, apart, 1) / (1.0 - shares @ shares)
    return np.asarray(np.sqrt(variance.mean(axis=1)))


def _beyond_closing(pressure: Array, known: Array, gap: Array) -> Array:
    """Return hydraulic gaps at pressures, beyond closing negative ones on the line before it.

    They close almost linearly: T falls with the power 3.45 of the distance to closing.

    Args:
        pressure: Mean pressures, rising, shape (m,) [MPa].
        known: Pressures where they are known, rising, shape (k,) [MPa].
        gap: Hydraulic gaps there, 0 where closed, shape (k,) [mm].

    Source:
        Dapp & Müser 2016, Scientific Reports 6, 19513, doi 10.1038/srep19513 (the power).
    """
    found, first = np.interp(pressure, known, gap), int(np.argmax(gap == 0.0))
    if gap.all() or first == 0:
        return found
    last, before = first - 1, max(first - 2, 0)
    ends = (before, last) if last else (last, first)
    fall = np.diff(gap[[*ends]]) / np.diff(known[[*ends]])
    line = np.minimum(gap[last] + fall * (pressure - known[last]), 0.0)
    return np.where(pressure >= known[first], line, found)


def _separation(model: HalfSpaceModel, approach: float) -> float:
    """Return the mean separation of a periodic sample at an approach [mm]."""
    return model.reference_height - model.surface.mean_height - approach


def _solved(samples: Sequence[_Sample], separations: Array, comm: Any) -> Array:
    """Return rows of n periodic samples at m separations that fall; collective.

    Args:
        samples: Each on the cells of its surface, and on half and a quarter of them, one by one.
        separations: Mean separations, falling, shape (m,) [mm].
        comm: MPI communicator.

    Returns:
        T along x and y [mm³], 0 beyond the first closed row, and the mean pressure [MPa], NaN
        beyond it, shape (n, 3, m, 3).
    """
    found = shared(comm, len(samples), lambda task: samples[task].rows(separations))
    return np.reshape(found, (-1, 3, len(separations), 3))


def _widened(samples: Sequence[_Sample], separations: Array, comm: Any) -> Array:
    """Return T of widened gaps of n samples, shape (n, m, 2) [mm³]; collective."""

    def solve(task: int) -> Array:  # on the rank that has solved the same rows before
        return samples[task].rows(separations if task % 3 == 0 else separations[:0], widened=True)

    return np.array(shared(comm, len(samples), solve)[::3])[..., :2]


class _Sample:
    """A periodic sample on one grid.

    Args:
        model: Its periodic model on the cells of its surface.
        coarser: How many times as few cells along both sides it has here, if these are enough.
    """

    def __init__(self, model: HalfSpaceModel, coarser: int) -> None:
        nx, ny = model.surface.grid
        if coarser > 1 and min(nx, ny) >= _FEWEST_CELLS:
            model = model.resampled((nx // coarser, ny // coarser))
        self._model = replace(model, tolerance=max(model.tolerance, _TOLERANCE))
        self._starts: dict[float, Start] = {}
        self._known: dict[float, tuple[NDArray[np.float32], float]] = {}
        self._widens = coarser == 1

    def rows(self, separations: Array, *, widened: bool = False) -> Array:
        """Return T along x and y [mm³] and the mean pressure [MPa], shape (m, 3)."""
        found, lengths = np.zeros((len(separations), 3)), self._model.surface.lengths
        found[:, 2] = np.nan
        for row, separation in enumerate(separations.tolist()):
            if separation == 0.0:  # full contact
                break
            gap, found[row, 2] = self._pressed(separation)
            gap = widened_gap(gap, periodic=True) if widened else gap
            flows = gap_flows(gap, lengths, periodic=True, tolerance=ROUGH)
            found[row, :2] = [one.transmissivity for one in flows]
            if not found[row, :2].any():
                break
        return found

    def _pressed(self, separation: float) -> tuple[Array, float]:
        """Return gaps at a separation, shape (nx, ny) [mm], and the mean pressure [MPa].

        Contacts start from those next to them.
        """
        model, surface = self._model, self._model.surface
        if separation not in self._known:
            approach = _separation(model, 0.0) - separation
            if approach <= model.first_touch:
                gap, pressure = separation + surface.mean_height - surface.heights, 0.0
                return np.maximum(gap, 0.0), pressure
            (state,) = press_along(model, approach, known=self._starts)
            self._starts[approach] = state.guess
            if not self._widens:
                return state.open_gap, state.mean_pressure
            self._known[separation] = state.open_gap.astype(np.float32), state.mean_pressure
        gap, pressure = self._known[separation]
        return gap.astype(float), pressure


def patch_transmissivities(
    models: Sequence[HalfSpaceModel],
    patches: PatchGrid,
    approaches: tuple[float, float],
    tilt: tuple[float, float] | None,
    comm: Any = None,
) -> list[Transmissivity]:
    """Tabulate the transmissivities of the patches of one surface that is pressed as a whole.

    The sides of a patch along the flow are walls.

    Args:
        models: The model of the whole surface on its body, and those on fewer cells of
            `patch_grids`, half as many a side first.
        patches: The partition.
        approaches: First and last approach of the plane [mm].
        tilt: Slopes of the plane; None lets it turn.
        comm: MPI communicator, whose ranks share the rows; None for this process alone.

    Raises:
        InputError: When a patch has less than two cells along a side.
        NotConverged: When a contact problem or a flow cannot be solved.

    Note:
        Collective.
    """
    first, last = approaches
    rows = np.linspace(first, last, _PATCH_ROWS if last > first else 1)
    tasks = [(model, approach) for model in models for approach in rows.tolist()]

    def solve(task: int, *, widened: bool = False) -> Array:
        model, approach = tasks[task]
        gap = model.press(Control(approach=approach, tilt=tilt)).open_gap
        gap = open_gaps(gap, gap.max())  # before it is cut, as a patch may be closed
        gap = widened_gap(gap, periodic=False) if widened else gap
        means = field_means(gap, patches.lengths, patches)
        return np.array([(one, *_of_patch(gap, patches, i)) for i, one in enumerate(means)])

    found = np.array(shared(comm, len(tasks), solve))
    fine, half, quarter = found.reshape(len(models), len(rows), patches.count, 3)[[0, 1, -1]]
    wider, closing = fine.copy(), next_to_closing(*(one[..., 1:] for one in (fine, half, quarter)))
    again = np.flatnonzero(closing.any(axis=(1, 2)))  # tasks of the first model
    if len(again):
        wider[again] = shared(comm, len(again), lambda one: solve(int(again[one]), widened=True))
    by_patch = (one.swapaxes(0, 1) for one in (fine, half, quarter, wider))
    return [_patch_table(*one) for one in zip(*by_patch, strict=True)]


def patch_grids(grid: tuple[int, int], patches: PatchGrid) -> list[tuple[int, int]]:
    """Return half and a quarter of a grid's cells, those that leave patches two cells a side."""
    halves = [(grid[0] // factor, grid[1] // factor) for factor in (2, 4)]
    least = [2 * count for count in patches.grid]
    return [one for one in halves if all(np.greater_equal(one, least)) and min(one) >= 4]


def _of_patch(gap: Array, patches: PatchGrid, index: int) -> list[float]:
    """Return T along x and y of a patch in a map of gaps [mm³].

    Fluid flows through cells that a border cuts on both of its sides.
    """
    parts, sides = [], []
    whole = zip(gap.shape, patches.unravel(index), patches.grid, patches.lengths, strict=True)
    for cells, place, count, length in whole:
        parts.append(slice(place * cells // count, -(-(place + 1) * cells // count)))
        sides.append(length * (parts[-1].stop - parts[-1].start) / cells)
    own, lengths = gap[parts[0], parts[1]], (sides[0], sides[1])
    return [flow.transmissivity for flow in gap_flows(own, lengths, tolerance=ROUGH)]


def _patch_table(fine: Array, half: Array, quarter: Array, wider: Array) -> Transmissivity:
    """Return the table of rows of separation and T along x and y, shape (m, 3), as gaps fall."""
    coarse = fine + error_of_grid(fine, half, quarter, wider)
    rising = fine[::-1, 0] > np.append(-np.inf, np.maximum.accumulate(fine[::-1, 0])[:-1])
    gaps = np.cbrt(fine[::-1, 1:])[rising]
    return Transmissivity(
        separation=fine[::-1, 0][rising],
        hydraulic_gap=gaps,
        on_half=np.cbrt(coarse[::-1, 1:])[rising],
        scatter=np.zeros_like(gaps),
    )
