"""The rigid plane that presses on a rough surface: what is prescribed of it, and where it is.

The plane has three motions: its approach δ at the centre (xc, yc) of the interface, and its slopes
tx and ty. At a point (x, y) it comes nearer by δ + tx (x − xc) + ty (y − yc), that is by the row
(1, x − xc, y − yc) of the lever matrix times (δ, tx, ty). The transpose of that matrix sums forces
at points to the loads of the plane: the force and its two first moments about the centre.

These loads are the gradient of a convex energy over the approach and the slopes, of which those are
free that no load step prescribes. In equilibrium the force is the prescribed one, and there is no
moment about the centre. A step of Newton's method is shortened or lengthened until the slope of the
energy along it has fallen, which always ends. Against a motion that no contact resists the plane
goes on until one does.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any, Generic, NamedTuple, Protocol, Self, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from patchlaw.geometry.patches import PatchGrid
from patchlaw.support import Array, Flags, InputError, Limits, NotConverged, check_fields


class Rectangular(Protocol):
    """Anything on a rectangle that starts at the origin, such as a surface."""

    @property
    def lengths(self) -> tuple[float, float]:
        """Sides (Lx, Ly) [mm]."""
        ...


Pair = tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class ShearControl:
    """Shift of the plane along the surface, or shear force on it, at one load step.

    Args:
        shift: Shift of the plane along x and y from where it first touched [mm]; None when the
            force is prescribed.
        force: Shear force on the plane along x and y [N]; None when the shift is prescribed.

    Raises:
        InputError: When not exactly one of them is given, or it is no pair of finite numbers.
    """

    shift: Pair | None = None
    force: Pair | None = None

    def __post_init__(self) -> None:
        check_fields(self)
        if (self.shift is None) == (self.force is None):
            raise InputError(
                "a load step prescribes either the shift or the shear force",
                value=(self.shift, self.force),
                allowed="exactly one of them",
            )

    @property
    def pair(self) -> Pair:
        """The shift [mm] or the shear force [N]."""
        return self.shift or self.force or (0.0, 0.0)

    def __str__(self) -> str:
        """Say what shears, as in "shear force (2, 0) N"."""
        if self.force is not None:
            return f"shear force ({self.force[0]:.6g}, {self.force[1]:.6g}) N"
        assert self.shift is not None
        return f"shift ({self.shift[0]:.6g}, {self.shift[1]:.6g}) mm"


_Slope = Annotated[float, Limits(ge=-1, le=1)]  # by far beyond what small slopes allow


@dataclass(frozen=True, slots=True, kw_only=True)
class Control:
    """Approach or force, and tilt or zero moment, of the rigid plane at one load step.

    Args:
        approach: Approach at the middle of the interface, from first touch [mm]; None when the
            force is prescribed.
        force: Normal force, ≥ 0 [N]; None when the approach is prescribed.
        tilt: Slopes (tx, ty) of the approach about the middle of the interface, up to ±1 [mm/mm];
            None lets the plane turn until the pressures have the prescribed moment about it.
        moment: First moments of the pressures about the middle where the plane turns, as bolts
            prescribe them [N mm].
        body_state: Position in the history of the other loads of the bodies: 0.25 is a quarter of
            the way from their first state to the second.
        shear: Shift of the plane along the surface, or shear force on it; None without friction.
        slid: Distance that the surfaces have slid on each other so far, which wears them [mm].

    Raises:
        InputError: When not exactly one of approach and force is given, or a number is not finite,
            the force negative or the plane steeper than 45°.
    """

    approach: float | None = None
    force: Annotated[float, Limits(ge=0)] | None = None
    tilt: tuple[_Slope, _Slope] | None = (0.0, 0.0)
    moment: tuple[float, float] = (0.0, 0.0)
    body_state: Annotated[float, Limits(ge=0)] = 0.0
    shear: ShearControl | None = None
    slid: Annotated[float, Limits(ge=0)] = 0.0

    def __post_init__(self) -> None:
        check_fields(self)
        if (self.approach is None) == (self.force is None):
            raise InputError(
                "a load step prescribes either the approach or the force",
                value=(self.approach, self.force),
                allowed="exactly one of them",
            )

    def __str__(self) -> str:
        """Say what presses, as in "force 2 N"."""
        along = "" if self.shear is None else f", {self.shear}"
        if self.force is not None:
            return f"force {self.force:.6g} N{along}"
        return f"approach {self.approach:.6g} mm{along}"

    @property
    def loads(self) -> Array:
        """Loads along free motions: the force and the moments, shape (3,) [N, N mm]."""
        return np.array([self.force or 0.0, *self.moment])

    @property
    def free(self) -> Flags:
        """Which of approach and slopes follow from the loads, shape (3,).

        Without force nothing turns the plane, and it is placed where it touches first.
        """
        turns = self.tilt is None and self.force != 0.0
        return np.array([bool(self.force), turns, turns])

    def prescribed(self, motion: Array) -> Array:
        """Return a plane's approach and slopes, shape (3,), with the prescribed ones put in."""
        plane = np.array(motion, dtype=np.float64)
        if self.approach is not None:
            plane[0] = self.approach
        if self.tilt is not None:
            plane[1:] = self.tilt
        return plane


@dataclass(frozen=True, slots=True, kw_only=True)
class RigidPlane:
    """A rigid plane with the approach δ + tx (x − xc) + ty (y − yc), from first touch when level.

    Args:
        approach: δ at the centre of the rectangle [mm].
        tilt: Slopes (tx, ty) [mm/mm].
        centre: Point (xc, yc) that the plane turns about [mm]; None: the middle of the face that
            it presses, as with a `Control`. Without a centre only a level plane has an approach
            at points.

    Raises:
        InputError: When a number is not finite or the tilt is not a pair.
    """

    approach: float
    tilt: tuple[float, float] = (0.0, 0.0)
    centre: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        check_fields(self)

    @classmethod
    def above(
        cls, rough: Rectangular, approach: float, tilt: tuple[float, float] = (0.0, 0.0)
    ) -> Self:
        """Return the plane that turns about the centre of a surface's rectangle.

        Args:
            rough: The surface.
            approach: Approach at the centre [mm].
            tilt: Slopes (tx, ty).
        """
        lx, ly = rough.lengths
        return cls(approach=float(approach), tilt=tilt, centre=(0.5 * lx, 0.5 * ly))

    @classmethod
    def moved(cls, rough: Rectangular, motion: Array) -> Self:
        """Return the plane above a surface whose approach and slopes are a vector.

        Args:
            rough: The surface.
            motion: Approach [mm] and slopes, shape (3,).
        """
        approach, tx, ty = map(float, motion)
        return cls.above(rough, approach, (tx, ty))

    @property
    def motion(self) -> Array:
        """Approach [mm] and slopes as a vector, shape (3,)."""
        return np.array([self.approach, *self.tilt])

    def at(self, x: Array, y: Array) -> Array:
        """Return the approach at points [mm].

        Args:
            x: Abscissae [mm].
            y: Ordinates [mm].

        Raises:
            InputError: When the plane is tilted, and its centre is not known.
        """
        (tx, ty), (xc, yc) = self.tilt, self._known_centre if any(self.tilt) else (0.0, 0.0)
        return self.approach + tx * (x - xc) + ty * (y - yc)

    def means(self, patches: PatchGrid) -> Array:
        """Return the mean approach over every patch, shape (N,) [mm]."""
        return self.at(*patches.centres.T)

    def moment(self, x: Array, y: Array, force: Array) -> tuple[float, float]:
        """Return the first moments of forces at points about the centre [N mm].

        Args:
            x: Abscissae [mm].
            y: Ordinates [mm].
            force: The forces [N].

        Raises:
            InputError: When the centre is not known.
        """
        (xc, yc), force = self._known_centre, np.asarray(force)
        sums = "xy,xy->" if force.ndim == 2 else "x,x->"  # without products as large as the forces
        arms = (np.broadcast_to(arm, force.shape) for arm in (x - xc, y - yc))
        along_x, along_y = (float(np.einsum(sums, force, arm)) for arm in arms)
        return along_x, along_y

    @property
    def _known_centre(self) -> tuple[float, float]:
        if self.centre is None:
            raise InputError(
                "a plane that turns about the middle of its face is not placed without the face",
                value=self,
                allowed="centre = (xc, yc), or RigidPlane.above(surface, …)",
            )
        return self.centre


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlaneLevers:
    """How the motions of a plane move points, and how forces at the points load the plane.

    Args:
        matrix: Displacements of this rank's points by unit motions, columns 1, x − xc, y − yc,
            shape (n, 3) [1, mm, mm].
        half: Half the diagonal of the interface, by which moments are compared with forces [mm].
        comm: MPI communicator (mpi4py) whose ranks share the points; None for a single process.

    Note:
        Methods that sum over the points are collective.
    """

    matrix: Array
    half: float
    comm: Any = None

    @classmethod
    def at(
        cls,
        x: Array,
        y: Array,
        lengths: tuple[float, float],
        *,
        centre: ArrayLike | None = None,
        comm: Any = None,
    ) -> Self:
        """Return the levers of points.

        Args:
            x: Abscissae of the points, shape (n,) [mm].
            y: Their ordinates, shape (n,) [mm].
            lengths: Sides (Lx, Ly) of the interface [mm].
            centre: Centre (xc, yc) that the plane turns about [mm]; by default that of an interface
                that begins at the origin.
            comm: MPI communicator (mpi4py); None for a single process.
        """
        xc, yc = 0.5 * np.asarray(lengths) if centre is None else np.asarray(centre)
        matrix = np.column_stack((np.ones_like(x), x - xc, y - yc))
        return cls(matrix=matrix, half=0.5 * float(np.hypot(*lengths)), comm=comm)

    @property
    def unit(self) -> Array:
        """Approach and slopes by which the interface's corner moves 1 mm, shape (3,)."""
        return motion_units(self.half)

    def scaled(self, free: Flags) -> Array:
        """Return what the free motions in `unit` move the points by, shape (n, k)."""
        return self.matrix[:, free] * self.unit[free]

    def loads(self, forces: Array) -> Array:
        """Return force and first moments about the centre, shape (3,) [N, N mm].

        Args:
            forces: Forces at the points, shape (n,) [N].
        """
        return self.summed(self.matrix.T @ forces)

    def stiffness(self, rates: Array) -> Array:
        """Return the derivative of the loads by the motions, shape (3, 3).

        Args:
            rates: Derivatives of the forces at the points by their displacements, shape (n,)
                [N/mm].
        """
        return self.summed(self.matrix.T @ (rates[:, None] * self.matrix))

    def first_touch(self, depth: Array, tilt: ArrayLike) -> float:
        """Return the approach at which a tilted plane first touches the points [mm].

        Args:
            depth: Depths below the height that approaches count from, shape (n,) [mm].
            tilt: Slopes (tx, ty).
        """
        least = float(np.min(depth - self.matrix[:, 1:] @ np.asarray(tilt), initial=np.inf))
        return least if self.comm is None else float(min(self.comm.allgather(least)))

    def summed(self, values: Array) -> Array:
        """Return the sum over all ranks."""
        return values if self.comm is None else self.comm.allreduce(values)


def way_of_approach(stiffness: Array, *, turns: bool) -> Array:
    """Return approach and slopes of a plane that comes nearer by a unit, shape (3,).

    Args:
        stiffness: Derivative of force and first moments by approach and slopes, shape (3, 3).
        turns: Whether the plane turns without moment; otherwise its slopes stay.
    """
    way = np.array([1.0, 0.0, 0.0])
    if turns:
        way[1:] = -np.linalg.lstsq(stiffness[1:, 1:], stiffness[1:, 0], rcond=1e-12)[0]
    return way


def motion_units(half: float) -> Array:
    """Return approach and slopes by which an interface's corner moves 1 mm, shape (3,).

    Args:
        half: Half the diagonal of the interface [mm].
    """
    return np.array([1.0, 1.0 / half, 1.0 / half])


def plane_failure(control: Control, reason: str) -> NotConverged:
    """Return the error of a plane that finds no equilibrium.

    Args:
        control: What is prescribed of it.
        reason: The name of the reason.
    """
    remedies = {
        "NO_CONTACT": "no patch can be touched",
        "NO_RELEASE": "the laws press however far the plane is",
        "NO_SUPPORT": "no further patch can be touched that would hold the plane: prescribe its "
        "tilt (load.tilt) or take more patches (patches.grid)",
    }
    usual = "take more load steps (load.steps) or prescribe the tilt (load.tilt)"
    return NotConverged(
        f"the equilibrium of the plane at {control}",
        reason=reason,
        iterations=0,
        remedy=remedies.get(reason, usual),
    )


T = TypeVar("T")

TOLERANCE = 1e-10
"""Largest residual of force and moments, over the force and over that times half the diagonal."""

UNSUPPORTED = 1e-11
"""Stiffness against a motion of the plane, relative to the largest, that counts as none."""

_AIM = 1e-13
"""The same that is aimed at, as far as the rounding of displacements allows it."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlaneResponse(Generic[T]):
    """What contacts do to a rigid plane at one position.

    Args:
        loads: Force and first moments about the centre, shape (3,) [N, N mm].
        stiffness: Returns the derivative of the loads by approach and slopes, symmetric, shape
            (3, 3).
        state: Whatever else is known of the contacts.
    """

    loads: Array
    stiffness: Callable[[], Array]
    state: T


class _Trial(NamedTuple, Generic[T]):
    """A plane, and its residual loads along the free motions: force, moments over ``half`` [N]."""

    plane: Array
    residual: Array
    force: float
    response: PlaneResponse[T]


def find_equilibrium(
    respond: Callable[[Array], PlaneResponse[T]],
    control: Control,
    start: Array,
    half: float,
    *,
    aim: float = _AIM,
    first_touch: float | None = None,
) -> tuple[Array, T]:
    """Find the plane whose loads are those prescribed.

    Args:
        respond: Returns what the contacts do to a plane (3,).
        control: What is prescribed.
        start: Approach and slopes to start from, with those that are prescribed, shape (3,).
        half: Half the diagonal of the interface [mm].
        aim: Residual of force and moments to aim at, relative to the force and to that times
            ``half``; `TOLERANCE` is accepted where no step brings them closer.
        first_touch: Approach of first touch under the slopes of the start [mm], where contacts
            may refuse to be pressed farther than their model can bear: steps are shortened then,
            and the start retreats. None where a refusal is final.

    Returns:
        Approach and slopes, shape (3,), and the state of the contacts there.

    Raises:
        NotConverged: When nothing can hold the plane, no equilibrium is found, or loads are not
            numbers.
    """
    motions = _FreeMotions(respond, control, half, final=first_touch is None)
    now = motions.begun(np.array(start, dtype=np.float64), first_touch)
    largest = 0.0
    for _ in range(100):
        measure = max(now.force, control.force or 0.0)
        if np.abs(now.residual).max(initial=0.0) <= aim * measure:
            return now.plane, now.response.state
        largest = max(largest, measure)
        stiffness = motions.stiffness(now)
        # where nothing resists, a millionth of half the diagonal is tried first
        step, resisted = _direction(stiffness, now.residual, aim * measure, 1e-6 * half)
        rounding = 64.0 * float(np.finfo(float).eps) * motions.size(now.plane)
        if resisted and np.abs(step).max() <= rounding:
            now = motions.trial(motions.moved(now, step))  # displacements allow no more
            return now.plane, now.response.state
        if control.force is None and measure <= 1e-6 * largest:
            # Newton's steps alone come ever closer to a plane that is clear, and never there
            clear = motions.trial(motions.moved(now, 3.0 * step))
            if clear.force == 0.0:
                return clear.plane, clear.response.state
        reached = motions.searched(now, step)
        if reached is None:
            break
        now = reached
    measure = max(now.force, control.force or 0.0)
    if np.abs(now.residual).max() <= max(aim, TOLERANCE) * measure:
        return now.plane, now.response.state
    raise plane_failure(control, "NO_EQUILIBRIUM")


class _FreeMotions(Generic[T]):
    """The motions of a plane that follow from its loads, each a displacement of its corner [mm].

    Args:
        respond: As in `find_equilibrium`.
        control: As there.
        half: As there.
        final: Whether a refusal of the contacts ends the search.
    """

    def __init__(
        self,
        respond: Callable[[Array], PlaneResponse[T]],
        control: Control,
        half: float,
        *,
        final: bool,
    ) -> None:
        self._respond, self._control, self._half, self._final = respond, control, half, final
        self._free, self._scale = control.free, motion_units(half)
        self.unit = self._scale[self._free]

    def trial(self, plane: Array) -> _Trial[T]:
        """Evaluate the contacts under a plane (3,)."""
        response = self._respond(plane)
        loads = response.loads
        if not np.isfinite(loads).all():
            raise plane_failure(self._control, "NOT_A_NUMBER")
        residual = ((loads - self._control.loads) * self._scale)[self._free]
        return _Trial(plane, residual, float(loads[0]), response)

    def begun(self, plane: Array, first_touch: float | None) -> _Trial[T]:
        """Evaluate a start, or nearer to first touch where the contacts cannot bear so much."""
        for _ in range(6):
            try:
                return self.trial(plane)
            except NotConverged:
                if first_touch is None or not self._control.force or plane[0] <= first_touch:
                    raise
                plane = np.array([0.5 * (plane[0] + first_touch), *plane[1:]])
        return self.trial(plane)

    def stiffness(self, now: _Trial[T]) -> Array:
        """Return the derivative of the residual by the motions, shape (k, k) [N/mm]."""
        stiffness = now.response.stiffness()[np.ix_(self._free, self._free)]
        return stiffness * np.outer(self.unit, self.unit)

    def size(self, plane: Array) -> float:
        """Return the size of the numbers whose differences displacements are [mm]."""
        return float(np.abs(plane) @ (1.0 / self._scale))

    def moved(self, now: _Trial[T], motion: Array) -> Array:
        """Return the plane (3,) after a motion."""
        plane = now.plane.copy()
        plane[self._free] += self.unit * motion
        return plane

    def searched(self, now: _Trial[T], step: Array) -> _Trial[T] | None:
        """Search along a step, and return where it leads; None where it gains nothing."""
        trial = now

        def slope_after(share: float) -> float:
            nonlocal trial
            plane = self.moved(now, share * step)
            if np.abs(plane[self._free] / self.unit).max() > 1e3 * self._half:
                raise plane_failure(self._control, "NO_SUPPORT" if now.force else "NO_CONTACT")
            try:
                trial = self.trial(plane)
            except NotConverged:
                if self._final:
                    raise
                return np.inf
            # less than the tolerance is lost by rounding alone, and is no support to be kept
            held = now.force > TOLERANCE * (self._control.force or np.inf)
            return np.inf if held and trial.force == 0.0 else float(trial.residual @ step)

        longest = self._half / float(np.abs(step).max())
        share = slope_search(slope_after, float(now.residual @ step), min(1.0, longest))
        return None if share is None else trial


def _direction(
    stiffness: Array, residual: Array, nothing: float, first: float
) -> tuple[Array, bool]:
    """Return Newton's step, or a first trial where nothing resists, and whether it is Newton's."""
    values, vectors = np.linalg.eigh(stiffness)
    loads = -vectors.T @ residual
    loose = values <= UNSUPPORTED * max(values[-1], 0.0)
    falling = loose & (np.abs(loads) > nothing)
    if falling.any():
        step = vectors @ np.where(falling, loads, 0.0)
        return first * step / np.abs(step).max(), False
    return vectors @ np.divide(loads, values, out=np.zeros_like(loads), where=~loose), True


def slope_search(slope_after: Callable[[float], float], slope: float, share: float) -> float | None:
    """Shorten or lengthen a step until the slope of a convex function along it has fallen.

    Only slopes are looked at: near a minimum the values of a function differ by less than their
    rounding, and their slopes do not.

    Args:
        slope_after: Returns the slope along the step after a share of it; infinite where the
            share is to be shortened anyway. The share that is returned was evaluated last.
        slope: Slope before the step, negative.
        share: Share of the step to try first.

    Returns:
        A share after which the size of the slope is at most 0.9 times that before; None when
        there is none to rounding.

    Source:
        Nocedal & Wright 2006, ch. 3, doi 10.1007/978-0-387-40065-5.
    """
    low, high = 0.0, np.inf
    for _ in range(100):
        left = slope_after(share)
        if abs(left) <= 0.9 * abs(slope):
            return share
        low, high = (share, high) if left < 0.0 else (low, share)
        share = 3.0 * share if high == np.inf else 0.5 * (low + high)
    return None
