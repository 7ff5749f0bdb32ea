"""Equilibrium of a block with contact laws under a rigid plane: residual and exact tangent.

Theory: section 11 of ``demos/theory.md``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc

from geometry.collective import together
from geometry.plane_equilibrium import UNSUPPORTED, PlaneResponse, find_equilibrium
from geometry.rigid_plane import Control, PlaneLevers, plane_failure
from macro.contact.law_interface import ContactLaw, Interface, Sampling
from macro.linear_solvers.options import WeakContext

Array = NDArray[np.float64]

_FIRST, _FARTHEST = 1e-6, 1e3
"""First and last approach that first touch is looked for at, in halves of the diagonal."""


class Equilibrium:
    """The equations K u = B p(c(u)) of a block in contact with a rigid plane.

    Closures are c = δ − Bᵀu / w, with the approach δ of the plane at the samples. Free motions of
    the plane follow from the displacement s of the samples: the force is the prescribed one, and
    there is no moment about the middle of the patches. The plane is eliminated by that nonlinear
    equilibrium, so that displacements are the only unknowns of Newton's method.

    The residual K u − B p is the gradient of a convex energy if no law softens: the minimum of the
    energy over the motions of the plane is convex in s where the energy under a fixed plane is.
    With the stiffness D of the laws, the areas W of the samples and their levers G, closures change
    by G dq − ds, where (Gᵀ W D G) dq = Gᵀ W D ds. The derivative K + B (diag(p'/w) − E Eᵀ) Bᵀ is
    applied without being assembled: B has few columns (patches) or few rows with entries (nodes of
    the interface), and E has a column for every free motion. It lies between K and the derivative
    under a fixed plane.

    Args:
        interface: The patches on the block.
        sampling: Where the laws are evaluated.
        laws: One law per patch, the same on every rank.

    Attributes:
        block: The elastic block.
        levers: Levers of this rank's samples about the middle of the patches.
        plane: Approach at the middle of the patches [mm] and slopes along x and y, shape (3,).
        control: What the load step prescribes of the plane.
        tangent: The derivative at the displacement last given to ``update_tangent``, a PETSc
            matrix without entries.
        scale: Norm of the interface's load at the displacement last given to ``residual`` [N].

    Note:
        Every method is collective.
    """

    def __init__(
        self, interface: Interface, sampling: Sampling, laws: Sequence[ContactLaw]
    ) -> None:
        self.block, self._sampling = interface.block, sampling
        self._comm = self.block.mesh.comm
        self._pressures = [law.pressure for law in laws]
        self._stiffnesses = [law.stiffness for law in laws]
        patches = interface.patches
        self.levers = PlaneLevers.at(
            sampling.x, sampling.y, patches.lengths, centre=patches.middle, comm=self._comm
        )
        self.plane: Array = np.zeros(3)
        self.control = Control(approach=0.0)
        self.scale = 0.0
        stiffness = self.block.stiffness
        self._load = stiffness.createVecLeft()
        self._samples = sampling.operator.createVecRight()
        self._slope: Array = np.zeros(len(sampling.weight))  # p'/w
        self._border: Array = np.zeros((len(sampling.weight), 0))  # E
        self.tangent = PETSc.Mat().createPython(
            stiffness.getSizes(), WeakContext(self), comm=stiffness.comm
        )
        self.tangent.setUp()

    def prescribe(self, control: Control, plane: Array) -> None:
        """Set what a load step prescribes; without any force the plane just touches the surface.

        Args:
            control: What a load step prescribes.
            plane: Where the plane is now, shape (3,).

        Raises:
            NotConverged: When the plane should touch what cannot be touched.
        """
        self.control, self.plane = control, control.prescribed(plane)
        if control.force == 0.0:
            self.plane[0] = first_touch(self._touched, control, self.levers.half)

    def closure(self, displacement: PETSc.Vec) -> Array:
        """Bring the plane into equilibrium, and return this rank's closures, shape (n,) [mm]."""
        self._sampling.operator.multTranspose(displacement, self._samples)
        return self.closure_of(self._samples.array_r / self._sampling.weight)

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
            closure = self.levers.matrix @ plane - displacement
            weight = self._sampling.weight
            return PlaneResponse(
                loads=self.loads(self.pressure(closure)),
                stiffness=lambda: self.levers.stiffness(weight * self.stiffness(closure)),
                state=closure,
            )

        if not self.control.free.any():
            return self.levers.matrix @ self.plane - displacement
        self.plane, closure = find_equilibrium(respond, self.control, self.plane, self.levers.half)
        return closure

    def residual(self, displacement: PETSc.Vec, residual: PETSc.Vec) -> None:
        """Write the residual K u − B p(closure(u)) at a displacement u.

        Args:
            displacement: u [mm].
            residual: Receives the residual [N].
        """
        self._samples.array[:] = self.pressure(self.closure(displacement))
        self._sampling.operator.mult(self._samples, self._load)
        self.scale = self._load.norm()
        self.block.stiffness.mult(displacement, residual)
        residual.axpy(-1.0, self._load)

    def update_tangent(self, displacement: PETSc.Vec) -> None:
        """Move the tangent to a displacement."""
        stiffness = self.stiffness(self.closure(displacement))
        self._slope = stiffness / self._sampling.weight
        self._border = self.border(stiffness)

    def mult(self, _matrix: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Write the tangent's product K x + B (diag(p'/w) − E Eᵀ) Bᵀ x; PETSc calls this."""
        operator, samples = self._sampling.operator, self._samples
        self.block.stiffness.mult(x, y)
        operator.multTranspose(x, samples)
        stretch = samples.array_r
        pressure = self._slope * stretch
        if self._border.shape[1]:
            pressure -= self._border @ self.levers.summed(self._border.T @ stretch)
        samples.array[:] = pressure
        operator.multAdd(samples, y, y)

    multTranspose = mult

    def pressure(self, closure: Array) -> Array:
        """Return the laws' pressures at this rank's samples, shape (n,) [MPa].

        What a law raises on one rank is raised on all.
        """
        return together(self._comm, lambda: self._sampling.by_patch(self._pressures, closure))

    def stiffness(self, closure: Array) -> Array:
        """Return the laws' stiffnesses dp/dc likewise, shape (n,) [MPa/mm]."""
        return together(self._comm, lambda: self._sampling.by_patch(self._stiffnesses, closure))

    def loads(self, pressure: Array) -> Array:
        """Return force and first moments about the middle of pressures, shape (3,) [N, N mm].

        Args:
            pressure: Pressures of this rank's samples, shape (n,) [MPa].
        """
        return self.levers.loads(self._sampling.weight * pressure)

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

    def _touched(self, approach: float) -> bool:
        """Return whether the plane touches the undeformed block at an approach."""
        closure = self.levers.matrix @ np.array([approach, *self.plane[1:]])
        return float(self.loads(self.pressure(closure))[0]) > 0.0


def first_touch(touched: Callable[[float], bool], control: Control, half: float) -> float:
    """Find the largest approach at which a plane is not in contact yet [mm].

    Args:
        touched: Returns whether the plane is in contact at an approach.
        control: What is prescribed of the plane, for an error.
        half: Half the diagonal of the interface [mm].

    Raises:
        NotConverged: When it never is.
    """
    below, above, width = -_FIRST * half, _FIRST * half, np.inf
    while touched(below):
        below, above = 3.0 * below, below
    while not touched(above):
        below, above = above, 3.0 * above
        if above > _FARTHEST * half:
            raise plane_failure(control, "NO_CONTACT")
    while 0.0 < above - below < width:  # to neighbouring numbers
        width, middle = above - below, 0.5 * (below + above)
        below, above = (below, middle) if touched(middle) else (middle, above)
    return below
