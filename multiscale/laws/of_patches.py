"""Makes the laws of the patches of a surface, consistent or isolated.

Consistent laws come from one solution of the whole surface, isolated ones from what lies in each
patch alone, as Waddad et al. 2016 make them.

Theory: docs/theory.md, section 10.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from patchlaw.geometry import Control, PatchGrid, stacked
from patchlaw.micro import ContactState, MicroModel, Start, influence_matrix, press_along
from patchlaw.micro.closed_forms import love_centre, love_mean
from patchlaw.multiscale.laws.interpolation import curves_from_touch, rising_curves
from patchlaw.multiscale.laws.law_table import LawTable
from patchlaw.multiscale.laws.patch_law import PatchLaw
from patchlaw.multiscale.laws.refinement import MOST_ROWS, Refined, RowMaker, refined
from patchlaw.multiscale.laws.rows import LawRows, PlanePath
from patchlaw.support import Array, on_root_alone, shared
from patchlaw.support.readable import ProgressObserver, unobserved

Displacements = Callable[[Array], Array]
"""From pressures of N patches at m load steps to their mean displacements, [MPa] to [mm]."""

_SMALL_LOAD = 1e-6
"""Force, relative to the largest, at which a plane that is free to turn is taken to be at first
touch. By Hertz it has then come a ten thousandth of its way."""

_RESERVE = 0.02
"""Way that rows go beyond the largest load, relative to the way from first touch to it, so that
every load step lies between two rows."""

_ROW_ERROR = 1e-2
"""Residual of a row of few cells over the tolerance of the table. With a tolerance of 2e-3 forces
at rows of six surfaces erred by up to 1e-4, pressures of patches by up to 3e-4. With 5e-4 these
were 3e-6, with twice to 2.5 times as many evaluations of finite slopes; errors between rows were
the same."""

_POINTWISE_RESERVE = 0.5
"""The same for laws that are evaluated at points. Where a point is displaced less than its patch in
the mean, its closure is larger than those of all rows. On eight scenes of the paper's recipe (1 to
64 patches, level and tilted, on a cube and a column) seven left their laws with 0.02, two with 0.25
and none with 0.5."""

_FURTHER, _FURTHEST = 2.0, 20.0
"""Factor on the way of rows that end too early, and the longest over that to the largest load. Near
full contact closure hardly grows with the approach, and points need long ways."""

_ROWS_TOGETHER = 2
"""Rows that one rank solves in sequence, each starting from the one before: results then do not
depend on the number of ranks. On 64² to 256² cells it takes up to 7 % more iterations than 4, which
would leave most of more than two ranks idle."""

_MOST_TRIALS = 40
"""Contact problems at most in search of the approach that gives a closure."""

_BEYOND_FALL = 0.25
"""Share of a patch's own displacement by which the block under it may be displaced further."""

_LOVE = {"mean": love_mean, "centre": love_centre}


def consistent_laws(
    model: MicroModel,
    patches: PatchGrid,
    *,
    mean_heights: Array,
    largest: Control,
    displacements: Displacements | None = None,
    pointwise: bool = False,
    before: LawTable | None = None,
    tolerance: float = 2e-3,
    most_rows: int = MOST_ROWS,
    comm: Any = None,
    observe: ProgressObserver | None = None,
) -> LawTable:
    """Tabulate the laws of all patches of one surface that is pressed as a whole.

    In the macro model whose displacements they were made with they give back the solution they
    were made from, whatever the partition: to rounding at their rows, and between them to the
    error that the table states. Rows of few cells are solved to a hundredth of the tolerance. Where
    the plane is free to turn, it turns in the rows too.

    Args:
        model: Micro model of the whole surface, on the body that the laws are for.
        patches: Its partition.
        mean_heights: Mean height of the surface over each patch, shape (N,) [mm].
        largest: The largest load that the laws will be used for. Patches that are not in contact
            up to it are open.
        displacements: Mean displacements of the patches by their pressures in the macro model;
            by default those of a half-space. Collective.
        pointwise: Whether the macro model evaluates the laws at points, where closures exceed the
            means of the rows.
        before: Laws of the same surface that end too early. Their rows stay, and others follow.
        tolerance: Interpolation error of the force, see `refinement.refined`.
        most_rows: Rows that are solved at most.
        comm: MPI communicator, whose ranks share the rows. The table does not depend on their
            number.
        observe: Called as rows are solved.

    Returns:
        All laws, on every rank; `before` where it goes as far as laws may.

    Raises:
        NotConverged: When the micro model does not converge.

    Note:
        Collective.
    """
    compliance = np.divide(influence_matrix(patches), np.pi * model.contact_modulus)
    whole = WholeSurface(
        model=model,
        patches=patches,
        mean_heights=np.asarray(mean_heights, dtype=float),
        displacements=displacements or (lambda pressures: pressures @ compliance.T),
        tilt=largest.tilt,
        comm=comm,
        observe=lambda rows: (observe or unobserved)("rows of laws", rows, most_rows),
    )
    first, end, tilt = on_root_alone(comm, lambda: whole.range_up_to(largest))
    way, reserve, earlier = max(end - first, 0.0), _RESERVE, None
    if pointwise:
        reserve = _POINTWISE_RESERVE
    if before is not None:
        assert before.path is not None, "laws of patches together have a path"
        earlier = before.path.approach
        further = _FURTHER * float(earlier[-1] - first)
        if not way or further > _FURTHEST * way:
            return before
        reserve = further / way - 1.0
    end += reserve * way
    last = Control(approach=end, tilt=largest.tilt)
    quick = model.quick_up_to(last, _ROW_ERROR * tolerance, sums_alone=True)
    if quick is not None:
        whole = replace(whole, model=quick, quick=True)
    make = RowMaker(whole.rows, curves_from_touch, compliance, whole.initial_separation)
    made = refined(make, first, end, tolerance, most_rows, earlier)
    return LawTable(
        patches=patches,
        laws=tuple(whole.laws(made)),
        made_by=_made_by("consistent", model, tolerance)
        | {"tilt": "free" if largest.tilt is None else f"{tilt[0]:g}, {tilt[1]:g}"},
        force_error=made.force,
        path=whole.path,
    )


def _made_by(
    coupling: str, model: MicroModel, tolerance: float, love: str = "mean"
) -> dict[str, str]:
    """Return what laws of patches are made by, see `LawTable`."""
    how = {"coupling": coupling, "model": model.name, "love": love}
    return how | {"tolerance": f"{tolerance:g}"}


@dataclass(frozen=True, kw_only=True, eq=False)
class WholeSurface:
    """A rough surface pressed as a whole by a rigid plane, with results patch by patch.

    A row is the contact problem at one approach, its plane tilted as prescribed or free to turn.
    The closure of patch i is its local approach less its displacement in the macro model by the
    mean pressures of all patches, c_i = s_i − (C p)_i. The macro model that the laws are for
    therefore reproduces every row, whatever its partition or mesh.

    Args:
        model: Micro model of the whole surface, on the body.
        patches: Its partition.
        mean_heights: Mean height of each patch, shape (N,) [mm].
        displacements: C p of the macro model, collective.
        tilt: Slopes of the plane; None lets it turn.
        comm: MPI communicator, whose ranks share the rows; None for this process alone.
        observe: Called with the number of rows that are solved.
        quick: Whether a row takes so little that one rank solves them all.
    """

    model: MicroModel
    patches: PatchGrid
    mean_heights: Array
    displacements: Displacements
    tilt: tuple[float, float] | None = (0.0, 0.0)
    comm: Any = None
    observe: Callable[[int], None] = lambda rows: None
    quick: bool = False
    _solved: dict[float, ContactState] = field(default_factory=dict, init=False)
    _starts: dict[float, Start] = field(default_factory=dict, init=False)

    def range_up_to(self, largest: Control) -> tuple[float, float, tuple[float, float]]:
        """Return the approaches at first touch and at the largest load [mm], and the tilt there.

        Args:
            largest: The largest load.
        """
        free, force, end, start = largest.tilt is None, 0.0, largest, None
        if free or largest.approach is None:
            state = self._press(largest, start)
            start, force = state.guess, state.force
            end = Control(approach=state.approach, tilt=state.tilt)
        # the tilt of a free plane without force is not determined
        touch = Control(force=_SMALL_LOAD * force if free else 0.0, tilt=largest.tilt)
        first, last = self._press(touch, start).approach, float(end.approach or 0.0)
        if touch.force:
            first -= _SMALL_LOAD ** (2 / 3) * (last - first)
        return first, last, end.tilt or (0.0, 0.0)

    def rows(self, approaches: Array) -> LawRows:
        """Return rows of all patches, columns of shape (m, N).

        A plane that turns may leave a patch while it comes nearer to others: then the approach of
        all patches is the one at the middle.

        Args:
            approaches: Increasing approaches at the middle, shape (m,) [mm].

        Note:
            Collective.
        """
        solved = self._solve(approaches)
        self._solved.update(zip(map(float, approaches), solved, strict=True))

        def in_all_patches(values: NDArray[Any]) -> NDArray[Any]:
            return np.broadcast_to(values[:, None], pressure.shape)

        pressure = stacked(solved, "patch_pressure")
        local = np.array([state.plane.means(self.patches) for state in solved])
        loaded, macro_displacement = pressure > 0.0, self.displacements(pressure)
        area_fraction = stacked(solved, "patch_area") / self.patches.area
        return LawRows(
            approach=local if self.tilt is not None else in_all_patches(approaches),
            closure=local - macro_displacement,
            pressure=pressure,
            contact_area_fraction=np.where(loaded, area_fraction, 0.0),
            contacts=np.where(loaded, stacked(solved, "patch_contacts"), 0),
            unresolved_displacement=stacked(solved, "patch_displacement") - macro_displacement,
            outside_range=in_all_patches(stacked(solved, "warning") != ""),
        )

    def laws(self, made: Refined) -> list[PatchLaw]:
        """Return the laws of all patches through rows of increasing approaches."""
        rows, counts = made.rows.from_first_touch()
        touch, starts = made.rows.closure.max(axis=0), np.cumsum(counts) - counts
        touch[counts > 0] = rows.closure[starts[counts > 0]]
        separation = self.initial_separation
        is_open, laws = LawRows.none(), []  # most patches
        for index, (start, count) in enumerate(zip(starts, counts, strict=True)):
            own = rows[start : start + count] if count else is_open
            ends: dict[str, Any] = {
                "first_touch": float(touch[index]),
                "initial_separation": float(separation[index]),
                "warning_pressure": own.warning_pressure,
            }
            untouched = made.rows.untouched(index, own)
            laws.append(PatchLaw(rows=own, untouched=untouched, **ends, **made.of_law(index)))
        return laws

    @property
    def initial_separation(self) -> Array:
        """Height of the plane at zero approach over the mean heights of the patches (N,) [mm]."""
        return np.subtract(self.model.reference_height, self.mean_heights)

    @property
    def path(self) -> PlanePath:
        """The planes of all rows so far."""
        solved = [self._solved[approach] for approach in sorted(self._solved)]
        return PlanePath(**{one.name: stacked(solved, one.name) for one in fields(PlanePath)})

    def _solve(self, approaches: Array) -> list[ContactState]:
        """Solve the contact problem at all approaches.

        Quick solutions follow each other on one rank, each from those next to it. Others are shared
        by the ranks, a few in sequence.
        """
        count = len(approaches) if self.quick else _ROWS_TOGETHER
        parts = [approaches[k : k + count] for k in range(0, len(approaches), count)]

        def solve(part: int) -> list[ContactState]:
            states = press_along(
                self.model,
                parts[part],
                patches=self.patches,
                mean_heights=self.mean_heights,
                tilt=self.tilt,
                known=self._starts,
            )
            if self.quick:
                self._starts.update((state.approach, state.guess) for state in states)
            return [state.summary() for state in states]

        def solved(done: int) -> None:
            self.observe(len(self._solved) + min(count * done, len(approaches)))

        first = min(float(approaches[0]), 0.0)
        costs = [float(np.sum(part - first)) for part in parts]  # the nearer, the dearer
        solutions = shared(self.comm, len(parts), solve, costs=costs, observe=solved)
        return [row for part in solutions for row in part]

    def _press(self, control: Control, start: Start | None) -> ContactState:
        """Press once; rows are those of rising loads, in whatever order: without plastic depth."""
        return self.model.press(
            control, patches=self.patches, mean_heights=self.mean_heights, start=start
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class IsolatedPatch:
    """One patch of a rough surface, pressed alone by a rigid plane on its own half-space.

    Attributes:
        model: Micro model of the patch alone; its approach counts from the highest point of the
            whole surface.
        patch: The patch as a grid of one.
        mean_height: Mean height of the surface over the patch [mm].
        love: Which displacement of the patch's surface enters the closure: its ``mean``, or the
            one at its ``centre`` (Waddad et al. 2016, eq. 30 at x = y = 0).
    """

    model: MicroModel
    patch: PatchGrid
    mean_height: float
    love: str = "mean"

    @property
    def compliance(self) -> float:
        """Displacement of the patch by a uniform unit pressure on it [mm/MPa] (eq. 29)."""
        return self._displacement(self.love)

    @property
    def first_touch(self) -> float:
        """Approach, and closure, at first touch [mm]; infinite when nothing can touch."""
        return self.model.first_touch

    def rows(self, approaches: Array) -> LawRows:
        """Return rows at approaches of shape (n,) [mm], columns of the same shape."""
        states = press_along(
            self.model, approaches, patches=self.patch, mean_heights=np.array([self.mean_height])
        )
        # exactly nothing before and at first touch, without the rounding of a solution
        loaded = approaches > self.first_touch
        pressure = np.where(loaded, stacked(states, "mean_pressure"), 0.0)
        # the block's closure is a mean over the patch, whichever displacement made the law's
        unresolved = (
            stacked(states, "patch_displacement")[:, 0] - self._displacement("mean") * pressure
        )
        return LawRows(
            approach=approaches,
            closure=approaches - self.compliance * pressure,  # eq. 31
            pressure=pressure,
            contact_area_fraction=np.where(loaded, stacked(states, "contact_area_fraction"), 0.0),
            contacts=np.where(loaded, stacked(states, "contacts"), 0),
            unresolved_displacement=np.where(loaded, unresolved, 0.0),
            outside_range=stacked(states, "warning") != "",
        )

    def law(self, closure_end: float, tolerance: float, most_rows: int = MOST_ROWS) -> PatchLaw:
        """Tabulate the law from first touch to a closure.

        Where the law stops being a function of closure (the patch's stiffness dp/dδ exceeds the
        inverse of its own compliance) it continues over the approach.

        Args:
            closure_end: Largest closure that the law will be used for [mm].
            tolerance: Interpolation error of the pressure, see `refinement.refined`.
            most_rows: Rows that are solved at most.

        Returns:
            The law; open when first touch lies beyond `closure_end`.
        """
        touch = float(self.first_touch)
        separation = float(self.model.reference_height - self.mean_height)
        ends: dict[str, Any] = {"first_touch": touch, "initial_separation": separation}
        if touch >= closure_end:
            return PatchLaw(rows=LawRows.none(), **ends)
        solve, compliance = lambda at: self.rows(at)[:, None], np.array([[self.compliance]])
        make = RowMaker(solve, rising_curves, compliance, separation)
        made = refined(make, touch, self._approach_at(closure_end), tolerance, most_rows)
        rising, change = made.rows[:, 0].rising()
        return PatchLaw(
            rows=rising,
            warning_pressure=rising.warning_pressure,
            repaired=change,
            **ends,
            **made.of_law(0),
        )

    def _displacement(self, love: str) -> float:
        return float(_LOVE[love](*self.patch.half_sizes) / (np.pi * self.model.contact_modulus))

    def _approach_at(self, closure: float) -> float:
        """Return the approach that closes the patch by `closure`, or by as much as it can be."""
        approach = closure
        for _ in range(_MOST_TRIALS):
            reached = self.rows(np.array([approach])).closure[0]
            if reached >= closure:
                return float(approach)
            if reached <= self.first_touch:
                break
            approach += 1.05 * (closure - reached) + 1e-3 * closure
        # closure falls again before it: continue as far as the block's own displacement allows
        pressure = self.rows(np.array([closure])).pressure[0]
        return float(closure + _BEYOND_FALL * self.compliance * pressure)


def isolated_laws(
    model: MicroModel,
    patches: PatchGrid,
    *,
    mean_heights: Array,
    closure_ends: Array,
    love: str = "mean",
    tolerance: float = 1e-3,
    most_rows: int = MOST_ROWS,
    comm: Any = None,
    observe: ProgressObserver | None = None,
) -> LawTable:
    """Tabulate the isolated laws of all patches.

    Args:
        model: Micro model of the whole surface.
        patches: Partition of the surface.
        mean_heights: Mean height of the surface over each patch, shape (N,) [mm].
        closure_ends: Largest closure that each law will be used for, shape (N,) [mm].
        love: Displacement in the closure, ``mean`` or ``centre``.
        tolerance: Interpolation error of the pressure, see `refinement.refined`.
        most_rows: Rows that are solved at most for one law.
        comm: MPI communicator; its ranks share the patches. A patch is solved alone, so that its
            law does not depend on the number of ranks.
        observe: Called as laws are made.

    Returns:
        All laws, on every rank.

    Note:
        Collective.

    Source:
        Waddad et al. 2016, section 3.2, eq. 29-31, doi 10.1016/j.triboint.2015.12.023.
    """
    count = patches.count
    touch = shared(comm, count, lambda index: model.of_patch(patches, index)[0].first_touch)
    # a patch takes the longer the further it is closed, and one that stays open takes nothing
    costs = np.maximum(closure_ends - touch, 0.0).tolist()

    def make(index: int) -> PatchLaw:
        alone, patch = model.of_patch(patches, index)
        isolated = IsolatedPatch(
            model=alone, patch=patch, mean_height=float(mean_heights[index]), love=love
        )
        return isolated.law(float(closure_ends[index]), tolerance, most_rows)

    def made(done: int) -> None:
        (observe or unobserved)("laws of patches", done, count)

    laws = tuple(shared(comm, count, make, costs=costs, observe=made))
    return LawTable(
        patches=patches,
        laws=laws,
        made_by=_made_by("isolated", model, tolerance, love),
        force_error=max(law.interpolation_error for law in laws),
    )
