"""Shear stresses on a face by sliders at its samples, and what load steps leave behind of them.

Theory: docs/theory.md, section 15.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from patchlaw.geometry.rigid_plane import Control, PlaneLevers, ShearControl
from patchlaw.geometry.sliders import (
    MOST_REMEMBERED,
    SliderRecord,
    SliderResponse,
    Sliders,
    SliderState,
    SliderStep,
    solved,
)
from patchlaw.geometry.spring_bed import Friction, springs_of_law, stiffness_ratios
from patchlaw.macro.contact.face_equilibrium import FaceShear
from patchlaw.macro.contact.face_laws import Sampling
from patchlaw.macro.contact.pressed_plane import same_places
from patchlaw.support import Array, Indices, InputError, NotConverged, together

_HELD = ShearControl(shift=(0.0, 0.0))
_UNHELD = 1e-13
"""Stiffness of what sticks in a direction, over the largest, below which nothing does."""

_SAME_PRESSURE = 1e-6
"""Change of a pressure, relative to it, below which slips go on evenly in a load step."""

_MOST_STEPS = 100
_FARTHEST = 4.0
"""Largest first step to the shift, in shifts that all springs could stick over; it doubles while
the force is not reached, as samples that a body has moved far slide over their whole ways."""
_SHORTER = 0.0, 1e-3, 1e-2, 0.1, 1.0, 4.0
"""Parts of the stiffness of springs that all stick, which shorten steps to the shift."""
_ENOUGH = 1e-12
"""Residual of a prescribed shear force, relative to the largest that friction transmits."""

_MOST_CURVE_STEPS, _LESS = 40, 0.5
"""Steps of samples to their curves, and what one past the curve leaves at most of a residual: with
whole steps springs a hundred times as stiff as the body went from slip to slip the other way."""
_TINY = 1e-12
"""Least share of a change of the closure that laws of samples that wear see."""
_FALLS = 0.1
"""Part of the energy that pressures of before took up, from which on they count as falling."""
_CLOSE = 1e-4
"""Residual of a sample's shear stress that ends its steps to its curve, relative to the largest."""


class _Evaluated(NamedTuple):
    """A response of the sliders, and what it is one to."""

    before: SliderState
    at: tuple[Array, ...]
    found: SliderResponse


class FaceSliders:
    """Sliders of the samples of a face under a plane that shifts.

    Slips are s = d − e·u, with the shift d of the plane along the axes e of the face. Shear
    stresses τ(c, s) follow from the sliders as the last accepted load step left them, whatever
    displacements are tried: only `accept` moves them on. A prescribed shear force gives the shift.

    Args:
        sampling: The samples that laws are evaluated at.
        levers: Levers of this rank's samples.
        laws: One law per patch; the same on every rank.
        friction: The friction, or that of each law.
        comm: MPI communicator of the mesh.

    Attributes:
        friction: The friction, as it was given.
        coefficient: Coefficient of friction μ of this rank's samples, shape (n,).
        path_error: Errors of the shear stresses by the springs on any path, over μ p, shape (n,).
        preload: Displacements along the axes by other loads of the body, shape (n, 2) [mm].
        memory: What the load steps so far left behind; set it to take load steps back.
        wearing: Depth that wears off during the load step over its pressures, see `PressedPlane`.

    Raises:
        InputError: On all ranks, when a law has no springs.

    Note:
        Construction and every method are collective.
    """

    def __init__(
        self,
        sampling: Sampling,
        levers: PlaneLevers,
        laws: Sequence[Any],
        friction: Friction | Sequence[Friction],
        comm: Any,
        as_new: Callable[..., tuple[Array, Array]] | None = None,
    ) -> None:
        self._as_new = as_new
        self._sampling, self._levers, self._comm = sampling, levers, comm
        self.friction = friction
        each = [friction] * len(laws) if isinstance(friction, Friction) else friction
        coefficients = np.array([one.coefficient for one in each])
        self.coefficient: Array = coefficients[sampling.patch]
        beds = together(comm, lambda: [springs_of_law(law) for law in _once(laws)])
        known = {id(law): bed for law, bed in zip(_once(laws), beds, strict=True)}
        pairs = zip(laws, each, strict=True)
        ratios = np.concatenate([stiffness_ratios([law], one) for law, one in pairs])
        patch = sampling.patch
        self._sliders = Sliders([known[id(law)] for law in laws], ratios, patch, coefficients)
        errors = [known[id(law)].path_error(one) for law, one in zip(laws, ratios, strict=True)]
        self.path_error: Array = np.array(errors)[patch]
        self.stiffness_ratio: Array = ratios[patch]
        n = len(patch)
        self.preload: Array = np.zeros((n, 2))
        self.memory = SliderRecord(
            place=sampling.places,
            sliders=self._sliders.at_rest,
            stress=np.zeros((n, 2)),
            shift=np.zeros(2),
            direction=np.array([1.0, 0.0]),
            dissipated=0.0,
            path=np.zeros((n, 0, 3)),
        )
        self._control = Control(approach=0.0)
        self._shear = _HELD
        self._shift: Array = np.zeros(2)
        self._latest: _Evaluated | None = None
        self._stepped: tuple[tuple[SliderState, SliderResponse], SliderStep] | None = None
        self.wearing: Array | None = None
        # by parts: path and pressures as far as `_gone` has come, and what it has led to
        self._ways: dict[int, tuple[Array, SliderState, Array, Array]] = {}

    # --- what is prescribed

    def prescribe(self, control: Control) -> None:
        """Set what a load step prescribes of the shear; without any the plane does not shift."""
        self._control, self._shear = control, control.shear or _HELD
        self._shift = self.memory.shift.copy()
        if self._shear.shift is not None:
            self._shift = np.array(self._shear.shift, float)

    def hold_shift(self) -> None:
        """Let the plane stay, whatever shear force is prescribed."""
        self._shear = _HELD

    @property
    def shifts(self) -> bool:
        """Whether the shift follows from a prescribed force."""
        return self._shear.force is not None and self._control.force != 0.0

    # --- stresses

    def respond(
        self, closure: Array, moved: Array, pressure: Array, rate: Array, *, sticks: bool = False
    ) -> SliderResponse:
        """Return the shear stresses of this rank's samples; the plane shifts where it is free to.

        Args:
            closure: Closures, shape (n,) [mm].
            moved: Displacements along the axes, shape (n, 2) [mm].
            pressure: Pressures, shape (n,) [MPa].
            rate: Their derivatives by the closure, shape (n,) [MPa/mm].
            sticks: Whether springs stick whatever they bear.

        Raises:
            NotConverged: When the contact does not transmit the prescribed shear force.
        """
        pressed = np.maximum(pressure, 0.0)

        def respond(shift: Array) -> SliderResponse:
            slip = shift - self.preload - moved
            return self.at_slip(closure, pressed, rate, slip, sticks=sticks)

        if not self.shifts:
            return respond(self._shift)
        most = float(self._levers.loads(self._sampling.weight * self.coefficient * pressure)[0])
        self._shift, found = find_shift(respond, self.total, self._shift, self._control, most)
        return found

    def lines(
        self,
        respond: Callable[..., SliderResponse],
        moved: Array,
        at: tuple[Array, Array],
        shear: Array,
        along: float,
    ) -> ShearLines:
        """Linearise the sliders where samples reach their curves, and a free plane shifts along.

        Springs stick where pressures do not transmit the prescribed shear force yet.

        Args:
            respond: As for `shear_lines`.
            moved: Displacements along the axes, shape (n, 2) [mm].
            at: Closures [mm] and pressures [MPa] that laws are linearised at, shape (n,) each.
            shear: Predicted shear stresses, shape (n, 2) [MPa].
            along: Stiffness of the body [MPa/mm].
        """
        (closure, pressure), still = at, self.preload + moved

        def lines(shift: Array) -> ShearLines:
            return shear_lines(respond, shift - still, closure, shear, along)

        def softened(shift: Array) -> SliderResponse:
            found = lines(shift).response
            by_slip = solved(np.eye(2) + found.by_slip / along, found.by_slip)
            sticking = found.sticking / (1.0 + found.sticking / along)
            return found._replace(by_slip=by_slip, sticking=sticking)

        if self.shifts:
            most = float(self._levers.loads(self._sampling.weight * self.coefficient * pressure)[0])
            start = self._shift, self._control, most
            try:
                self._shift, _ = find_shift(softened, self.total, *start)
            except NotConverged:
                found = respond(self._shift - still, sticks=True)
                return ShearLines(found.slip, closure, found.stress, found)
        return lines(self._shift)

    def on_lines(self, lines: ShearLines, moved: Array, closure: Array) -> Array:
        """Return shear stresses on lines, the plane shifting where it is free to, (n, 2) [MPa].

        Args:
            lines: The lines.
            moved: Displacements along the axes, shape (n, 2) [mm].
            closure: Closures on the lines of pressures, shape (n,) [mm].
        """
        found = lines.at(self.slip(moved), closure)
        if self.shifts:
            assert self._shear.force is not None
            missing = np.array(self._shear.force) - self.total(found)
            moves = self.total(lines.response.by_slip.reshape(-1, 4)).reshape(2, 2)
            self._shift = self._shift + np.linalg.lstsq(moves, missing, rcond=_UNHELD)[0]
            found = lines.at(self.slip(moved), closure)
        return found

    @property
    def stress(self) -> Array:
        """Shear stresses of the latest load step, shape (n, 2) [MPa]."""
        return self.memory.stress

    def slip(self, moved: Array) -> Array:
        """Return the slips under the shift as it is, shape (n, 2) [mm].

        Args:
            moved: Displacements along the axes, shape (n, 2) [mm].
        """
        return self._shift - self.preload - moved

    def at_slip(
        self,
        closure: Array,
        pressure: Array,
        rate: Array,
        slip: Array,
        *,
        sticks: bool = False,
        rows: Indices | None = None,
    ) -> SliderResponse:
        """Return the shear stresses at slips, of all samples or of some of them.

        Where the load step wears, springs are those of the closures of what is left; where the
        roughness runs in, those of the new laws under the same pressures.

        Args:
            closure: Closures of this rank's samples, before they wear, shape (n,) [mm].
            pressure: Pressures, not below zero, shape (n,) [MPa].
            rate: Their derivatives by the closure, shape (n,) [MPa/mm].
            slip: Slips of the samples that are asked for, shape (n, 2) [mm].
            sticks: Whether springs stick whatever they bear.
            rows: The samples that are asked for; None: all.
        """
        left, steep = np.ones_like(rate), rate  # of a change of the closure, at the springs
        if self._as_new is not None:
            closure, steep = self._as_new(self._sampling.patch, pressure, 0.0)
            left = np.divide(rate, steep, out=np.zeros_like(rate), where=steep > 0.0)
        elif self.wearing is not None:
            left = np.maximum(1.0 - self.wearing * rate, _TINY)
            closure, steep = closure - self.wearing * pressure, rate / left
        before, at = self.memory.sliders, (closure, slip, pressure, steep)
        if rows is not None:
            at, left = (closure[rows], slip, pressure[rows], steep[rows]), left[rows]
            found = self._sliders.respond(before, *at, rows=rows)
        elif sticks:
            found = self._sliders.respond(before, *at, sticks=True)
        else:
            found = self._remembered(before, at)
        if self._as_new is None and self.wearing is None:
            return found
        return found._replace(by_closure=found.by_closure * left[:, None])

    def _remembered(self, before: SliderState, at: tuple[Array, ...]) -> SliderResponse:
        """Return the shear stresses of all samples; residual and tangent ask for the same."""
        latest = self._latest
        known = latest is not None and latest.before is before
        if latest is None or not (known and all(map(np.array_equal, at, latest.at))):
            latest = _Evaluated(before, at, self._sliders.respond(before, *at))
            self._latest = latest
        return latest.found

    def total(self, values: Array) -> Array:
        """Return the integrals over the face of values of this rank's samples.

        Args:
            values: The values, shape (n, k).

        Returns:
            Shape (k,), the same on every rank.
        """
        return np.asarray(self._comm.allreduce(self._sampling.weight @ values))

    def with_shift(self, by_slip: Array, change: Array) -> Array:
        """Return changes of shear stresses, the plane shifting where its shear force is prescribed.

        Args:
            by_slip: Stiffnesses of the stresses, shape (n, 2, 2) [MPa/mm].
            change: Their changes under a plane that stays, shape (n, 2) [MPa].
        """
        if not self.shifts:
            return change
        moves = self.total(by_slip.reshape(-1, 4)).reshape(2, 2)
        return change - by_slip @ np.linalg.lstsq(moves, self.total(change), rcond=_UNHELD)[0]

    # --- load steps

    def accept(self, found: SliderResponse) -> None:
        """Move the sliders on to the end of a load step that has converged.

        Args:
            found: The shear stresses there, as `respond` returned them last.
        """
        before = self.memory
        after, shear = self.step(found)
        self._stepped = None  # which would keep the sliders of before
        moved = self._shift - before.shift
        size = float(np.hypot(*moved))
        reached = np.column_stack([found.closure, found.slip])[:, None]
        self.memory = replace(
            before,
            sliders=after,
            stress=found.stress,
            shift=self._shift.copy(),
            direction=moved / size if size else before.direction,
            dissipated=shear.dissipated,
            path=np.concatenate([before.path, reached], axis=1)[:, -MOST_REMEMBERED:],
        )

    def step(self, found: SliderResponse) -> tuple[SliderState, FaceShear]:
        """Return the sliders and the shear of the face by what `respond` returned last."""
        of = self.memory.sliders, found
        if self._stepped is None or any(map(operator.is_not, of, self._stepped[0])):
            self._stepped = of, self._sliders.step(*of)
        step = self._stepped[1]
        lost = float(self.total(step.lost[:, None])[0])
        force, shift = self.total(found.stress), self._shift
        shear = FaceShear(
            shift=(float(shift[0]), float(shift[1])),
            force=(float(force[0]), float(force[1])),
            dissipated=self.memory.dissipated + lost,
            sample_stress=found.stress,
            sample_slip=found.slip,
            stick_closure=step.stick_closure,
        )
        return step.after, shear

    def slid(self, found: SliderResponse, pressure: Array, *, whole: bool) -> tuple[Array, Array]:
        """Return how far samples slide in a load step, (n,) [mm], and how far beside it.

        The energy lost per area is μ p times the first, the slip of contacts in the mean, and μ
        times the second, (n,) [N/mm]: where pressures fall, what they took up before they did.

        Args:
            found: The shear stresses at its end.
            pressure: Pressures there, shape (n,) [MPa].
            whole: Whether all slides on so far that what springs give counts for nothing.
        """
        before, slid = self.memory.sliders, found.slip - self.memory.sliders.slip
        way = np.hypot(*slid.T)
        if whole:
            return way, np.zeros_like(way)
        step, bound = self._sliders.step(before, found), self.coefficient * pressure
        own = step.lost - step.falling
        # that of the mean of both pressures follows the one at the end by half
        own = np.where(step.falling > _FALLS * own, 0.5, 1.0) * own
        own = np.where(bound > 0.0, own, 0.0)
        return np.divide(own, bound, out=way, where=bound > 0.0), (
            step.lost - own
        ) / self.coefficient

    def count_from(self, shift: Array, moved: Array) -> None:
        """Count slips from a place that the plane has come to, without which they have few digits.

        Args:
            shift: What its shift counts as there, shape (2,) [mm].
            moved: Displacements of samples along the axes there, shape (n, 2) [mm].
        """
        known, slip = self.memory, shift - self.preload - moved
        path = known.path.copy()
        path[..., 1:] += (slip - known.sliders.slip)[:, None]
        sliders = replace(known.sliders, slip=slip)
        self.memory = replace(known, sliders=sliders, shift=shift.copy(), path=path)

    def gone_in_parts(
        self, pressures: Callable[[Array], Array], stiffnesses: Callable[[Array], Array], parts: int
    ) -> tuple[Array, Array]:
        """Return what the remembered load steps lead to where their ways are gone in parts.

        Samples reach what they reached after every load step. On the way there slips go on with the
        pressures, as those of a body do under loads that go on together.

        Load steps before those are left out: shear stresses hardly know of them, once springs have
        slipped on, and energies err by the same part, so that they are scaled to those of all.

        Args:
            pressures: The pressures at closures of this rank's samples [MPa].
            stiffnesses: Their derivatives [MPa/mm].
            parts: Number of parts of the first way, of which each has half as many as that before,
                but no fewer than a quarter of the first, and one.

        Returns:
            The shear stresses, shape (n, 2) [MPa], and the energies per area that friction has
            taken up, shape (n,) [N/mm].
        """
        stress, lost = self._gone(pressures, stiffnesses, parts)
        if self.forgets:
            whole = lost if parts == 1 else self._gone(pressures, stiffnesses, 1)[1]
            known = float(self.total(whole[:, None])[0])
            lost = lost * (self.memory.dissipated / known if known > 0.0 else 1.0)
        return stress, lost

    @property
    def forgets(self) -> bool:
        """Whether load steps were too many to remember all of them."""
        return bool(self.memory.path.shape[1] == MOST_REMEMBERED)

    def _gone(
        self, pressures: Callable[[Array], Array], stiffnesses: Callable[[Array], Array], parts: int
    ) -> tuple[Array, Array]:
        path, touch, sliders = self.memory.path, self._sliders.first_touch, self._sliders
        pressed = [pressures(closure) for closure in path[:, :, 0].T]
        ends = np.dstack([path, np.reshape(pressed, path.shape[1::-1]).T])
        stress, lost = np.zeros((len(path), 2)), np.zeros(len(path))
        known, end = self._ways.get(parts), np.insert(np.zeros((len(path), 3)), 0, -np.inf, axis=1)
        state, done = sliders.at_rest, 0
        if known is not None and np.array_equal(known[0], ends[:, : known[0].shape[1]]):
            _, state, stress, lost = known
            done = known[0].shape[1]
            end = ends[:, done - 1]
        for way in range(done, path.shape[1]):
            before, end = end, ends[:, way]
            first, high = np.maximum(before[:, 0], np.minimum(touch, end[:, 0])), end[:, 3]
            low, count = pressures(first), max(parts >> way, parts // 4, 1)
            presses = np.abs(high - low) > _SAME_PRESSURE * np.maximum(high, low)
            for share in np.arange(1, count + 1) / count:
                closure = first + share * (end[:, 0] - first)
                pressure, along = pressures(closure), np.full(len(path), share)
                np.divide(pressure - low, high - low, out=along, where=presses)
                slip = before[:, 1:3] + along[:, None] * (end - before)[:, 1:3]
                at = closure, slip, np.maximum(pressure, 0.0), stiffnesses(closure)
                found = sliders.respond(state, *at)
                step = sliders.step(state, found)
                state, stress, lost = step.after, found.stress, lost + step.lost
        self._ways[parts] = ends, state, stress, lost
        return stress, lost

    def record(self) -> SliderRecord:
        """Return what load steps left behind, of all ranks together."""
        return self.memory.with_ranks(self._comm)

    def restore(self, record: SliderRecord, *, near: bool = False) -> None:
        """Go on from what load steps left behind, on any number of ranks.

        Args:
            record: What `record` returned, of the same laws and samples.
            near: Whether samples are others, which go on as those nearest to them.

        Raises:
            InputError: When it is that of another face.
        """
        own, size = self.memory.place, self._levers.half
        springs = self._sliders.at_rest.stress.shape[2]

        def found() -> Any:
            if record.sliders.stress.shape[2] != springs:
                raise InputError("the sliders are those of other laws")
            return same_places(record.place, own, size, near=near)

        self.memory = replace(record.of(together(self._comm, found)), place=own)

    def follow(self, other: FaceSliders) -> None:
        """Go on from the sliders of other laws on the same samples, as of laws that go further.

        Args:
            other: The sliders of these laws.
        """
        sliders = self._sliders.following(other._sliders, other.memory.sliders)
        self.memory = replace(other.memory, sliders=sliders)


def _once(laws: Sequence[Any]) -> list[Any]:
    """Return the different laws among those of patches, which may have one in common."""
    return list({id(law): law for law in laws}.values())


def find_shift(
    respond: Callable[[Array], SliderResponse],
    total: Callable[[Array], Array],
    shift: Array,
    control: Control,
    most: float,
) -> tuple[Array, SliderResponse]:
    """Find the shift under which the shear stresses have the prescribed sum.

    That is the minimum of a convex function of the shift. Newton's steps are shortened towards
    those on springs that all stick, which are stiffer than any others.

    Args:
        respond: Returns the shear stresses of this rank's samples under a shift, shape (2,) [mm].
        total: Returns integrals over the face of values of samples, shapes (n, k) to (k,).
        shift: The shift to start from, shape (2,) [mm].
        control: What is prescribed: a shear force.
        most: The largest shear force that friction transmits [N].

    Returns:
        The shift, and the shear stresses under it.

    Raises:
        NotConverged: When the contact does not transmit the force.

    Note:
        Collective.
    """
    assert control.shear is not None and control.shear.force is not None
    force, found = np.array(control.shear.force), respond(shift)
    off, farthest = total(found.stress) - force, _FARTHEST
    for _ in range(_MOST_STEPS):
        if np.hypot(*off) <= _ENOUGH * most:
            return shift, found
        resistance = total(found.by_slip.reshape(-1, 4)).reshape(2, 2)
        stiffest = float(total(found.sticking[:, None])[0])
        for share in _SHORTER:
            matrix = resistance + share * stiffest * np.eye(2)
            move = -np.linalg.lstsq(matrix, off, rcond=1e-13)[0]
            move *= min(1.0, farthest * most / (stiffest * float(np.hypot(*move)) or np.inf))
            tried = respond(shift + move)
            left = total(tried.stress) - force
            if left @ move < 0.0 or np.hypot(*left) < np.hypot(*off):
                break
        else:
            if np.hypot(*off) <= 1e3 * _ENOUGH * most:  # rounding
                return shift, found
            break
        farthest = 2.0 * farthest if left @ move < 0.0 else _FARTHEST
        shift, found, off = shift + move, tried, left
    raise NotConverged(
        f"the sliding of the plane at {control}",
        reason="SLIDES" if np.hypot(*force) >= most else "NO_SHIFT",
        iterations=0,
        remedy="take a smaller shear force, a larger force, or prescribe the shift",
    )


class ShearLines(NamedTuple):
    """Shear stresses linearised in slips and closures.

    Attributes:
        slip: Slips of this rank's samples, shape (n, 2) [mm].
        closure: Their closures, shape (n,) [mm].
        stress: Shear stresses there, shape (n, 2) [MPa].
        response: With the derivatives.
    """

    slip: Array
    closure: Array
    stress: Array
    response: SliderResponse

    def at(self, slip: Array, closure: Array) -> Array:
        """Return the shear stresses on the lines, shape (n, 2) [MPa]."""
        found = self.response
        by_slip = np.einsum("nij,nj->ni", found.by_slip, slip - self.slip)
        return self.stress + by_slip + found.by_closure * (closure - self.closure)[:, None]


def shear_lines(
    respond: Callable[..., SliderResponse], slip: Array, closure: Array, stress: Array, along: float
) -> ShearLines:
    """Linearise sliders where samples reach their curves along the body's stiffness.

    Slip bounds what stiff springs would bear, and Newton's method goes back and forth between
    sticking and slipping samples. Sliders are therefore linearised where a sample reaches its curve
    along the stiffness k of the body from the slip s and the stress τ that the last lines
    predicted,

        τ(s') + k s' = τ + k s,

    as pressures are (`law_lines`). A pad of P2 elements with laws of 1 µm took 8 to 10 steps a load
    step, in place of 21 to 25. From springs that all stick Newton's method comes to them from one
    side; where load steps before left stresses behind, steps past a curve are halved.

    Args:
        respond: The shear stresses at slips; with ``sticks=True`` those of springs that stick, with
            ``rows`` those of some of the samples.
        slip: Predicted slips of this rank's samples, shape (n, 2) [mm].
        closure: Their closures, shape (n,) [mm].
        stress: Predicted shear stresses, shape (n, 2) [MPa].
        along: Stiffness of the body [MPa/mm].
    """
    stiff, left = along * np.eye(2), np.arange(len(slip))
    found, at, largest = respond(slip, sticks=True), slip.copy(), 0.0
    move = -solved(found.by_slip + stiff, (found.stress - stress)[..., None])[..., 0]
    excess = np.full_like(slip, np.inf)
    for _ in range(_MOST_CURVE_STEPS):
        tried = at[left] + move[left]
        some = respond(tried, rows=left)
        now = some.stress - stress[left] + along * (tried - slip[left])
        # past the least energy along the step, which is halved where that does not help
        past = (now * move[left]).sum(axis=1) > 0.0
        good = ~past | (np.hypot(*now.T) < _LESS * np.hypot(*excess[left].T))
        rows = left[good]
        at[rows], excess[rows] = tried[good], now[good]
        for values, new in zip(found, some, strict=True):
            values[rows] = new[good]
        move[left] *= 0.5
        move[rows] = -solved(found.by_slip[rows] + stiff, excess[rows, :, None])[..., 0]
        largest = np.abs(some.stress).max(initial=largest)
        left = left[(np.abs(excess[left]) > _CLOSE * largest).any(axis=1)]
        if not len(left):
            break
    return ShearLines(at, closure, found.stress, found)
