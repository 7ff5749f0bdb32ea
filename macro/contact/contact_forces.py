"""Forces of contact laws on a face under a rigid plane, and their exact derivative.

Theory: section 11 of ``docs/theory.md``.
"""

from __future__ import annotations

import weakref
from collections.abc import Callable, Sequence
from typing import Any, Protocol, runtime_checkable

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc

from geometry.plane_equilibrium import UNSUPPORTED, PlaneResponse, find_equilibrium
from geometry.rigid_plane import Control, PlaneLevers, RigidPlane, plane_failure
from macro.contact.face_equilibrium import FaceEquilibrium
from macro.contact.loaded_face import ContactFace
from macro.contact.sampling import Sampling, by_patch
from support.collective import together

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

_FIRST, _FARTHEST = 1e-6, 1e3
"""First and last approach that first touch is looked for at, in halves of the diagonal."""


_MOVED, _SMOOTH = 1.5, 1.0 / 30.0
"""Ratio of stiffnesses of laws and body together that a preconditioner does not overlook, and
stiffness of the body over that of its elements: against pressures that change over several of
them. With the whole stiffness laws of 1 µm on a pad took 358 linear iterations for four load steps,
with a tenth 200; compared by the largest alone, stiff laws on a pad of ν = 0.45 took 22 to 32
iterations a solve, in place of 5 to 10."""

_MATRIX = "patchlaw matrix"


class ContactLaw(Protocol):
    """Contact pressure p of a patch as a function of its closure c.

    Closure is the approach of the plane minus the downward displacement of the block's surface
    [mm]. Pressures are positive in compression [MPa], and the stiffness is dp/dc ≥ 0 [MPa/mm]. Both
    must be defined for every closure, because Newton's iterates may leave the range of a tabulated
    law: whoever tabulates laws extends them and checks the converged closures.
    """

    def pressure(self, closure: Array, /) -> Array:
        """Return the pressures at closures of shape (n,)."""
        ...

    def stiffness(self, closure: Array, /) -> Array:
        """Return the exact derivative of the pressures at closures of shape (n,)."""
        ...


@runtime_checkable
class ContactLaws(Protocol):
    """The laws of all patches, evaluated together: as quick for many patches as for one."""

    def __len__(self) -> int:
        """Return the number of patches."""
        ...

    def pressures(self, patch: Indices, closure: Array, /) -> Array:
        """Return the pressures at closures of patches, shape (n,) [MPa]; see `ContactLaw`."""
        ...

    def stiffnesses(self, patch: Indices, closure: Array, /) -> Array:
        """Return the exact derivatives of the pressures, shape (n,) [MPa/mm]."""
        ...


class SingleLaws:
    """The laws of patches, evaluated one by one, and checked: they may be a user's functions.

    Args:
        laws: One law per patch.
    """

    def __init__(self, laws: Sequence[ContactLaw]) -> None:
        self._pressures = [law.pressure for law in laws]
        self._stiffnesses = [law.stiffness for law in laws]

    def __len__(self) -> int:
        return len(self._pressures)

    def pressures(self, patch: Indices, closure: Array) -> Array:
        """Return the pressures at closures of patches, see `ContactLaws.pressures`."""
        return by_patch(self._pressures, patch, closure)

    def stiffnesses(self, patch: Indices, closure: Array) -> Array:
        """Return the stiffnesses at closures of patches, see `ContactLaws.stiffnesses`."""
        return by_patch(self._stiffnesses, patch, closure)


class ContactForces:
    """Nodal forces B p(c(u)) of contact laws on a face that a rigid plane is pressed on.

    Closures are c = δ − g − Bᵀu / w, with the approach δ of the plane at the samples and the
    macroscopic gap g. Free motions of the plane follow from the displacement s of the samples: the
    force is the prescribed one, and there is no moment about the middle of the patches.

    The forces are minus the gradient of a convex energy if no law softens: the minimum of the
    energy over the motions of the plane is convex in s where the energy under a fixed plane is.
    With the stiffness D of the laws, the areas W of the samples and their levers G, closures change
    by G dq − ds, where (Gᵀ W D G) dq = Gᵀ W D ds. The derivative −B (diag(p'/w) − E Eᵀ) Bᵀ is
    applied without being assembled: B has few columns (patches) or few rows with entries (nodes of
    the interface), and E has a column for every free motion.

    Args:
        face: The contact face with its patches.
        sampling: Where the laws are evaluated.
        laws: One law per patch, or all of them together; the same on every rank.
        gap: Macroscopic gap between plane and face at this rank's samples, shape (n,) [mm].

    Attributes:
        gap: The gap; set it anew where other loads of the body change it.
        laws: The laws of all patches.
        levers: Levers of this rank's samples about the middle of the patches.
        plane: Approach at the middle of the patches [mm] and slopes along x and y, shape (3,).
        control: What the load step prescribes of the plane.
        slope: p'/w of this rank's samples at the latest `update`, shape (n,) [N/mm⁵].
        comm: MPI communicator of the mesh.

    Note:
        Every method is collective.
    """

    def __init__(
        self,
        face: ContactFace,
        sampling: Sampling,
        laws: Sequence[ContactLaw] | ContactLaws,
        gap: Array,
    ) -> None:
        self._face, self._sampling, self.comm = face, sampling, face.comm
        self.laws = laws if isinstance(laws, ContactLaws) else SingleLaws(laws)
        patches = face.patches
        self.levers = PlaneLevers.at(
            sampling.x, sampling.y, patches.lengths, centre=patches.middle, comm=self.comm
        )
        self.gap = gap
        self.plane: Array = np.zeros(3)
        self.control = Control(approach=0.0)
        self._unloaded = False
        self.slope: Array = np.zeros(len(sampling.weight))  # p'/w
        self._border: Array = np.zeros((len(sampling.weight), 0))  # E

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
        return self.closure_of(self._sampling.displacements(displacement))

    def closure_of(self, displacement: Array) -> Array:
        """Bring the plane into equilibrium, and return the closures of this rank's samples.

        Args:
            displacement: Downward displacements of this rank's samples, shape (n,) [mm].

        Returns:
            Closures, shape (n,) [mm].

        Raises:
            NotConverged: When nothing can hold the plane.
        """
        matrix, weight = self.levers.matrix, self._sampling.weight

        def closure(plane: Array) -> Array:
            # no other order of the sums: first touch is found to the last digit of closures
            return matrix @ plane - self.gap - displacement

        def respond(plane: Array) -> PlaneResponse[Array]:
            closed = closure(plane)
            return PlaneResponse(
                loads=self.loads(self.pressure(closed)),
                stiffness=lambda: self.levers.stiffness(weight * self.stiffness(closed)),
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
            return closure(self.plane)
        self.plane, closed = find_equilibrium(respond, self.control, self.plane, self.levers.half)
        return closed

    def closure_on_lines(
        self, displacement: Array, pressure: Callable[[Array], Array], stiffness: Array
    ) -> Array:
        """Bring the plane into equilibrium on laws that are lines, and return the closures.

        Args:
            displacement: Downward displacements of this rank's samples, shape (n,) [mm].
            pressure: Pressures of the samples [MPa] as linear functions of closures.
            stiffness: Their stiffnesses, shape (n,) [MPa/mm].
        """
        levers, free, weight = self.levers, self.control.free, self._sampling.weight
        closure = levers.matrix @ self.plane - self.gap - displacement
        if not free.any():
            return closure
        missing = self.control.loads - levers.loads(weight * pressure(closure))
        unit = levers.unit[free]
        resistance = levers.stiffness(weight * stiffness)[np.ix_(free, free)]
        scaled = np.linalg.lstsq(
            resistance * np.outer(unit, unit), unit * missing[free], UNSUPPORTED
        )
        self.plane = self.plane.copy()
        self.plane[free] += unit * scaled[0]
        return levers.matrix @ self.plane - self.gap - displacement

    def write(self, displacement: PETSc.Vec, load: PETSc.Vec) -> None:
        """Write the forces B p(c(u)) at a displacement u.

        Args:
            displacement: u [mm].
            load: Receives the nodal forces [N].
        """
        samples = self._sampling.values
        samples.array[:] = self.pressure(self.closure(displacement))
        self._sampling.operator.mult(samples, load)

    def write_lines(
        self,
        displacement: PETSc.Vec,
        closure: Array,
        pressure: Array,
        stiffness: Array,
        load: PETSc.Vec,
        *,
        body: float,
        shear: Array | None,
    ) -> None:
        """Write the forces on laws that are lines, and move the derivative to these.

        Args:
            displacement: u [mm].
            closure: Closures of this rank's samples, shape (n,) [mm].
            pressure: Their pressures on the lines [MPa].
            stiffness: Their stiffnesses [MPa/mm].
            load: Receives the nodal forces [N].
            body: Stiffness of the body under all samples, which friction asks for [MPa/mm].
            shear: Predicted shear stresses, shape (n, 2 or 0) [MPa]; None: those on the last lines.
        """
        samples = self._sampling.values
        samples.array[:] = pressure
        self._sampling.operator.mult(samples, load)
        self.linearise(stiffness)

    def write_shear_in(
        self,
        parts: Array,
        y: Array,
        stretches: Array,
        closure: Array,
        pressure: Array,
        stiffness: Array,
    ) -> None:
        """Add the work of shear stresses in each of k displacements, none without friction.

        Args:
            parts: Receives the work on this rank, and its derivatives by the shares, (> k, k).
            y: Shares of the displacements, shape (k,).
            stretches: What samples move by in each against their directions, times their weights,
                shape (k, n, 1 or 3) [mm³].
            closure: Closures of this rank's samples, shape (n,) [mm].
            pressure: Their pressures on the lines [MPa].
            stiffness: Their stiffnesses [MPa/mm].
        """

    def along(self, displacement: PETSc.Vec) -> Array:
        """Return displacements along the face that shear stresses follow, none without friction."""
        return np.zeros((len(self._sampling.weight), 0))

    @property
    def last_shear(self) -> Array:
        """Shear stresses of the latest load step, (n, 2) [MPa]; none without friction, (n, 0)."""
        return np.zeros((len(self._sampling.weight), 0))

    def write_last_shear(self, load: PETSc.Vec) -> None:
        """Write the forces by the shear stresses of the latest load step, none without friction.

        Args:
            load: Receives the nodal forces [N].
        """
        load.set(0.0)

    def update(self, displacement: PETSc.Vec) -> None:
        """Move the derivative to a displacement."""
        self.linearise(self.stiffness(self.closure(displacement)))

    def linearise(self, stiffness: Array) -> None:
        """Move the derivative to stiffnesses of this rank's samples, shape (n,) [MPa/mm]."""
        self.slope = stiffness / self._sampling.weight
        self._border = self.border(stiffness)

    def moved_from(self, slope: Array, elements: float) -> bool:
        """Return whether the stiffness of laws and elements has changed since earlier slopes.

        Args:
            slope: The earlier ones, as `slope`.
            elements: Stiffness of the elements at the face [MPa/mm].
        """
        areas = np.repeat(self.weight, len(slope) // max(len(self.weight), 1))
        body = _SMOOTH * elements
        ratio = (areas * self.slope + body) / (areas * slope + body)
        most = float(np.maximum(ratio, 1.0 / ratio).max(initial=1.0))
        return bool(self.comm.allreduce(most, op=MPI.MAX) > _MOVED)

    @property
    def weight(self) -> Array:
        """Areas of this rank's samples, shape (n,) [mm²]."""
        return self._sampling.weight

    @property
    def normal_slope(self) -> Array:
        """p'/w of this rank's samples at the latest `update`, shape (n,) [N/mm⁵]."""
        return self.slope

    def add_product(self, x: PETSc.Vec, y: PETSc.Vec, known: Array | float = 0.0) -> None:
        """Add the product B (diag(p'/w) − E Eᵀ) Bᵀ x to y.

        Args:
            x: A vector.
            y: What it is added to.
            known: A part of p'/w that is left out, as y holds its product already, shape (n,).
        """
        self._add_product(x, y, self.slope - known, self._border)

    def add_springs_product(self, slope: Array, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Add the product B diag(s) Bᵀ x with other slopes s, shape (n,), to y."""
        self._add_product(x, y, slope, self._border[:, :0])

    def _add_product(self, x: PETSc.Vec, y: PETSc.Vec, slope: Array, border: Array) -> None:
        operator, samples = self._sampling.operator, self._sampling.values
        operator.multTranspose(x, samples)
        samples.array[:] = self._change(samples.array_r, slope, border)
        operator.multAdd(samples, y, y)

    @property
    def loads_of_motions(self) -> Array:
        """B E: this rank's rows of nodal loads by free motions of the plane, shape (m, k')."""
        operator, samples = self._sampling.operator, self._sampling.values
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
        return self._change(stretch, self.normal_slope, self._border)

    def _change(self, stretch: Array, slope: Array, border: Array) -> Array:
        pressure = slope * stretch
        if border.shape[1]:
            pressure -= border @ self.levers.summed(border.T @ stretch)
        return np.asarray(pressure)

    def pressure(self, closure: Array) -> Array:
        """Return the laws' pressures at this rank's samples, shape (n,) [MPa].

        What a law raises on one rank is raised on all.
        """
        return together(self.comm, lambda: self.laws.pressures(self._sampling.patch, closure))

    def stiffness(self, closure: Array) -> Array:
        """Return the laws' stiffnesses dp/dc likewise, none without force, (n,) [MPa/mm]."""
        if self._unloaded:
            return np.zeros_like(closure)
        return together(self.comm, lambda: self.laws.stiffnesses(self._sampling.patch, closure))

    def loads(self, pressure: Array) -> Array:
        """Return force and first moments about the middle of pressures, shape (3,) [N, N mm].

        Args:
            pressure: Pressures of this rank's samples, shape (n,) [MPa].
        """
        return self.levers.loads(self._sampling.weight * pressure)

    def state(self, closure: Array, **known: Any) -> FaceEquilibrium:
        """Return the contact under the plane as it is now.

        Args:
            closure: Closures of this rank's samples, shape (n,) [mm].
            known: What else is known of the state.
        """
        pressure, areas = self.pressure(closure), self._face.areas
        (force, *moment), patch_force = self.loads(pressure), self._sampling.patch_sums(pressure)
        (approach, *tilt), (xc, yc) = map(float, self.plane), map(float, self._face.patches.middle)
        return FaceEquilibrium(
            plane=RigidPlane(approach=approach, tilt=(tilt[0], tilt[1]), centre=(xc, yc)),
            force=float(force),
            moment=np.array(moment),
            patch_force=patch_force,
            patch_pressure=patch_force / areas,
            patch_closure=self._sampling.patch_sums(closure) / areas,
            sample_closure=closure,
            sample_pressure=pressure,
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
        resistance = self.levers.stiffness(self._sampling.weight * stiffness)
        values, vectors = np.linalg.eigh((resistance * np.outer(unit, unit))[np.ix_(free, free)])
        supported = values > UNSUPPORTED * max(values[-1], 0.0)
        return columns @ (vectors[:, supported] / np.sqrt(values[supported]))


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
