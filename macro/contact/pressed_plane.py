"""A rigid plane pressed on a face by contact laws: closures, pressures, equilibrium.

Theory: section 11 of ``docs/theory.md``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
from scipy.spatial import cKDTree

from patchlaw.geometry import Control, RigidPlane
from patchlaw.geometry.rigid_plane import (
    UNSUPPORTED,
    PlaneLevers,
    PlaneResponse,
    find_equilibrium,
    plane_failure,
)
from patchlaw.macro.contact.face_equilibrium import FaceEquilibrium
from patchlaw.macro.contact.face_laws import ContactLaw, ContactLaws, Crown, SingleLaws
from patchlaw.macro.contact.loaded_face import ContactFace, Mode
from patchlaw.support import Array, Flags, Indices, InputError, NotConverged, together

_FIRST, _FARTHEST = 1e-6, 1e3
"""First and last approach that first touch is looked for at, in halves of the diagonal."""


_FIRST_STEP = 1e-3
"""First step from a closure towards a law's curve, relative to the largest closure."""
_DOUBLINGS, _BISECTIONS = 30, 16

_MOST_WEARING, _ROUNDING = 100, 4e-16
"""Steps to the pressure of a law that wears, at most, and rounding of its closures and pressures;
bisection alone takes 53 to rounding."""
_SAME_PLACE = 1e-6
"""Distance of a sample from where its past was written, relative to the face's size."""
_STIFFEST = 30.0
"""Largest stiffness of a body relative to what was thought before: that of its elements."""


class PressedPlane:
    """A rigid plane on contact laws at the samples of a face, in equilibrium with its loads.

    Closures are c = δ − g − w − s, with the approach δ of the plane at the samples, the macroscopic
    gap g, the depth w that had worn off before the load step, and the downward displacement s of
    the samples. Free motions of the plane follow from s: the
    force is the prescribed one, and there is no moment about the middle of the patches.

    Args:
        face: The contact face with its patches.
        mode: Where the laws are evaluated.
        laws: One law per patch, or all of them together; the same on every rank.
        crown: Depth of the face below its plane at points (x, y) of the plane, beside that of the
            mesh [mm]; None: none.

    Attributes:
        mode: Where the laws are evaluated.
        sampling: The samples of the face there.
        gap: Macroscopic gap between plane and face at this rank's samples, without what has worn
            off, shape (n,) [mm]; set it anew where other loads of the body change it.
        worn: Depth that has worn off at this rank's samples, which adds to the gap, (n,) [mm].
        wearing: Depth that wears off during the load step over the pressure at its end, shape (n,)
            [mm/MPa]; None: nothing does.
        shed: Depth that wears off during it whatever that pressure is, shape (n,) or 0 [mm].
        laws: The laws of all patches.
        levers: Levers of this rank's samples about the middle of the patches.
        weight: Areas of this rank's samples, shape (n,) [mm²].
        plane: Approach at the middle of the patches [mm] and slopes along x and y, shape (3,).
        control: What the load step prescribes of the plane.
        comm: MPI communicator of the mesh.

    Note:
        Every method is collective.
    """

    def __init__(
        self,
        face: ContactFace,
        mode: Mode,
        laws: Sequence[ContactLaw] | ContactLaws,
        crown: Crown | Sequence[Crown] = None,
    ) -> None:
        self._face, self.mode, self.comm = face, mode, face.comm
        self.sampling = sampling = face.sampling(mode)
        self.laws = laws if isinstance(laws, ContactLaws) else SingleLaws(laws)
        self.weight, patches = sampling.weight, face.patches
        self.levers = PlaneLevers.at(
            sampling.x, sampling.y, patches.lengths, centre=patches.middle, comm=self.comm
        )
        self.gap = together(face.comm, lambda: sampling.below(crown))
        self.worn: Array = np.zeros_like(self.weight)
        self.wearing: Array | None = None
        self.shed: Array | float = 0.0
        self._borne = np.full_like(self.weight, np.inf)  # where steps to pressures start
        self.plane: Array = np.zeros(3)
        self.control = Control(approach=0.0)
        self._unloaded = False

    def prescribe(self, control: Control, plane: Array) -> None:
        """Set what a load step prescribes.

        Args:
            control: What a load step prescribes. Without any force the plane just touches the
                surface, wherever displacements bring that: it follows them, and nothing resists.
            plane: Where the plane is now, shape (3,).
        """
        self.control, self.plane = control, control.prescribed(plane)
        self._unloaded = control.force == 0.0

    def closure(self, displacement: PETSc.Vec) -> Array:
        """Bring the plane into equilibrium, and return this rank's closures, shape (n,) [mm]."""
        return self.closure_of(self.sampling.displacements(displacement))

    def closure_of(self, displacement: Array) -> Array:
        """Bring the plane into equilibrium, and return the closures of this rank's samples.

        Args:
            displacement: Downward displacements of this rank's samples, shape (n,) [mm].

        Returns:
            Closures, shape (n,) [mm].

        Raises:
            NotConverged: When nothing can hold the plane.
        """

        def respond(plane: Array) -> PlaneResponse[Array]:
            closed = self._closure_at(plane, displacement)
            return PlaneResponse(
                loads=self.loads(self.pressure(closed)),
                stiffness=lambda: self.levers.stiffness(self.weight * self.stiffness(closed)),
                state=closed,
            )

        if self._unloaded:
            slopes = self.plane[1:]
            approach = first_touch(
                lambda at: float(respond(np.array([at, *slopes])).loads[0]) > 0.0,
                self.control,
                self.levers.half,
            )
            self.plane = np.array([approach, *slopes])
        if not self.control.free.any():
            return self._closure_at(self.plane, displacement)
        self.plane, closed = find_equilibrium(respond, self.control, self.plane, self.levers.half)
        return closed

    def guessed_closure(self, displacement: Array) -> Array:
        """Return closures to start from; see `closure_of`.

        Where the body does not give way yet, steep laws may press so much that no equilibrium of
        the plane is found. It then stays where it is.
        """
        try:
            return self.closure_of(displacement)
        except NotConverged:
            return self._closure_at(self.plane, displacement)

    def _closure_at(self, plane: Array, displacement: Array) -> Array:
        # no other order of the sums: first touch is found to the last digit of closures
        return np.asarray(self.levers.matrix @ plane - self.open_gap - displacement)

    def closure_on_lines(self, displacement: Array, lines: Lines) -> Array:
        """Bring the plane into equilibrium on laws that are lines, and return the closures.

        Args:
            displacement: Downward displacements of this rank's samples, shape (n,) [mm].
            lines: The laws as lines.
        """
        levers, free, weight = self.levers, self.control.free, self.weight
        closure = self._closure_at(self.plane, displacement)
        if not free.any():
            return closure
        missing = self.control.loads - levers.loads(weight * lines.at(closure))
        unit = levers.unit[free]
        resistance = levers.stiffness(weight * lines.stiffness)[np.ix_(free, free)]
        scaled = np.linalg.lstsq(
            resistance * np.outer(unit, unit), unit * missing[free], UNSUPPORTED
        )
        self.plane = self.plane.copy()
        self.plane[free] += unit * scaled[0]
        return self._closure_at(self.plane, displacement)

    @property
    def open_gap(self) -> Array:
        """The gap with what has worn off but for what pressures at the end take, (n,) [mm]."""
        return self.gap + self.worn + self.shed

    def pressure(self, closure: Array) -> Array:
        """Return the laws' pressures at this rank's samples, shape (n,) [MPa].

        What a law raises on one rank is raised on all.
        """
        if (wearing := self.wearing) is not None:
            return together(self.comm, lambda: self._while_wearing(closure, wearing)[0])
        return together(self.comm, lambda: self.laws.pressures(*self._at(closure)))

    def pressure_of(self, some: Indices, closure: Array) -> Array:
        """Return the laws' pressures at some of this rank's samples that do not wear, (m,) [MPa].

        Args:
            some: Indices of the samples, ascending, shape (m,).
            closure: Closures of all samples, shape (n,) [mm].
        """
        patch, _, worn = self._at(closure)
        at = patch[some], closure[some], worn[some]
        return together(self.comm, lambda: self.laws.pressures(*at))

    def stiffness(self, closure: Array) -> Array:
        """Return the laws' stiffnesses dp/dc likewise, none without force, (n,) [MPa/mm]."""
        if self._unloaded:
            return np.zeros_like(closure)
        if (wearing := self.wearing) is not None:
            return together(self.comm, lambda: self._while_wearing(closure, wearing)[1])
        return together(self.comm, lambda: self.laws.stiffnesses(*self._at(closure)))

    def _at(self, closure: Array) -> tuple[Indices, Array, Array]:
        """Return what laws are evaluated at: patches, closures, worn depths."""
        return self.sampling.patch, closure, self.worn + self.shed

    def _while_wearing(
        self,
        closure: Array,
        wearing: Array,
        some: Indices | slice = slice(None),
        behind: Array | None = None,
    ) -> tuple[Array, Array]:
        """Return pressures and stiffnesses where laws wear, of all samples or of some.

        What wears off during a load step is a compliance k Δs in series with the law p(c): the
        pressure at its end is p(c − k Δs p). It lies between 0 and p(c); Newton's steps in the
        pressure are halved where they would leave the bracket. Samples drop out as they are found.
        `behind` are further compliances in series, which do not wear, of the samples asked for.
        """
        patch, closure, worn = self._at(closure)
        patch, closure, worn, wearing = patch[some], closure[some], worn[some], wearing[some]
        rates = self.laws.rates
        behind = np.zeros_like(closure) if behind is None else behind
        high = self.laws.pressures(patch, closure, worn)
        low, pressure = np.zeros_like(high), np.fmin(self._borne[some], high)
        high = np.nextafter(high, np.inf)  # steps to either end once tried would go to and fro
        stiffness, left = np.empty_like(high), np.arange(len(high))
        for _ in range(_MOST_WEARING):
            further, moved = wearing[left] * pressure[left], behind[left] * pressure[left]
            at = patch[left], closure[left] - further - moved, worn[left] + further
            found, slope, falls = rates(*at)
            missing = found - pressure[left]
            gives = 1.0 + falls * wearing[left] + slope * behind[left]
            closed = np.abs(closure[left]) + further + moved
            rounding = _ROUNDING * (high[left] + np.maximum(falls, slope) * closed)
            low[left] = np.where(missing > 0.0, pressure[left], low[left])
            high[left] = np.where(missing < 0.0, pressure[left], high[left])
            newton, lowest, highest = pressure[left] + missing / gives, low[left], high[left]
            inside = (newton > lowest) & (newton < highest) | (newton == pressure[left])
            pressure[left] = np.where(inside, newton, 0.5 * (lowest + highest))
            stiffness[left] = slope / gives
            left = left[np.abs(missing) > rounding]
            if not len(left):
                break
        self._borne[some] = pressure
        return pressure, stiffness

    def reached(self, some: Indices, closure: Array, pressure: Array, stiffness: Array) -> Array:
        """Return where samples that wear reach their curves along stiffnesses, see `law_lines`.

        That is one more compliance in series with the law and what wears.

        Args:
            some: Indices of the samples, shape (m,).
            closure: Closures of all samples, shape (n,) [mm].
            pressure: Pressures that they start from, shape (n,) [MPa].
            stiffness: k > 0 of the samples asked for, shape (m,) [MPa/mm].
        """
        wearing, start = self.wearing, closure.copy()
        assert wearing is not None
        start[some] += pressure[some] / stiffness
        at = start, wearing, some, 1.0 / stiffness
        found = together(self.comm, lambda: self._while_wearing(*at)[0])
        return np.asarray(start[some] - found / stiffness)

    def law_stiffness(self, state: FaceEquilibrium) -> Array:
        """Return the laws' own dp/dc in a state, whose face wears no further, (n,) [MPa/mm]."""
        if self._unloaded:
            return np.zeros_like(state.sample_closure)
        at = self.sampling.patch, state.sample_closure, state.sample_worn_depth
        return together(self.comm, lambda: self.laws.stiffnesses(*at))

    @property
    def record_of_wear(self) -> Array:
        """Places and worn depths of the samples of all ranks, shape (m, 3) [mm].

        Set it to go on from there, on any number of ranks.

        Raises:
            InputError: When it is set, where it is that of another face.
        """
        own = np.column_stack((self.sampling.places, self.worn))
        return np.concatenate(self.comm.allgather(own))

    @record_of_wear.setter
    def record_of_wear(self, record: Array) -> None:
        def found() -> Array:
            rows = same_places(record[:, :2], self.sampling.places, self.levers.half)
            return np.asarray(record[rows, 2])

        self.worn, self.wearing = together(self.comm, found), None

    def loads(self, pressure: Array) -> Array:
        """Return force and first moments about the middle of pressures, shape (3,) [N, N mm].

        Args:
            pressure: Pressures of this rank's samples, shape (n,) [MPa].
        """
        return self.levers.loads(self.weight * pressure)

    def secant(self, pressure: Array, displaced: Array, usual: float) -> float:
        """Return the stiffness of a body that pressures displace [MPa/mm].

        Args:
            pressure: Change of pressures, shape (n,) [MPa].
            displaced: Change of displacements of the samples into the body, shape (n,) [mm].
            usual: What it is where the changes do not tell.

        Note:
            Collective.
        """
        weighted = self.weight * pressure
        square, work = self.levers.summed(np.array([weighted @ pressure, weighted @ displaced]))
        return float(square / work) if 0.0 < square < _STIFFEST * usual * work else usual

    def state(self, closure: Array, **known: Any) -> FaceEquilibrium:
        """Return the contact under the plane as it is now.

        Args:
            closure: Closures of this rank's samples, before they wear, shape (n,) [mm].
            known: What else is known of the state.
        """
        pressure, areas = self.pressure(closure), self._face.areas
        further = 0.0 if self.wearing is None else self.wearing * pressure
        worn, closure = self.worn + self.shed + further, closure - further
        (force, *moment), patch_force = self.loads(pressure), self.sampling.patch_sums(pressure)
        (approach, *tilt), (xc, yc) = map(float, self.plane), map(float, self._face.patches.middle)
        return FaceEquilibrium(
            plane=RigidPlane(approach=approach, tilt=(tilt[0], tilt[1]), centre=(xc, yc)),
            force=float(force),
            moment=np.array(moment),
            patch_force=patch_force,
            # patches that are not on both faces bear nothing, and have no closure
            patch_pressure=patch_force / np.where(areas > 0.0, areas, 1.0),
            patch_closure=self.sampling.patch_sums(closure) / np.where(areas > 0.0, areas, np.nan),
            sample_closure=closure,
            sample_pressure=pressure,
            sample_worn_depth=worn,
            **known,
        )

    def border(self, stiffness: Array) -> Array:
        """Return E, shape (n, k'): free motions of the plane reduce D ds by E Eᵀ W ds.

        Args:
            stiffness: D of this rank's samples, shape (n,) [MPa/mm].
        """
        free, unit = self.control.free, self.levers.unit
        columns = self.levers.scaled(free) * stiffness[:, None]
        if not free.any():
            return columns
        resistance = self.levers.stiffness(self.weight * stiffness)
        values, vectors = np.linalg.eigh((resistance * np.outer(unit, unit))[np.ix_(free, free)])
        supported = values > UNSUPPORTED * max(values[-1], 0.0)
        return columns @ (vectors[:, supported] / np.sqrt(values[supported]))


def same_places(places: Array, own: Array, size: float, *, near: bool = False) -> Indices:
    """Return which places of samples are some of them, shape (n,).

    Args:
        places: Places of all samples, shape (m, 2) [mm].
        own: Some of them, shape (n, 2) [mm].
        size: Half the diagonal of the face [mm].
        near: Whether the nearest of them serve where they are not among them.

    Raises:
        InputError: When they are not among them.
    """
    far, index = cKDTree(places).query(own) if len(own) else (np.zeros(0), [])
    if not near and np.any(far > _SAME_PLACE * size):
        raise InputError("the samples are those of another face, or of other laws")
    return np.asarray(index, np.intp)


def first_touch(touched: Callable[[float], bool], control: Control, half: float) -> float:
    """Find the largest approach at which a plane is not in contact yet [mm].

    Args:
        touched: Returns whether the plane is in contact at an approach.
        control: What is prescribed of the plane, for an error.
        half: Half the diagonal of the interface [mm].

    Raises:
        NotConverged: When it never is, or always.
    """
    below, above, width = -_FIRST * half, _FIRST * half, np.inf
    while touched(below):
        below, above = 3.0 * below, below
        if below < -_FARTHEST * half:
            raise plane_failure(control, "NO_RELEASE")
    while not touched(above):
        below, above = above, 3.0 * above
        if above > _FARTHEST * half:
            raise plane_failure(control, "NO_CONTACT")
    while 0.0 < above - below < width:  # to neighbouring numbers
        width, middle = above - below, 0.5 * (below + above)
        below, above = (below, middle) if touched(middle) else (middle, above)
    return below


class Lines(NamedTuple):
    """Laws linearised at points of their curves.

    Attributes:
        closure: Closures of this rank's samples, shape (n,) [mm].
        pressure: Their pressures [MPa].
        stiffness: Their stiffnesses [MPa/mm].
    """

    closure: Array
    pressure: Array
    stiffness: Array

    def at(self, closure: Array) -> Array:
        """Return the pressures on the lines, shape (n,) [MPa]."""
        return self.pressure + self.stiffness * (closure - self.closure)


class Prediction(NamedTuple):
    """What is predicted of a contact.

    Attributes:
        lines: Its laws as lines.
        stiffness: Stiffness of the body under all its samples [MPa/mm].
        shear: Shear stresses, shape (n, d − 1) [MPa], or the `ShearLines` that they are on; None
            without friction.
    """

    lines: Lines
    stiffness: float
    shear: Any = None


def law_lines(
    forces: PressedPlane, closure: Array, pressure: Array, stiffness: float | Array
) -> Lines:
    """Linearise the laws where samples reach their curves along the body's stiffness.

    Newton's method linearises a law at the closures that its last step led to. Pressures of rough
    surfaces grow almost exponentially with closure: closures too large by a roughness give
    pressures and stiffnesses too large by orders of magnitude, and the next steps return from there
    little by little. The pressure that the linearised law predicted is a better place to go on from
    where the law is stiffer than the body, and the closure where it is softer. Between the two lies
    the point of the law's curve that the sample reaches from there along the stiffness k of the
    body,

        p(c') + k c' = p + k c,

    with the closure c and the pressure p predicted for it, and the law is linearised there: a
    proximal step (Parikh & Boyd 2014, doi 10.1561/2400000003). Circuit simulators limit the
    voltages of diodes for the same reason (Nagel 1975, SPICE2, section 4.4). Nothing but the place
    of linearisation differs from Newton's method, and near the solution both are the same.

    Args:
        forces: The laws.
        closure: Predicted closures c of this rank's samples, shape (n,) [mm].
        pressure: Predicted pressures p [MPa].
        stiffness: k, one for all or one for each [MPa/mm].

    Note:
        Collective.
    """
    comm, far = forces.comm, closure.copy()
    beyond = forces.pressure(closure) - pressure
    # most samples are open, without a pressure: they stay where they are
    some, near = np.flatnonzero(beyond), closure.copy()
    k = np.broadcast_to(stiffness, closure.shape)[some]
    if forces.wearing is not None:
        far[some] = forces.reached(some, closure, pressure, k)
        return Lines(far, forces.pressure(far), forces.stiffness(far))
    aim = -np.sign(beyond[some])

    def short_of(at: Array) -> Flags:
        """Return which of these samples do not reach their curves yet."""
        excess = forces.pressure_of(some, at) - pressure[some] + k * (at - closure)[some]
        return np.asarray(aim * excess < 0.0)

    step = _FIRST_STEP * comm.allreduce(float(np.abs(closure).max(initial=0.0)), op=MPI.MAX)
    for _ in range(_DOUBLINGS):
        short = short_of(far)
        if not comm.allreduce(bool(short.any()), op=MPI.LOR):
            break
        near[some[short]] = far[some[short]]
        far[some[short]] += step * aim[short]
        step *= 2.0
    at = closure.copy()
    for _ in range(_BISECTIONS):
        at[some] = 0.5 * (near + far)[some]
        short = short_of(at)
        near[some[short]], far[some[~short]] = at[some[short]], at[some[~short]]
    at[some] = np.where(aim > 0.0, near[some], far[some])  # the lower of both
    return Lines(at, forces.pressure(at), forces.stiffness(at))
