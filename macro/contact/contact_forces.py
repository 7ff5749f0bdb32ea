"""Forces of contact laws on a face under a rigid plane, and their exact derivative.

Theory: sections 11 and 15 of ``docs/theory.md``.
"""

from __future__ import annotations

import weakref
from collections.abc import Sequence
from functools import cached_property, partial
from typing import Protocol

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
from scipy.sparse import csr_matrix

from patchlaw.geometry import Control, Friction
from patchlaw.geometry.sliders import SliderRecord, SliderResponse
from patchlaw.macro.contact.face_equilibrium import FaceEquilibrium, FaceShear
from patchlaw.macro.contact.face_laws import ContactLaw, ContactLaws, Crown, RunningIn
from patchlaw.macro.contact.face_sliders import FaceSliders, ShearLines
from patchlaw.macro.contact.loaded_face import ContactFace, Mode, moved_by_supports
from patchlaw.macro.contact.pressed_plane import Lines, Prediction, PressedPlane
from patchlaw.macro.linear_solvers.node_matrices import distributed, joined, springs_at
from patchlaw.support import Array, NotConverged, together

_MOVED, SMOOTH = 1.5, 1.0 / 30.0
"""Ratio of stiffnesses of laws and body together that a preconditioner does not overlook, and
stiffness of the body over that of its elements: against pressures that change over several of
them. With the whole stiffness laws of 1 µm on a pad took 358 linear iterations for four load steps,
with a tenth 200; compared by the largest alone, stiff laws on a pad of ν = 0.45 took 22 to 32
iterations a solve, in place of 5 to 10."""

_SAME_DEPTH, _ROUNDING = 1e-8, 1e-12
"""Changes of depths that slip wears off which end a load step: over these, and over closures."""
_PASSES, _ALIKE = 5, 1e-12
"""Passes that the next one is combined of, but for the last, and squares of changes over the
largest below which they are combinations of others."""

_MATRIX = "patchlaw matrix"


class ContactForces(PressedPlane):
    """Nodal forces B p(c(u)) of contact laws on a face that a rigid plane is pressed on.

    A sample bears a pressure, and with Coulomb friction two shear stresses, those of `FaceSliders`.

    Without friction the forces are minus the gradient of a convex energy if no law softens: the
    minimum of the energy over the motions of the plane is convex in the displacements s = Bᵀu / w
    of the samples where the energy under a fixed plane is. With the stiffness D of the laws, the
    areas W of the samples and their levers G, closures change by G dq − ds, where
    (Gᵀ W D G) dq = Gᵀ W D ds. The derivative −B (diag(p'/w) − E Eᵀ) Bᵀ is applied without being
    assembled: B has few columns (patches) or few rows with entries (nodes of the interface), and E
    has a column for every free motion. Shear stresses add ∂τ/∂c, with which the derivative is
    unsymmetric; the shift of the plane under a prescribed shear force is eliminated likewise.

    Args:
        face: The contact face with its patches.
        mode: Where the laws are evaluated.
        laws: One law per patch, or all of them together; the same on every rank.
        crown: Depth of the face below its plane, beside that of the mesh, see `PressedPlane`.
        friction: The friction, or that of each law; None: none.

    Attributes:
        sliders: The sliders of the samples; None without friction.
        slip_wear: Depth that wears off per slip and pressure of this rank's samples, (n,) [mm²/N],
            see `Newton.solve`; None: slip wears nothing.
        slides: Whether the load step slides on so far that what springs give counts for nothing.
        components: Unknowns that vectors hold next to each other: the displacements of a node; 1
            in mixed spaces.
        own: Unknowns of this rank that are displacements, in mixed spaces; None: all.
        directions: d, the stresses of a sample: 1, or 3 with friction.
        slope: Stiffness over w of this rank's samples in all directions at the latest `update`,
            shape (n d,) [N/mm⁵].
        tangents: Derivatives of (p, τx, τy)/w by closure and slips there, under a plane in a given
            place, shape (n, d, d) [N/mm⁵].

    Note:
        Every method is collective.
    """

    sliders: FaceSliders | None = None

    def __init__(
        self,
        face: ContactFace,
        mode: Mode,
        laws: Sequence[ContactLaw] | ContactLaws,
        crown: Crown | Sequence[Crown] = None,
        friction: Friction | Sequence[Friction] | None = None,
    ) -> None:
        super().__init__(face, mode, laws, crown)
        self._running_in = self.laws if isinstance(self.laws, RunningIn) else None
        self.slip_wear: Array | None = None
        self.slides = False
        known = face.sides[0].displacements
        self.own = None if known.taken is None else known.own[0]
        self.components: int = known.dimension if self.own is None else 1
        self._free = list[PETSc.Mat]()
        self._operator, self._stresses = self.sampling.operator, self.sampling.values
        self._on_supports = face.on_supports(mode)
        if friction is not None:
            at = self.sampling, self.levers, self.laws.laws, friction, self.comm
            as_new = None if self._running_in is None else self._running_in.at_pressures
            self.sliders = FaceSliders(*at, as_new)
            self._operator = face.in_all_directions(mode)
            self._stresses = self._operator.createVecRight()
        self._free_operator = self._operator
        self.directions = 1 if friction is None else 3
        self._lines: ShearLines | None = None
        self.slope: Array = np.zeros(len(self.weight) * self.directions)
        self.tangents: Array = np.zeros((len(self.weight), self.directions, self.directions))
        self._border: Array = np.zeros((len(self.weight), 0))  # E

    @property
    def wearing(self) -> Array | None:
        """Depth that wears off during the load step over the pressure, see `PressedPlane`."""
        return self._wearing

    @wearing.setter
    def wearing(self, wearing: Array | None) -> None:
        self._wearing, self.shed = wearing, 0.0
        if wearing is None:
            self._passes: list[Array] = []
        if self.sliders is not None:
            self.sliders.wearing = wearing

    def prescribe(self, control: Control, plane: Array) -> None:
        """Set what a load step prescribes, of the shear too: without any the plane does not shift.

        Args:
            control: What a load step prescribes.
            plane: Where the plane is now, shape (3,).
        """
        super().prescribe(control, plane)
        self._lines = None
        if self.sliders is not None:
            self.sliders.prescribe(control)

    def respond(
        self, closure: Array, displacement: PETSc.Vec, pressure: Array | None = None
    ) -> SliderResponse | None:
        """Return the shear stresses at closures and displacements; the plane shifts where free.

        Args:
            closure: Closures of this rank's samples, shape (n,) [mm].
            displacement: Displacements of the body [mm].
            pressure: Pressures there, where they are known [MPa].

        Returns:
            The shear stresses; None without friction.

        Raises:
            NotConverged: When the contact does not transmit the prescribed shear force.
        """
        if self.sliders is None:
            return None
        pressure = self.pressure(closure) if pressure is None else pressure
        return self.sliders.respond(
            closure, self.along(displacement), pressure, self.stiffness(closure)
        )

    def along(self, displacement: PETSc.Vec) -> Array:
        """Return displacements of samples along the axes of the face, shape (n, 2) [mm].

        Of two bodies they are the differences of both. Nothing follows them without friction, and
        their shape is (n, 0).
        """
        if self.sliders is None:
            return np.zeros((len(self.weight), 0))
        return self.stretched(displacement)[:, 1:] / self.weight[:, None]

    def with_supports(self, displacement: PETSc.Vec) -> Array:
        """Return what samples move by with nodes that supports move too, shape (n, d) [mm].

        Into the body, and with friction along the axes of the face. Contact moves no supports:
        these displacements are those by other loads.

        Args:
            displacement: Displacements of the body, those of its supports included [mm].
        """
        own = [self.sampling.displacements(displacement), *self.along(displacement).T]
        return (
            np.column_stack(own)
            + moved_by_supports(self._on_supports, displacement, self.weight)[:, : self.directions]
        )

    def write_on_supports(self, pressure: Array, shear: Array | None, load: PETSc.Vec) -> None:
        """Write what stresses of the samples press on supports; see `write_stresses`."""
        values = self._on_supports.createVecRight()
        stresses = values.array.reshape(-1, 3)
        stresses[:, 0], stresses[:, 1:] = pressure, 0.0 if shear is None else shear
        self._on_supports.mult(values, load)

    def stretched(self, displacement: PETSc.Vec, *, free: bool = False) -> Array:
        """Return w times the displacements of samples against the directions, shape (n, d) [mm³].

        Args:
            displacement: Displacements of the body [mm].
            free: Whether of free unknowns alone, see `constrain`.
        """
        operator = self._free_operator if free else self._operator
        operator.multTranspose(displacement, self._stresses)
        return self._stresses.array_r.reshape(-1, self.directions).copy()

    @cached_property
    def points(self) -> PETSc.Mat:
        """Bᵀ of unknowns that are free, of pointwise laws: d rows for every point [mm²]."""
        rubs = self.sliders is not None
        return self._face.points_in_all_directions if rubs else self._face.points_by_dofs

    def constrain(self, free: PETSc.Vec | None) -> None:
        """Leave unknowns that Dirichlet conditions hold out of the derivative.

        Args:
            free: 1 for free unknowns and 0 for those that are held; None: all are free.
        """
        for part in self._free:  # PETSc keeps objects that Python drops
            part.destroy()
        self._free, self._free_operator = [], self._operator
        self.__dict__.pop("points", None)
        if free is not None and self.mode == "pointwise":
            self.points = self.points.copy()
            self.points.diagonalScale(R=free)
            self._free_operator = PETSc.Mat().createTranspose(self.points)
            self._free = [self._free_operator, self.points]
        elif free is not None:
            self._free_operator = self._operator.copy()
            self._free_operator.diagonalScale(L=free)
            self._free = [self._free_operator]

    # --- the forces

    def write(self, displacement: PETSc.Vec, load: PETSc.Vec, *, free: bool = False) -> None:
        """Write the forces by pressures and shear stresses at a displacement.

        Args:
            displacement: u [mm].
            load: Receives the nodal forces [N].
            free: Whether on free unknowns alone, see `constrain`.
        """
        closure = self.closure(displacement)
        pressure = self.pressure(closure)
        found = self.respond(closure, displacement, pressure)
        self.write_stresses(pressure, None if found is None else found.stress, load, free=free)

    def write_stresses(
        self, pressure: Array, shear: Array | None, load: PETSc.Vec, *, free: bool = False
    ) -> None:
        """Write the forces by pressures (n,) and any shear stresses (n, d − 1) of the samples."""
        stresses = self._stresses.array.reshape(-1, self.directions)
        stresses[:, 0], stresses[:, 1:] = pressure, 0.0 if shear is None else shear
        (self._free_operator if free else self._operator).mult(self._stresses, load)

    def write_lines(self, displacement: PETSc.Vec, given: Prediction, load: PETSc.Vec) -> None:
        """Write the forces on laws that are lines, and move the derivative to these.

        Args:
            displacement: u [mm].
            given: The laws as lines; and the stiffness of the body and the shear stresses that are
                predicted, for friction.
            load: Receives the nodal forces [N].
        """
        lines = given.lines
        if isinstance(given.shear, ShearLines):
            self._lines = given.shear
        elif self.sliders is not None:
            self._lines = self._shear_lines(self.sliders, displacement, given)
        closure = self.closure_on_lines(self.sampling.displacements(displacement), lines)
        self.write_stresses(lines.at(closure), self.shear_on_lines(displacement, closure), load)
        self.linearise(lines.stiffness, self._lines and self._lines.response)

    def shear_on_lines(self, displacement: PETSc.Vec, closure: Array) -> Array | None:
        """Return shear stresses on the latest lines, the plane shifting where free, (n, 2) [MPa].

        Args:
            displacement: Displacements of the body [mm].
            closure: Closures on the lines, shape (n,) [mm].
        """
        if self.sliders is None or self._lines is None:
            return None
        return self.sliders.on_lines(self._lines, self.along(displacement), closure)

    def _shear_lines(
        self, sliders: FaceSliders, displacement: PETSc.Vec, given: Prediction
    ) -> ShearLines:
        """Return shear stresses as lines, at the points of the laws' curves that lines touch.

        Pressures on the lines where displacements are now are no bounds of shear stresses: under
        steep laws they are negative, or too large by orders of magnitude, before the next step.
        """
        assert given.shear is not None
        closure, pressure, stiffness = given.lines
        respond = partial(sliders.at_slip, closure, np.maximum(pressure, 0.0), stiffness)
        at = closure, pressure
        return sliders.lines(respond, self.along(displacement), at, given.shear, given.stiffness)

    def write_shear_in(
        self, parts: Array, y: Array, stretches: Array, closure: Array, lines: Lines
    ) -> None:
        """Add the work of shear stresses in each of k displacements, none without friction.

        The latest stresses stay where pressures do not transmit the prescribed shear force yet.

        Args:
            parts: Receives the work on this rank, and its derivatives by the shares, (> k, k).
            y: Shares of the displacements, shape (k,).
            stretches: What samples move by in each against their directions, times their weights,
                shape (k, n, d) [mm³].
            closure: Closures of this rank's samples, shape (n,) [mm].
            lines: The laws as lines.
        """
        if self.sliders is None:
            return
        along = stretches[:, :, 1:]
        moved = np.einsum("k,kni->ni", y, along) / self.weight[:, None]
        try:
            found = self.sliders.respond(closure, moved, lines.at(closure), lines.stiffness)
        except NotConverged:
            parts[0] -= np.einsum("kni,ni->k", along, self.last_shear)
            return
        self.linearise(lines.stiffness, found)
        parts[0] -= np.einsum("kni,ni->k", along, found.stress)
        changes = np.array([self.stress_change(each)[:, 1:] for each in stretches])
        parts[1 : len(y) + 1] += np.einsum("kni,lni->kl", along, changes)

    @property
    def last_shear(self) -> Array:
        """Shear stresses of the latest load step, shape (n, d − 1) [MPa]."""
        return np.zeros((len(self.weight), 0)) if self.sliders is None else self.sliders.stress

    # --- their derivative

    def update(self, displacement: PETSc.Vec) -> None:
        """Move the derivative to a displacement."""
        closure = self.closure(displacement)
        self.linearise(self.stiffness(closure), self.respond(closure, displacement))

    def linearise(self, stiffness: Array, response: SliderResponse | None = None) -> None:
        """Move the derivative to stiffnesses of the samples; without those of shear none slips.

        Args:
            stiffness: Stiffnesses of the laws, shape (n,) [MPa/mm].
            response: The shear stresses, with their stiffnesses.
        """
        tangent = np.zeros_like(self.tangents)
        tangent[:, 0, 0] = stiffness
        if response is not None:
            tangent[:, 1:, 0], tangent[:, 1:, 1:] = response.by_closure, response.by_slip
        slope = np.einsum("nii->ni", tangent).copy()
        if self.directions > 1:
            slope[:, 1:] = 0.5 * slope[:, 1:].sum(axis=1, keepdims=True)  # all that springs know
        self.slope = (slope / self.weight[:, None]).ravel()
        self.tangents, self._by_slip = tangent / self.weight[:, None, None], tangent[:, 1:, 1:]
        self._border, closes = self.border(stiffness), stiffness[:, None]
        self._by_pressure = np.divide(  # of (p, τx, τy) as the plane moves
            tangent[:, :, 0], closes, out=np.zeros(slope.shape), where=closes > 0.0
        )

    def moved_from(self, slope: Array, elements: float) -> bool:
        """Return whether the stiffness of laws and elements has changed since earlier slopes.

        Args:
            slope: The earlier ones, as `slope`.
            elements: Stiffness of the elements at the face [MPa/mm].
        """
        areas = np.repeat(self.weight, self.directions)
        body = SMOOTH * elements
        ratio = (areas * self.slope + body) / (areas * slope + body)
        most = float(np.maximum(ratio, 1.0 / ratio).max(initial=1.0))
        return bool(self.comm.allreduce(most, op=MPI.MAX) > _MOVED)

    def add_product(self, x: PETSc.Vec, y: PETSc.Vec, known: Array | float = 0.0) -> None:
        """Add the product of the derivative with x to y, between free unknowns.

        Args:
            x: A vector.
            y: What it is added to.
            known: A part of `slope` that is left out, as y holds its product already, shape (n d,).
        """
        stretch = self.stretched(x, free=True)
        self._add_stresses(self.stress_change(stretch).ravel() - known * stretch.ravel(), y)

    def add_springs_product(self, slope: Array, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Add the product with springs of other slopes, shape (n d,), to y."""
        self._add_stresses(slope * self.stretched(x, free=True).ravel(), y)

    def _add_stresses(self, stresses: Array, y: PETSc.Vec) -> None:
        self._stresses.array[:] = stresses
        self._free_operator.multAdd(self._stresses, y, y)

    def make_room(self, matrix: PETSc.Mat) -> None:
        """Give a matrix of elasticity the entries of springs that join two faces."""
        springs = springs_at(self.points, np.ones_like(self.slope))
        springs.scale(0.0)
        matrix.axpy(1.0, springs, PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN)
        springs.destroy()

    def add_springs(self, slope: Array, matrix: PETSc.Mat) -> None:
        """Add springs at the points of pointwise laws to an assembled matrix of elasticity.

        Args:
            slope: Their slopes, as `slope` or, all of the derivative under a plane in a given
                place, as `tangents` [N/mm⁵].
            matrix: The matrix; assembled before and afterwards.
        """
        springs = springs_at(self.points, slope)
        matrix.axpy(1.0, springs, PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN)
        springs.destroy()

    @property
    def loads_of_motions(self) -> Array:
        """B E: this rank's rows of nodal loads by free motions of the plane, shape (m, k')."""
        operator, samples = self.sampling.operator, self.sampling.values
        load = operator.createVecLeft()
        loads = np.empty((load.local_size, self._border.shape[1]))
        for k, column in enumerate(self._border.T):
            samples.array[:] = column
            operator.mult(samples, load)
            loads[:, k] = load.array_r
        return loads

    def pressure_change(self, stretch: Array) -> Array:
        """Return the change of pressures where samples close in, the plane following them.

        Args:
            stretch: What this rank's samples close in by, times their weights, shape (n,) [mm³].
        """
        return np.asarray(self.slope[:: self.directions] * stretch - self._parted(stretch))

    def _parted(self, stretch: Array) -> Array:
        """Return how the plane that follows lessens the change of pressures, shape (n,) [MPa]."""
        border = self._border
        if not border.shape[1]:
            return np.zeros(len(border))
        return np.asarray(border @ self.levers.summed(border.T @ stretch))

    def stress_change(self, stretch: Array) -> Array:
        """Return the change of pressures and shear stresses where samples move, shape (n, d).

        Args:
            stretch: What they move by against the directions, times their weights, (n, d) [mm³].
        """
        change = np.einsum("nij,nj->ni", self.tangents, stretch)
        change -= self._by_pressure * self._parted(stretch[:, 0])[:, None]
        if self.sliders is not None:
            change[:, 1:] = self.sliders.with_shift(self._by_slip, change[:, 1:])
        return change

    def vibration_tangents(self, state: FaceEquilibrium, sliding: Array | None = None) -> Array:
        """Return the stiffnesses of (p, τx, τy) against small vibrations, (n, 3, 3) [MPa/mm].

        Args:
            state: The contact that vibrates.
            sliding: μ t, along the axes of the face, where the plane slides along t, shape (2,),
                or of every sample, (n, 2): shear stresses then follow the pressures. None: whatever
                rubs sticks.
        """
        stiffness = self.law_stiffness(state)
        tangents = np.zeros((len(stiffness), 3, 3))
        tangents[:, 0, 0] = stiffness
        if sliding is not None:
            tangents[:, 1:, 0] = stiffness[:, None] * sliding
        elif self.sliders is not None:
            tangents[:, [1, 2], [1, 2]] = (stiffness / self.sliders.stiffness_ratio)[:, None]
        return tangents

    # --- load steps

    def of_springs(self, closure: Array, *, rate: bool = False) -> Array:
        """Return pressures, or their derivatives, at closures of springs, see `FaceSliders`, (n,).

        Args:
            closure: Closures, shape (n,) [mm].
            rate: Whether to return the derivatives.
        """
        if (laws := self._running_in) is None:
            return self.stiffness(closure) if rate else self.pressure(closure)
        evaluate = laws.new.stiffnesses if rate else laws.new.pressures
        return together(self.comm, lambda: evaluate(self.sampling.patch, closure, self.worn))

    def sticking(self, state: FaceEquilibrium) -> Array:
        """Return the closures at which what sticks has touched, of what is left, (n,) [mm]."""
        assert state.shear is not None
        if (laws := self._running_in) is None:
            return state.shear.stick_closure
        patch, depth = self.sampling.patch, state.sample_worn_depth
        pressure = laws.new.pressures(patch, state.shear.stick_closure, depth)
        return laws.at_pressures(patch, pressure, depth)[0]

    @property
    def past(self) -> tuple[Control, Array, Array, SliderRecord | None]:
        """What was prescribed, the plane, and what load steps left behind of wear and slip.

        Set it to take them back.
        """
        memory = None if self.sliders is None else self.sliders.memory
        return self.control, self.plane.copy(), self.worn, memory

    @past.setter
    def past(self, past: tuple[Control, Array, Array, SliderRecord | None]) -> None:
        control, plane, self.worn, memory = past
        self.wearing = None
        if self.sliders is not None and memory is not None:
            self.sliders.memory = memory
        self.prescribe(control, plane)

    def shear_state(self, closure: Array, displacement: PETSc.Vec) -> FaceShear | None:
        """Return the shear of the face at closures and displacements; None without friction.

        Args:
            closure: Closures of this rank's samples, shape (n,) [mm].
            displacement: Displacements [mm].
        """
        found = self.respond(closure, displacement)
        return self.sliders.step(found)[1] if self.sliders and found else None

    def wears_on(self, displacement: PETSc.Vec) -> bool:
        """Let the load step wear by the slip at displacements; return whether depths change by it.

        Args:
            displacement: Displacements [mm].
        """
        closure = self.closure(displacement)
        found, pressure = self.respond(closure, displacement), self.pressure(closure)
        assert self.sliders is not None and self.slip_wear is not None and found is not None
        before = 0.0 if self.wearing is None else self.wearing * pressure + self.shed
        closed = np.divide(  # which changes by rounding
            pressure, stiffness := self.stiffness(closure),
            out=np.zeros_like(pressure), where=stiffness > 0.0,
        )  # fmt: skip
        began = np.zeros_like(pressure) if self.wearing is None else self.wearing
        began = np.stack([began, np.broadcast_to(self.shed, pressure.shape)])
        slid = self.sliders.slid(found, pressure, whole=self.slides)
        wears = self.slip_wear * np.stack(slid)
        depth = wears[0] * pressure + wears[1]
        sizes = np.abs(np.column_stack([depth - before, depth, closed]))
        change, worn, closed_in = self.sliders.total(sizes * pressure[:, None])
        moves = bool(change > max(_SAME_DEPTH * worn, _ROUNDING * closed_in))
        if moves and self.wearing is not None:
            wears = self._accelerated(began, wears, pressure)
        self.wearing, self.shed = wears
        return moves

    def _accelerated(self, began: Array, found: Array, pressure: Array) -> Array:
        """Return what a fixed point goes on from, by the passes so far, shape (2, n).

        Of their combinations that whose change is least (Anderson 1965, doi
        10.1145/321296.321305), over the depths that both parts wear off; nothing grows back.

        Args:
            began: Depths over pressures, and beside, that a pass began with.
            found: Those that slip wears off in its solution.
            pressure: Pressures there, shape (n,) [MPa].
        """
        self._passes = [*self._passes[-_PASSES:], np.stack([began, found - began])]
        if len(self._passes) < 2:
            return found
        changes = np.diff(self._passes, axis=0)
        sizes = np.stack([pressure, np.ones_like(pressure)])
        each = np.array([*changes[:, 1], found - began]) * sizes
        assert self.sliders is not None
        products = self.sliders.total(
            np.einsum("akn,bkn->nab", each, each).reshape(-1, len(each) ** 2)
        )
        gram = products.reshape(len(each), -1)
        shares = np.linalg.lstsq(gram[:-1, :-1], gram[:-1, -1], rcond=_ALIKE)[0]
        better = found - np.tensordot(shares, changes.sum(axis=1), 1)
        return np.where(better < 0.0, found, better)

    def accept(self, closure: Array, displacement: PETSc.Vec) -> None:
        """Move the sliders on to the end of a load step that counts, and let the face wear.

        Args:
            closure: Closures at its end, before it wore, shape (n,) [mm].
            displacement: Displacements there [mm].
        """
        if self.sliders is not None and (found := self.respond(closure, displacement)):
            self.sliders.accept(found)
        if self.wearing is not None:
            self.worn = self.worn + self.shed + self.wearing * self.pressure(closure)
            self.wearing = None


def face_springs(face: ContactFace, mode: Mode, tangents: Array, plane: bool = False) -> PETSc.Mat:
    """Return the stiffness of a face's nodes by that of stresses at its samples [N/mm].

    Args:
        face: The contact face.
        mode: Where the samples are.
        tangents: Stiffnesses of (p, τx, τy), see `ContactForces.vibration_tangents`.
        plane: Whether the plane moves along the normal: it is the last unknown then, on rank 0.

    Note:
        Collective.
    """
    weight = face.sampling(mode).weight
    if mode == "pointwise":
        points = face.points_in_all_directions
    else:
        points = face.in_all_directions(mode).transpose(PETSc.Mat())
    if plane:
        down = csr_matrix(-np.outer(weight, [1.0, 0.0, 0.0]).reshape(-1, 1))
        points = joined([[points, distributed(down, int(face.comm.rank == 0), points.comm)]])
    return springs_at(points, tangents / weight[:, None, None])


class AddsProduct(Protocol):
    """Contact whose derivative is applied without being assembled."""

    def add_product(self, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Add the product of the derivative with a vector x to y."""
        ...


class ContactTangent:
    """What PETSc holds of a matrix plus the derivatives of contacts, which their owners keep.

    The references to them are weak, and PETSc itself counts the matrix: an object that Python lets
    go of while PETSc frees the shell would never be freed.

    Args:
        contacts: The contacts.
    """

    def __init__(self, contacts: Sequence[AddsProduct]) -> None:
        self._contacts = [weakref.proxy(contact) for contact in contacts]

    def shell(self, matrix: PETSc.Mat) -> PETSc.Mat:
        """Return the sum with a matrix, as a PETSc matrix without entries."""
        shell = PETSc.Mat().createPython(matrix.getSizes(), self, comm=matrix.comm)
        shell.compose(_MATRIX, matrix)
        shell.setUp()
        return shell

    def mult(self, shell: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Write the product with x; PETSc calls this."""
        shell.query(_MATRIX).mult(x, y)
        self._add_contacts(x, y)

    def multTranspose(self, shell: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Write the product of the transpose with x; the part of contact is symmetric.

        With friction it is not, and PETSc's solvers that need a transpose do not converge.
        """
        shell.query(_MATRIX).multTranspose(x, y)
        self._add_contacts(x, y)

    def _add_contacts(self, x: PETSc.Vec, y: PETSc.Vec) -> None:
        for contact in self._contacts:
            contact.add_product(x, y)
