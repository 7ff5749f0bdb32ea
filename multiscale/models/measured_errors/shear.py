"""Errors of the shear of a load step by cause, measured in the run by going its path again.

Shear depends on its path. The path is gone once more on half as many cells a side, through its
turning points alone: first as it was, then with fewer modes of the body, and with pressures and
tractions that see each other where the run neglects that. Where the approach is prescribed, the
errors of the normal force by other causes than the grid change the shear force in proportion, as
tangential stiffness and friction both grow with it.

Load steps are halved, few of them again and again, where they matter: where the shear turns aside
or goes on under another load, and where pressures and tractions see each other. Tractions then lift
the plane: what leaving that out changes in the normal load, or its steps, counts among the errors
of that load.

Laws are compared with the cells behind them, whose pressures and tractions see each other.

How far that can be trusted: docs/accuracy.md, measured errors, and
benchmarks/shear_error_study.py.

Theory: docs/theory.md, sections 13 and 15.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from patchlaw.geometry import Control, ShearControl, ShearState, Surface
from patchlaw.geometry.contact_state import ContactState, Start
from patchlaw.micro import FrictionModel, HalfSpaceModel
from patchlaw.micro.friction.coupled import press_coupled
from patchlaw.micro.half_space.error_probe import ZERO, ErrorProbe, other_bodies
from patchlaw.micro.wear import worn_depths
from patchlaw.multiscale.loading.load_step import LoadStep
from patchlaw.multiscale.models.measured_errors.errors import (
    ERRORS_OF,
    MeasuredErrors,
    WearErrors,
    error_columns,
    response_of,
    shear_error_columns,
    worn_error_columns,
)
from patchlaw.support import Array, NotConverged
from patchlaw.support.readable import WHOLE, ProgressObserver

_HALF, _QUARTER, BY_COUPLING = 1.0, 0.25, 1.5
"""Errors over what half as many cells change, over what a quarter changes against half, and over
what the coupling of pressures and tractions changes on half as many cells."""
STEPS, LAST, _PARTS, _OWN_CELLS = 1.5, 2.0, 32, 48
"""Errors by steps over what smaller ones change and this many times what the last halving of them
does; number of smaller steps up to which they are halved again; and cells along a side up to which
that is done on those of the run. Where load and shear grow together, or contacts are pressed with
friction, halving changes the more the smaller steps are as long as they are few: one halving told a
sixth of an error, where at last it is half of it, and 16² cells a twentieth of that of 32²."""
BY_NORMAL = 0.75
"""Least relative error of the shear by the cells over that of the normal force. Where stiffness and
slip err against each other coarser grids may agree by accident: on 2 of 36 scenes they told a
seventh and a half of the error, which was 0.36 and 1.05 of that of the normal force."""
_TOLERANCE = 1e-4
"""Residual of tractions, and of what they and pressures see of each other, on paths gone again."""
FEWEST_CELLS = 16
"""Cells along a side below which half as many show no error."""
_NORMAL = ("body", "slopes", ZERO)
"""Causes of the error of the normal force besides the grid."""


def measured_errors(
    step: LoadStep,
    past: Sequence[LoadStep],
    probe: ErrorProbe,
    friction: FrictionModel | None,
    start: Start | None = None,
    *,
    normal: bool = True,
    pressed: ErrorProbe | None = None,
    wear: WearErrors | None = None,
    walks: Walks | None = None,
) -> dict[str, Any]:
    """Measure the errors of a load step of contacts on cells, and return its columns of them.

    Args:
        step: The load step.
        past: All load steps before it.
        probe: Measures the errors of the normal force.
        friction: Friction on the cells of the run; None without.
        start: The solution of the load step, where the run has it.
        normal: Whether the errors of the normal force are measured, too.
        pressed: Measures them where the surface has worn; `probe` is then about it as it was made.
        wear: What is known of the wear; None where its steps are no cause of their own.
        walks: How far the path of the shear was gone at earlier load steps; it is gone on from
            there, and becomes that of this one.

    Raises:
        NotConverged: When a contact problem cannot be solved.
    """
    contact = shear = found = None
    columns: dict[str, Any] = {}
    if friction is not None and probe.by_laws:
        contact, shear = behind_laws(probe, friction, [*past, step])
    if normal:
        found = _of_normal_force(step, pressed or probe, start, contact)
        if wear is not None:
            found = found.with_wear(step, past, wear)
        columns = error_columns(step, found)
    if friction is None:
        return columns
    parts = shear_errors(probe, friction, [*past, replace(step, **columns)], shear, walks)
    lifting = {"steps": friction.in_turn, "coupling": not friction.coupled}
    if found is not None:
        for cause in (one for one, lifts in lifting.items() if lifts and one in parts):
            load, area, gap = parts[cause][3:6].tolist()
            force, approach = (0.0, load) if step.by_force else (load, 0.0)
            found = found.with_cause(step, cause, force, approach, area, gap)
        columns = error_columns(step, found)
    if friction.wear:
        columns |= worn_error_columns(step, {cause: part[6:] for cause, part in parts.items()})
    return columns | shear_error_columns(step, parts)


def _of_normal_force(
    step: LoadStep, probe: ErrorProbe, start: Start | None, behind: ContactState | None
) -> MeasuredErrors:
    """Return the errors of the normal force, and of what else is read off; see `ErrorProbe`."""
    own, known = step.interface_stiffness_N_per_mm, step.approach_stiffness_N_per_mm
    conducts = step.thermal_conductance_W_per_K, step.electrical_conductance_S
    wanted = {own, known, *conducts} != {None}
    found = probe.measure(
        np.array([step.force_N, *(getattr(step, name) for name in ERRORS_OF)]),
        step.approach_mm,
        step.tilt,
        start=start,
        turns=step.turned_freely,
        stiffness=step.by_force and known is None,
        behind=behind,
        by_force=step.by_force,
        stiffnesses=(own or math.nan, known or math.nan) if wanted else None,
        elastic=bool(own) and not step.stiffness_scatter,
    )
    return MeasuredErrors(
        by_cause=found.by_cause,
        stiffness=found.stiffness if known is None else known,
        zero=found.zero,
    )


def shear_errors(
    probe: ErrorProbe,
    friction: FrictionModel,
    steps: Sequence[LoadStep],
    behind: ShearState | None = None,
    walks: Walks | None = None,
) -> dict[str, Array]:
    """Measure the errors of the shear of the last of some load steps.

    Args:
        probe: The normal contact, on any cells.
        friction: Friction on the cells of the run.
        steps: All load steps up to that one.
        behind: The shear of the cells behind laws, see `behind_laws`, where the load steps come
            from laws; all that differs is then an error by the laws.
        walks: See `measured_errors`.

    Returns:
        By cause the errors of the shear force where the shift is prescribed [N], of the shift where
        the shear force is [mm]; of the energy lost [N mm]; of the area that slips over the nominal
        one; and, by coupling and steps, of the approach where the force is prescribed [mm], of the
        force where the approach is [N], of the contact area fraction, and of the mean separation
        [mm]; of the mean and of the largest worn depth [mm]; shape (8,); infinite where they are
        not measured.
    """
    step, grid = steps[-1], probe.model.surface.grid
    if min(grid) < FEWEST_CELLS:
        return {"grid": np.full(8, math.inf)}
    if behind is not None:
        friction = replace(friction, coupled=True)
    by_steps = friction.in_turn or not _is_straight(steps)
    if behind is not None or not by_steps:
        steps = turning_points(steps, every_load=behind is not None)
    path = _Path(probe, friction, steps, {} if walks is None else walks, _Meter(probe.tell))
    own, parts = path.answer_of(step), dict[str, Array]()
    size = np.append(np.hypot(*own[:2]), own[2:])
    if behind is not None:
        area = step.contact_area_fraction
        cells = np.append(_answers(behind, area, by_shift=step.by_shift), own[4:])
        parts["laws"] = _apart(own, cells)
        own = cells
    half, quarter = path.on(2), path.on(4)
    varied = list(_varied(half[1], half[0].surface.grid))
    # behind laws pressures and tractions are solved in turn
    times = [] if not by_steps else [2] * len(steps) if behind is not None else _times_of(steps)
    on = path.on(1) if times and behind is None and max(grid) <= _OWN_CELLS else half
    path.expect([half, quarter, *[half] * len(varied)], on[0], times)
    again = path.answer("half", *half)
    of_normal = dict(step.errors).get("grid", 0.0) / step.force_N if step.force_N else 0.0
    by_cells = grid_error(_apart(again, own), _apart(path.answer("quarter", *quarter), again))
    parts["grid"] = np.maximum(by_cells, BY_NORMAL * of_normal * size)
    for number, (cause, factor, other) in enumerate(varied):
        change = _apart(path.answer(f"{cause} {number}", half[0], other), again)
        parts[cause] = parts.get(cause, 0.0) + factor * change
    if times:
        parts["steps"] = path.by_steps(on, again if on is half else own, times)
    if not step.by_force and step.force_N > 0.0:
        others = sum(error for cause, error in step.errors if cause in _NORMAL)
        parts["normal force"] = size * others / step.force_N
    return parts


def _varied(
    friction: FrictionModel, grid: tuple[int, int]
) -> Iterator[tuple[str, float, FrictionModel | None]]:
    """Yield causes, errors over what varying them changes, and the friction that is varied.

    None stands for one that is not known.
    """
    for body in [] if friction.body is None else other_bodies(friction.body):
        yield "body", 1.0, None if body is None else replace(friction, body=body)
    if not friction.coupled and friction.cross(grid) is not None:
        yield "coupling", BY_COUPLING, replace(friction, coupled=True)


class _Walk(NamedTuple):
    """A path as far as it was gone: its surface, its controls, and contact and shear at the end."""

    surface: Surface
    path: list[Control]
    end: tuple[ContactState, ShearState] | None


_Contact = tuple[HalfSpaceModel, FrictionModel]
Walks = dict[str, _Walk]
"""Paths by what they are gone on."""


class _Meter:
    """Tells how much of some paths was gone, in percent of the cells that are pressed there."""

    def __init__(self, tell: ProgressObserver) -> None:
        self._tell, self._pressed, self.whole = tell, 0, 1.0

    def add(self, cells: int) -> None:
        """Add the cells of a contact that was pressed."""
        self._tell("check of friction", min(int(100.0 * self._pressed / self.whole), 99), WHOLE)
        self._pressed += cells


class _Path(NamedTuple):
    """A path of load steps that is gone again on other cells, bodies or steps.

    An answer is its end: the shear force where the shift is prescribed, else the shift, the energy
    lost, the area that slips over the nominal one, the approach where the force is prescribed, else
    the force, the contact area fraction, the mean separation, the mean and the largest worn depth,
    shape (9,).
    """

    probe: ErrorProbe
    friction: FrictionModel
    steps: Sequence[LoadStep]
    walks: Walks
    meter: _Meter

    def expect(
        self, whole: Sequence[_Contact], parted: HalfSpaceModel, times: Sequence[int]
    ) -> None:
        """Estimate what all answers take, from where the first of them was at the step before.

        Args:
            whole: Contacts of answers with whole steps.
            parted: The contact of two answers with steps in parts, in all of them and in half.
            times: Numbers of parts of every load step.
        """
        begun = len(self.walks["half"].path) if "half" in self.walks else 0
        cells = sum(math.prod(contact.surface.grid) for contact, _ in whole)
        parts = 1.5 * sum(times[begun:]) * math.prod(parted.surface.grid)
        self.meter.whole = max(len(self.steps) - begun, 1) * cells + parts

    def on(self, coarser: int) -> _Contact:
        """Return contact and friction on so many times fewer cells a side."""
        nx, ny = self.probe.model.surface.grid
        return resampled(self.probe, self.friction, (nx // coarser, ny // coarser))

    def answer_of(self, step: LoadStep) -> Array:
        """Return the answer of a load step itself."""
        along = response_of(step)
        load = step.approach_mm if step.by_force else step.force_N
        slips, off = step.slip_area_fraction or 0.0, (getattr(step, name) for name in ERRORS_OF)
        worn = step.mean_worn_depth_mm or 0.0, step.worn_depth_mm or 0.0
        return np.array([*along, step.dissipated_mJ or 0.0, slips, load, *off, *worn])

    def answer(
        self,
        name: str,
        contact: HalfSpaceModel,
        friction: FrictionModel | None,
        times: Sequence[int] | None = None,
    ) -> Array:
        """Return the answer on other problems, with every step in parts; infinite if not found.

        Args:
            name: What the problems are, as they were at earlier load steps.
            contact: The normal contact.
            friction: Friction on its cells; None where it is not known.
            times: Numbers of parts of every load step; None: they are whole.
        """
        surface, walk = self.probe.model.surface, self.walks.pop(name, None)
        path, before = parted_path(self.steps, times), _Walk(surface, [], None)
        if walk and walk.surface is surface and walk.path == path[: len(walk.path)]:
            before = walk
        if friction is None:
            return np.full(9, np.inf)
        try:
            left, last = path[len(before.path) :], before.path[-1] if before.path else None
            state, shear = gone(contact, friction, left, before.end, last, self.meter.add)
        except NotConverged:
            return np.full(9, np.inf)
        self.walks[name] = _Walk(surface, path, (state, shear))
        end, area = self.steps[-1], state.contact_area_fraction
        load = state.approach if end.by_force else state.force
        normal = load, area, state.mean_separation, *worn_depths(state)
        return np.append(_answers(shear, area, by_shift=end.by_shift), normal)

    def by_steps(self, on: _Contact, whole: Array, times: Sequence[int]) -> Array:
        """Return the errors of the answer by the load steps; see `error_by_steps`."""
        errors = error_by_steps(
            lambda times: self.answer(f"in {times[0]}", *on, times), whole, times, _apart
        )
        # of the area that slips, no less than two cells, which slip or stick as a whole
        errors[2] = max(errors[2], 2.0 / math.prod(on[0].surface.grid))
        return errors


def _is_straight(steps: Sequence[LoadStep]) -> bool:
    """Tell whether a shear goes along one line under one load: its steps do not matter then."""
    sheared = [(step, response_of(step, prescribed=True)) for step in steps]
    first = next((k for k, (_, pair) in enumerate(sheared) if pair.any()), len(steps))
    if first == 0:
        return False  # load and shear grow together from nothing
    rest = sheared[first - 1 :]
    largest = max((pair for _, pair in rest), key=lambda pair: float(np.hypot(*pair)))
    beside = (abs(float(pair[0] * largest[1] - pair[1] * largest[0])) for _, pair in rest)
    one_line = max(beside) <= 1e-9 * float(largest @ largest)
    return one_line and all(_same_load(rest[-1][0], one) for one, _ in rest)


def error_by_steps(
    answer: Callable[[Sequence[int]], Array],
    whole: Array,
    times: Sequence[int],
    apart: Callable[[Array, Array], Array],
) -> Array:
    """Return the errors of answers by the load steps.

    Args:
        answer: Returns the answers with every load step in so many parts.
        whole: The answers with the load steps as they are.
        times: Number of parts of every load step, see `parts_of`.
        apart: Returns how far answers are apart.
    """
    fine = answer(times)
    coarser = whole if max(times) == 2 else answer([count // 2 for count in times])
    return STEPS * (apart(fine, whole) + LAST * apart(fine, coarser))


def parts_of(count: int) -> int:
    """Return the number of parts that each of some load steps is gone again in, at most.

    Args:
        count: Number of load steps.
    """
    return max(2, 2 ** int(math.log2(max(_PARTS / count, 1.0))))


def _times_of(steps: Sequence[LoadStep]) -> list[int]:
    """Return the numbers of parts of load steps: those when they were measured first.

    A path in as many parts goes on from where it ended then.
    """
    counts = [n for n, step in enumerate(steps, 1) if step.shear_errors or step is steps[-1]]
    return [parts_of(min(n for n in counts if n > before)) for before in range(len(steps))]


def parted_path(steps: Sequence[LoadStep], times: Sequence[int] | None = None) -> list[Control]:
    """Return what load steps prescribe, with each way to them, the first from nothing, in parts.

    Args:
        steps: The load steps.
        times: Numbers of parts of each; None: they are whole.
    """
    ends = np.array([_values(step) for step in steps])
    nothing = ends[:1] * [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0]  # tilted, with its loads
    counts = [1] * len(steps) if times is None else times
    ways = zip(np.concatenate([nothing, ends[:-1]]), ends, steps, counts, strict=True)
    return [
        _control((1.0 - share) * before + share * after, step)
        for before, after, step, count in ways
        for share in np.arange(1, count + 1) / count
    ]


def _values(step: LoadStep) -> list[float]:
    """Return approach, force, shear force, shift, slopes and position among the bodies' loads."""
    force = step.shear_force_x_N or 0.0, step.shear_force_y_N or 0.0
    shift = step.shear_x_mm or 0.0, step.shear_y_mm or 0.0
    return [step.approach_mm, step.force_N, *force, *shift, *step.tilt, step.body_state]


def _control(values: Array, step: LoadStep) -> Control:
    """Return what a load step with such values prescribed."""
    approach, force, *pairs, body_state = values.tolist()
    shear_force, shift, tilt = zip(pairs[::2], pairs[1::2], strict=True)
    load = {"force": force} if step.by_force else {"approach": approach}
    return Control(
        **load,
        tilt=None if step.turned_freely else tilt,
        shear=ShearControl(shift=shift) if step.by_shift else ShearControl(force=shear_force),
        body_state=body_state,
    )


def behind_laws(
    probe: ErrorProbe, friction: FrictionModel, steps: Sequence[LoadStep]
) -> tuple[ContactState, ShearState]:
    """Return the contact that laws with friction stand for, by going their path on cells.

    Pressures and tractions see each other there, as they do on the meshed body of the laws.

    Args:
        probe: The normal contact, on the cells that the laws were made from.
        friction: Friction on these cells.
        steps: All load steps up to the one that is wanted.

    Returns:
        The contact under the approach of the load step, and the shear under its load.

    Raises:
        NotConverged: When a contact problem cannot be solved.
    """
    normal, cells = resampled(probe, friction, probe.model.surface.grid)
    cells = replace(cells, coupled=True)
    *path, last = parted_path(turning_points(steps, every_load=True))
    before = gone(normal, cells, path) if path else None
    state, shear = gone(normal, cells, [last], before)
    if last.force is not None:
        same = replace(last, force=None, approach=steps[-1].approach_mm)
        state, _ = gone(normal, cells, [same], before)
    return state, shear


def _answers(shear: ShearState, contact_area_fraction: float, *, by_shift: bool) -> Array:
    """Return the shear force, or the shift where that follows, energy lost and slip, shape (4,)."""
    part = shear.slipping.sum() / max(int(shear.closed.sum()), 1) * contact_area_fraction
    return np.array([*(shear.force if by_shift else shear.shift), shear.dissipated, part])


def resampled(
    probe: ErrorProbe, friction: FrictionModel, grid: tuple[int, int], tolerance: float = _TOLERANCE
) -> tuple[HalfSpaceModel, FrictionModel]:
    """Return the normal contact and its friction on other cells, with a residual of tractions."""
    tolerance = max(tolerance, friction.tolerance)
    normal = probe.on_body(probe.model.resampled(grid), probe.order)
    return normal, replace(friction, spacing=normal.surface.spacing, tolerance=tolerance)


def grid_error(half: Array, quarter: Array) -> Array:
    """Return errors by the cells.

    Args:
        half: Changes on half as many cells a side.
        quarter: Changes from there to a quarter.
    """
    return np.maximum(_HALF * half, _QUARTER * quarter)


def turning_points(steps: Sequence[LoadStep], *, every_load: bool = False) -> list[LoadStep]:
    """Return the load steps that the path of a shear cannot do without.

    Those are left out that lie on a straight way of the shear under one normal load, and those of a
    rising load before any shear.

    Args:
        steps: The load steps.
        every_load: Whether rising loads count before any shear, as on laws, which slip under them.
    """
    kept: list[LoadStep] = []
    for step, after in zip(steps, [*steps[1:], None], strict=True):
        before = kept[-1] if kept else None
        if after is None or not _between(before, step, after, every_load):
            kept.append(step)
    return kept


def _between(before: LoadStep | None, step: LoadStep, after: LoadStep, every_load: bool) -> bool:
    here, there = (response_of(one, prescribed=True) for one in (step, after))
    if not (here.any() or there.any()):
        return not every_load and step.force_N <= after.force_N
    if before is None or not all(_same_load(step, one) for one in (before, after)):
        return False
    first, second = here - response_of(before, prescribed=True), there - here
    return bool(first @ second >= (1.0 - 1e-9) * np.hypot(*first) * np.hypot(*second))


def _same_load(one: LoadStep, other: LoadStep) -> bool:
    near = math.isclose(one.force_N, other.force_N, rel_tol=1e-8)
    return near or one.approach_mm == other.approach_mm


def gone(
    normal: HalfSpaceModel,
    friction: FrictionModel,
    path: Sequence[Control],
    before: tuple[ContactState, ShearState] | None = None,
    last: Control | None = None,
    begin: Callable[[int], object] = bool,
) -> tuple[ContactState, ShearState]:
    """Return the contact and its shear at the end of a path, from nothing or from those before.

    Args:
        normal: The normal contact.
        friction: Friction on its cells.
        path: What is prescribed on the way.
        before: Where it begins.
        last: What was prescribed there.
        begin: Called as each contact on the way is pressed, with the number of its cells.
    """
    last = last and replace(last, shear=None)
    state, shear = before or (None, None)
    for control in path:
        assert control.shear is not None
        begin(math.prod(normal.surface.grid))
        start = None if state is None else state.start
        if friction.in_turn:
            state, shear = press_coupled(normal, friction, control, shear, start=start)
        else:
            load = replace(control, shear=None)
            if state is None or last != load:
                state, last = normal.press(control, start=start), load
            shear = friction.advance(shear, state.pressures, control.shear)
    assert state is not None and shear is not None
    return state, shear


def _apart(one: Array, other: Array) -> Array:
    """Return how far answers are apart, shape (8,); infinite where one is not known."""
    if not (np.isfinite(one).all() and np.isfinite(other).all()):
        return np.full(8, math.inf)
    x, y, *others = one - other
    return np.abs([np.hypot(x, y), *others])
