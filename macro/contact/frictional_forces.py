"""Forces of contact laws with friction on a face: pressures, and shear stresses by sliders.

Theory: docs/theory.md, section 15.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc
from scipy.spatial import cKDTree

from geometry.rigid_plane import Control
from geometry.shear_state import ShearControl
from geometry.sliders import SliderRecord, SliderResponse, Sliders, SliderState
from geometry.spring_bed import Friction, springs_of_law, stiffness_ratios
from macro.contact.contact_forces import ContactForces, ContactLaw, ContactLaws
from macro.contact.face_equilibrium import FaceShear
from macro.contact.loaded_face import ContactFace, Mode
from macro.contact.shear_lines import ShearLines, shear_lines
from support.arrays import Array
from support.collective import together
from support.errors import InputError, NotConverged

Indices = NDArray[np.intp]

_HELD = ShearControl(shift=(0.0, 0.0))
_MOST_STEPS = 100
_FARTHEST = 4.0
"""Largest step to the shift, in shifts that all springs could stick over."""
_SHORTER = 0.0, 1e-3, 1e-2, 0.1, 1.0, 4.0
"""Parts of the stiffness of springs that all stick, which shorten steps to the shift."""
_ENOUGH = 1e-12
"""Residual of a prescribed shear force, relative to the largest that friction transmits."""
_SAME_PLACE = 1e-6
"""Distance of a sample from where its sliders were written, relative to the face's size."""


class SliderMemory(NamedTuple):
    """What load steps leave behind of friction on this rank.

    Attributes:
        sliders: Sliders of this rank's samples.
        stress: Shear stresses there, shape (n, 2) [MPa].
        shift: Shift of the plane along the axes of the face, shape (2,) [mm].
        direction: Unit vector of its last change, shape (2,).
        dissipated: Energy lost to friction on the whole face since the start [N mm].
    """

    sliders: SliderState
    stress: Array
    shift: Array
    direction: Array
    dissipated: float


class _Evaluated(NamedTuple):
    """A response of the sliders, and what it is one to."""

    before: SliderState
    at: tuple[Array, ...]
    found: SliderResponse


class FrictionalForces(ContactForces):
    """Contact forces with Coulomb friction: every sample bears a pressure and two shear stresses.

    Slips are s = d − e·u, with the shift d of the plane along the axes e of the face. Shear
    stresses τ(c, s) follow from the sliders as the last accepted load step left them, whatever
    displacements are tried: only `accept` moves them on. The derivative has the part ∂τ/∂c, with
    which it is unsymmetric. A prescribed shear force gives the shift, which is eliminated as the
    plane's other motions are.

    Args:
        face: The contact face with its patches.
        mode: Where the laws are evaluated.
        laws: One law per patch, or all of them together; the same on every rank.
        gap: Macroscopic gap between plane and face at this rank's samples, shape (n,) [mm].
        friction: The friction.

    Attributes:
        preload: Displacements along the axes by other loads of the body, shape (n, 2) [mm].
        memory: What the load steps so far left behind; set it to take load steps back.
        slope: Stiffness over w of this rank's samples along the normal and both axes, at the latest
            `update`, shape (3 n,) [N/mm⁵].
    """

    def __init__(
        self,
        face: ContactFace,
        mode: Mode,
        laws: Sequence[ContactLaw] | ContactLaws,
        gap: Array,
        friction: Friction,
    ) -> None:
        super().__init__(face, face.sampling(mode), laws, gap)
        each: Any = getattr(laws, "laws", laws)
        beds = together(self.comm, lambda: [springs_of_law(law) for law in _once(each)])
        known = {id(law): bed for law, bed in zip(_once(each), beds, strict=True)}
        ratios = stiffness_ratios(each, friction)
        patch = self._sampling.patch
        self.friction = friction
        self.sliders = Sliders(
            [known[id(law)] for law in each], ratios, patch, friction.coefficient
        )
        self._operator = face.in_all_directions(mode)
        self._stresses = self._operator.createVecRight()
        n = len(patch)
        self.preload: Array = np.zeros((n, 2))
        self.slope = np.zeros(3 * n)
        self.memory = SliderMemory(
            self.sliders.at_rest, np.zeros((n, 2)), np.zeros(2), np.array([1.0, 0.0]), 0.0
        )
        self._shear = _HELD
        self._lines: ShearLines | None = None
        self._latest: _Evaluated | None = None
        self._shift: Array = np.zeros(2)
        self._tangent: Array = np.zeros((n, 3, 3))
        self._closes: Array = np.zeros(n)

    # --- what is prescribed

    def prescribe(self, control: Control, plane: Array) -> None:
        """Set what a load step prescribes, of the shear too: without any the plane does not shift.

        Args:
            control: What a load step prescribes.
            plane: Where the plane is now, shape (3,).
        """
        super().prescribe(control, plane)
        self._lines = None
        self._shear = control.shear or _HELD
        self._shift = self.memory.shift.copy()
        if self._shear.shift is not None:
            self._shift = np.array(self._shear.shift, float)

    @property
    def _shifts(self) -> bool:
        """Whether the shift follows from a prescribed force."""
        return self._shear.force is not None and not self._unloaded

    # --- stresses

    def respond(self, closure: Array, displacement: PETSc.Vec) -> SliderResponse:
        """Return the shear stresses at closures and displacements; the plane shifts where free.

        Args:
            closure: Closures of this rank's samples, shape (n,) [mm].
            displacement: Displacements of the body [mm].

        Raises:
            NotConverged: When the contact does not transmit the prescribed shear force.
        """
        return self.respond_on(closure, displacement, self.pressure(closure), self._rate(closure))

    def respond_on(
        self,
        closure: Array,
        displacement: PETSc.Vec,
        pressure: Array,
        rate: Array,
        *,
        sticks: bool = False,
    ) -> SliderResponse:
        """Return the same where pressures and stiffnesses are not those of the laws.

        Args:
            closure: Closures of this rank's samples, shape (n,) [mm].
            displacement: Displacements of the body [mm].
            pressure: Pressures, shape (n,) [MPa].
            rate: Their derivatives by the closure, shape (n,) [MPa/mm].
            sticks: Whether springs stick whatever they bear.
        """
        return self._respond_to(closure, self.along(displacement), pressure, rate, sticks=sticks)

    def _respond_to(
        self, closure: Array, moved: Array, pressure: Array, rate: Array, *, sticks: bool = False
    ) -> SliderResponse:
        """Return the same at displacements of samples along the axes, shape (n, 2) [mm]."""
        pressed = np.maximum(pressure, 0.0)

        def respond(shift: Array) -> SliderResponse:
            slip = shift - self.preload - moved
            return self._sliders_at(closure, pressed, rate, slip, sticks=sticks)

        if not self._shifts:
            return respond(self._shift)
        self._shift, found = self._balanced(respond, pressure)
        return found

    def _balanced(self, respond: Any, pressure: Array) -> tuple[Array, SliderResponse]:
        """Find the shift under which the shear stresses have the prescribed sum.

        That is the minimum of a convex function of the shift. Newton's steps are shortened towards
        those on springs that all stick, which are stiffer than any others.
        """
        assert self._shear.force is not None
        force, shift = np.array(self._shear.force), self._shift
        most = self.friction.coefficient * float(self.loads(pressure)[0])
        found = respond(shift)
        off = self.total(found.stress) - force
        for _ in range(_MOST_STEPS):
            if np.hypot(*off) <= _ENOUGH * most:
                return shift, found
            resistance = self.total(found.by_slip.reshape(-1, 4)).reshape(2, 2)
            stiffest = float(self.total(found.sticking[:, None])[0])
            for share in _SHORTER:
                matrix = resistance + share * stiffest * np.eye(2)
                move = -np.linalg.lstsq(matrix, off, rcond=1e-13)[0]
                move *= min(1.0, _FARTHEST * most / (stiffest * float(np.hypot(*move)) or np.inf))
                tried = respond(shift + move)
                left = self.total(tried.stress) - force
                if left @ move < 0.0 or np.hypot(*left) < np.hypot(*off):
                    break
            else:
                if np.hypot(*off) <= 1e3 * _ENOUGH * most:  # rounding
                    return shift, found
                break
            shift, found, off = shift + move, tried, left
        reason = "SLIDES" if np.hypot(*force) >= most else "NO_SHIFT"
        raise NotConverged(
            f"the sliding of the plane at {self.control}",
            reason=reason,
            iterations=0,
            remedy="take a smaller shear force, a larger force, or prescribe the shift",
        )

    def total(self, values: Array) -> Array:
        """Return the integrals over the face of values of this rank's samples.

        Args:
            values: The values, shape (n, k).

        Returns:
            Shape (k,), the same on every rank.
        """
        return np.asarray(self.comm.allreduce(self._sampling.weight @ values))

    def _rate(self, closure: Array) -> Array:
        return self.stiffness(closure)

    def along(self, displacement: PETSc.Vec) -> Array:
        """Return the displacements of samples along the axes of the face, shape (n, 2) [mm].

        Of two bodies they are the differences of both.
        """
        return self._stretched(displacement)[:, 1:] / self._sampling.weight[:, None]

    def _stretched(self, displacement: PETSc.Vec) -> Array:
        """Return w times the displacements of samples against the directions, shape (n, 3)."""
        self._operator.multTranspose(displacement, self._stresses)
        return self._stresses.array_r.reshape(-1, 3).copy()

    # --- the forces and their derivative

    def write(self, displacement: PETSc.Vec, load: PETSc.Vec) -> None:
        """Write the forces by pressures and shear stresses at a displacement.

        Args:
            displacement: u [mm].
            load: Receives the nodal forces [N].
        """
        closure = self.closure(displacement)
        pressure = self.pressure(closure)
        shear = self.respond_on(closure, displacement, pressure, self._rate(closure)).stress
        self.write_stresses(pressure, shear, load)

    def write_stresses(self, pressure: Array, shear: Array, load: PETSc.Vec) -> None:
        """Write the forces by pressures (n,) and shear stresses (n, 2) of this rank's samples."""
        self._stresses.array[:] = np.column_stack([pressure, shear]).ravel()
        self._operator.mult(self._stresses, load)

    def write_lines(
        self,
        displacement: PETSc.Vec,
        closure: Array,
        pressure: Array,
        stiffness: Array,
        load: PETSc.Vec,
        *,
        body: float,
    ) -> None:
        """Write the forces on laws that are lines; see `ContactForces.write_lines`.

        Springs stick where pressures on the lines do not transmit the prescribed shear force yet.
        """
        lines, at = self._lines, (closure, displacement, pressure, stiffness)
        if lines is None or self._shifts:
            try:
                found = self.respond_on(*at)
            except NotConverged:
                found = self.respond_on(*at, sticks=True)
            lines = ShearLines(found.slip, closure, found.stress, found)
        else:
            slip = self._shift - self.preload - self.along(displacement)
            respond = partial(self._sliders_at, closure, np.maximum(pressure, 0.0), stiffness)
            lines = shear_lines(respond, slip, closure, lines.at(slip, closure), body)
        self._lines = lines
        self.write_stresses(pressure, lines.stress, load)
        self.linearise_shear(stiffness, lines.response)

    def _sliders_at(
        self,
        closure: Array,
        pressure: Array,
        rate: Array,
        slip: Array,
        *,
        sticks: bool = False,
        rows: Indices | None = None,
    ) -> SliderResponse:
        """Return the response of sliders of all samples, or of rows of them with their slips."""
        before, at = self.memory.sliders, (closure, slip, pressure, rate)
        if rows is not None:
            pressed = pressure[rows], rate[rows]
            return self.sliders.respond(before, closure[rows], slip, *pressed, rows=rows)
        if sticks:
            return self.sliders.respond(before, *at, sticks=True)
        latest = self._latest  # residual and tangent of a point ask for the same
        known = latest is not None and latest.before is before
        if latest is None or not (known and all(map(np.array_equal, at, latest.at))):
            latest = _Evaluated(before, at, self.sliders.respond(before, *at))
            self._latest = latest
        return latest.found

    def write_shear_in(
        self,
        parts: Array,
        y: Array,
        stretches: Array,
        closure: Array,
        pressure: Array,
        stiffness: Array,
    ) -> None:
        """Add the work of shear stresses and its derivative; see `ContactForces.write_shear_in`.

        The latest stresses stay where pressures do not transmit the prescribed shear force yet.
        """
        along = stretches[:, :, 1:]
        moved = np.einsum("k,kni->ni", y, along) / self._sampling.weight[:, None]
        try:
            found = self._respond_to(closure, moved, pressure, stiffness)
        except NotConverged:
            parts[0] -= np.einsum("kni,ni->k", along, self.memory.stress)
            return
        self.linearise_shear(stiffness, found)
        parts[0] -= np.einsum("kni,ni->k", along, found.stress)
        changes = np.array([self._stress_change(each)[:, 1:] for each in stretches])
        parts[1 : len(y) + 1] += np.einsum("kni,lni->kl", along, changes)

    def write_last_shear(self, load: PETSc.Vec) -> None:
        """Write the forces by the shear stresses of the latest load step."""
        stress = self.memory.stress
        self.write_stresses(np.zeros(len(stress)), stress, load)

    def update(self, displacement: PETSc.Vec) -> None:
        """Move the derivative to a displacement."""
        closure = self.closure(displacement)
        stiffness = self.stiffness(closure)
        self.linearise_shear(stiffness, self.respond(closure, displacement))

    def linearise(self, stiffness: Array) -> None:
        """Move the derivative to stiffnesses of this rank's samples; sliders do not slip.

        Args:
            stiffness: Stiffnesses, shape (n,) [MPa/mm].
        """
        self._take(stiffness, np.zeros((len(stiffness), 3, 3)))

    def linearise_shear(self, stiffness: Array, response: SliderResponse) -> None:
        """Move the derivative to stiffnesses of the laws, and to those of shear stresses.

        Args:
            stiffness: Stiffnesses, shape (n,) [MPa/mm].
            response: The shear stresses.
        """
        tangent = np.zeros((len(stiffness), 3, 3))
        tangent[:, 1:, 0], tangent[:, 1:, 1:] = response.by_closure, response.by_slip
        self._take(stiffness, tangent)

    def linearise_sticking(self, stiffness: Array, stuck: Array) -> None:
        """Move the derivative to that of springs that stick, under a given shift.

        Args:
            stiffness: Stiffnesses of the laws at this rank's samples, shape (n,) [MPa/mm].
            stuck: Tangential stiffness of what sticks there, shape (n,) [MPa/mm].
        """
        tangent = np.zeros((len(stuck), 3, 3))
        tangent[:, 1:, 1:] = stuck[:, None, None] * np.eye(2)
        self._shear = _HELD
        self._take(stiffness, tangent)

    def _take(self, stiffness: Array, tangent: Array) -> None:
        weight = self._sampling.weight
        super().linearise(stiffness)
        tangent[:, 0, 0] = stiffness
        self._tangent = tangent / weight[:, None, None]
        along = 0.5 * (tangent[:, 1, 1] + tangent[:, 2, 2])  # preconditioners know the mean
        self.slope = (np.column_stack([stiffness, along, along]) / weight[:, None]).ravel()
        self._closes = np.divide(1.0, stiffness, out=np.zeros_like(stiffness), where=stiffness > 0)

    @property
    def normal_slope(self) -> Array:
        """p'/w of this rank's samples at the latest `update`, shape (n,) [N/mm⁵]."""
        return self.slope[::3]

    @property
    def tangents(self) -> Array:
        """Derivatives of (p, τx, τy)/w by closure and slips of this rank's samples, (n, 3, 3).

        Those under a plane in a given place [N/mm⁵].
        """
        return self._tangent

    def add_product(self, x: PETSc.Vec, y: PETSc.Vec, known: Array | float = 0.0) -> None:
        """Add the product of the derivative to y, as `ContactForces.add_product` does.

        Args:
            x: A vector.
            y: What it is added to.
            known: A part of `slope` that is left out, as y holds its product already, shape (3 n,).
        """
        stretch = self._stretched(x)
        self._add_stresses(self._stress_change(stretch).ravel() - known * stretch.ravel(), y)

    def _stress_change(self, stretch: Array) -> Array:
        """Return the change of pressures and shear stresses where samples move, shape (n, 3).

        Args:
            stretch: What they move by against the directions, times their weights, (n, 3) [mm³].
        """
        pressed = self.pressure_change(stretch[:, 0])
        change = np.einsum("nij,nj->ni", self._tangent[:, :, 1:], stretch[:, 1:])
        closes = pressed * self._closes * self._sampling.weight
        change[:, 1:] += self._tangent[:, 1:, 0] * closes[:, None]
        change[:, 0] = pressed
        if self._shifts:
            weight = self._sampling.weight[:, None, None]
            moves = self.total((self._tangent[:, 1:, 1:] * weight).reshape(-1, 4)).reshape(2, 2)
            shift = np.linalg.lstsq(moves, self.total(change[:, 1:]), rcond=1e-13)[0]
            change[:, 1:] -= (self._tangent[:, 1:, 1:] * weight) @ shift
        return change

    def add_springs_product(self, slope: Array, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Add the product with springs of other slopes, shape (3 n,), to y."""
        self._add_stresses(slope * self._stretched(x).ravel(), y)

    def _add_stresses(self, stresses: Array, y: PETSc.Vec) -> None:
        self._stresses.array[:] = stresses
        self._operator.multAdd(self._stresses, y, y)

    # --- load steps

    def accept(self, closure: Array, displacement: PETSc.Vec) -> FaceShear:
        """Move the sliders on to the end of a load step that has converged.

        Args:
            closure: Closures at its end, shape (n,) [mm].
            displacement: Displacements there [mm].

        Returns:
            The shear of the face there.
        """
        found, before = self.respond(closure, displacement), self.memory
        after, shear = self._shear_of(found)
        moved = self._shift - before.shift
        size = float(np.hypot(*moved))
        self.memory = SliderMemory(
            after,
            found.stress,
            self._shift.copy(),
            moved / size if size else before.direction,
            shear.dissipated,
        )
        return shear

    def shear_state(self, closure: Array, displacement: PETSc.Vec) -> FaceShear:
        """Return the shear of the face at closures and displacements.

        Args:
            closure: Closures of this rank's samples, shape (n,) [mm].
            displacement: Displacements [mm].
        """
        return self._shear_of(self.respond(closure, displacement))[1]

    def _shear_of(self, found: SliderResponse) -> tuple[SliderState, FaceShear]:
        """Return the sliders and the shear of the face by a response of them."""
        step = self.sliders.step(self.memory.sliders, found)
        lost = float(self.total(step.lost[:, None])[0])
        force, shift = self.total(found.stress), self._shift
        shear = FaceShear(
            shift=(float(shift[0]), float(shift[1])),
            force=(float(force[0]), float(force[1])),
            dissipated=self.memory.dissipated + lost,
            sample_stress=found.stress,
            stick_closure=np.minimum(step.stick_closure, found.closure),
            stuck=step.stuck,
        )
        return step.after, shear

    def record(self) -> SliderRecord:
        """Return what load steps left behind, of all ranks together; collective."""
        memory, sampling = self.memory, self._sampling
        state, place = memory.sliders, np.column_stack([sampling.x, sampling.y])
        own = {"place": place, "shear": memory.stress, **vars(state)}
        every = self.comm.allgather(own)
        whole = {name: np.concatenate([rank[name] for rank in every]) for name in own}
        return SliderRecord(
            **whole,
            shift=memory.shift,
            direction=memory.direction,
            dissipated=memory.dissipated,
        )

    def restore(self, record: SliderRecord) -> None:
        """Go on from what load steps left behind, on any number of ranks.

        Args:
            record: What `record` returned, of the same laws and samples.

        Raises:
            InputError: When it is that of another face.
        """
        sampling, size = self._sampling, self.levers.half
        own = np.column_stack([sampling.x, sampling.y])
        springs = self.sliders.at_rest.stress.shape[2]

        def found() -> Any:
            far, index = cKDTree(record.place).query(own) if len(own) else (np.zeros(0), [])
            if np.any(far > _SAME_PLACE * size) or record.stress.shape[2] != springs:
                raise InputError("the sliders are those of another face, or of other laws")
            return np.asarray(index, np.intp)

        index = together(self.comm, found)
        sliders = SliderState(
            closure=record.closure[index], slip=record.slip[index], stress=record.stress[index]
        )
        self.memory = SliderMemory(
            sliders,
            record.shear[index],
            record.shift.copy(),
            record.direction.copy(),
            record.dissipated,
        )

    def follow(self, other: FrictionalForces) -> None:
        """Go on from the sliders of other laws on the same samples, as of laws that go further.

        Args:
            other: The forces whose sliders they are.
        """
        memory = other.memory
        sliders = self.sliders.following(other.sliders, memory.sliders)
        self.memory = memory._replace(sliders=sliders)


def _once(laws: Sequence[Any]) -> list[Any]:
    """Return the different laws among those of patches, which may have one in common."""
    return list({id(law): law for law in laws}.values())


def contact_forces(
    face: ContactFace,
    mode: Mode,
    laws: Sequence[ContactLaw] | ContactLaws,
    gap: Array,
    friction: Friction | None,
) -> ContactForces:
    """Return the forces of laws on a face, with friction where there is any.

    Args:
        face: The contact face with its patches.
        mode: Where the laws are evaluated.
        laws: One law per patch, or all of them together.
        gap: Macroscopic gap at this rank's samples, shape (n,) [mm].
        friction: The friction; None: none.
    """
    if friction is None:
        return ContactForces(face, face.sampling(mode), laws, gap)
    return FrictionalForces(face, mode, laws, gap, friction)
