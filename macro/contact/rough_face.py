"""The rough face of a body, which a rigid plane is pressed on.

Theory: section 12 of ``docs/theory.md``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple, Self

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from geometry.face_frame import UPWARD, FaceFrame
from geometry.patches import PatchGrid
from geometry.plane_equilibrium import UNSUPPORTED, PlaneResponse, find_equilibrium
from geometry.rigid_plane import Control, PlaneLevers
from macro.bodies import Block
from macro.contact.initial_guess import Guess
from macro.contact.loaded_face import LoadedFace
from macro.elastic_body import ElasticBody
from macro.mesh.block import TOP
from macro.mesh.contact_face import ContactFacets, contact_facets
from support.errors import InputError, NotConverged

_UPRIGHT = 1e-12
"""Deviation of a face's normal from the z axis that is rounding."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RoughFace:
    """The rough face of a body that is meshed with its roughness; it looks along the z axis.

    Args:
        body: The body.
        marker: Marker of the face's facets.
        lengths: Sides (Lx, Ly) of the face's rectangle, about whose middle a plane turns [mm].
        modulus: Contact modulus E* of the body at the face [MPa].
        frame: Frame of the face, in whose coordinates the rectangle begins at the origin.

    Raises:
        InputError: When the face does not look along the z axis.
    """

    body: ElasticBody
    marker: int
    lengths: tuple[float, float]
    modulus: float
    frame: FaceFrame = UPWARD

    def __post_init__(self) -> None:
        if not np.allclose(self.frame.normal, [0.0, 0.0, 1.0], rtol=0.0, atol=_UPRIGHT):
            raise InputError(
                "a face that is meshed with its roughness must look along the z axis",
                value=self.frame.normal.tolist(),
                allowed="[0, 0, 1]",
            )

    @classmethod
    def of_block(cls, block: Block) -> Self:
        """Return the top of a block.

        Raises:
            InputError: When the block has a margin.
        """
        if block.mesh.shape.margin:
            raise InputError(
                "the plane presses on the whole top, which has no margin",
                value=block.mesh.shape.margin,
                allowed="0 mm",
            )
        lengths, modulus = block.mesh.shape.interface, block.material.contact_modulus
        return cls(body=block, marker=TOP, lengths=lengths, modulus=modulus)

    @classmethod
    def of_body(
        cls,
        body: ElasticBody,
        marker: int,
        lengths: tuple[float, float],
        frame: FaceFrame = UPWARD,
    ) -> Self:
        """Return a face of any body, with the largest contact modulus of the cells behind it.

        Args:
            body: The body.
            marker: Marker of the face's facets.
            lengths: Sides (Lx, Ly) of the face's rectangle [mm].
            frame: Frame of the face, in whose coordinates the rectangle begins at the origin.

        Raises:
            InputError: When no facet has the marker, or the face does not look along the z axis.

        Note:
            Collective.
        """
        facets = contact_facets(body.mesh.mesh, body.mesh.facet_tags.find(marker), frame)
        lame, shear = body.cell_lame
        modulus = np.broadcast_to(
            4.0 * shear * (lame + shear) / (lame + 2.0 * shear), np.shape(lame) or 1
        )
        behind = modulus[facets.cell] if np.ndim(lame) else modulus[: len(facets.cell)]
        largest = body.comm.allreduce(float(behind.max(initial=0.0)), op=MPI.MAX)
        if not largest:
            raise InputError("no facet of the body has this marker", value=marker)
        return cls(body=body, marker=marker, lengths=lengths, modulus=largest, frame=frame)

    @property
    def facets(self) -> ContactFacets:
        """The facets whose cells this rank owns; there may be none."""
        mesh = self.body.mesh
        return contact_facets(mesh.mesh, mesh.facet_tags.find(self.marker), self.frame)

    @property
    def whole(self) -> PatchGrid:
        """One patch of the whole face."""
        return PatchGrid(grid=(1, 1), lengths=self.lengths)

    def loaded(self, degree: int) -> LoadedFace:
        """Return the face with quadrature that is exact for a polynomial degree."""
        return LoadedFace(self.body, self.facets, self.whole, degree)


Array = NDArray[np.float64]
Flags = NDArray[np.bool_]


class PlaneOverNodes:
    """A rigid plane above this rank's nodes on the top.

    Args:
        x: Abscissae of the nodes, shape (n,) [mm].
        y: Their ordinates [mm].
        distance: Their distances from the plane at no approach and no tilt [mm].
        lengths: Sides of the interface, about whose centre the plane turns [mm].
        comm: MPI communicator.

    Attributes:
        distance: As given.
        levers: Levers of the nodes.
        centre: Centre of the interface, shape (2,) [mm].

    Note:
        Methods that sum over the nodes are collective.
    """

    def __init__(
        self, x: Array, y: Array, distance: Array, lengths: tuple[float, float], comm: Any
    ) -> None:
        self.distance, self.centre = distance, 0.5 * np.asarray(lengths)
        self.levers = PlaneLevers.at(x, y, lengths, comm=comm)

    def placed(self, control: Control, plane: Array) -> Array:
        """Return the plane with its prescribed motions, and with its free ones as at the start.

        Without any force the plane just touches the top.

        Args:
            control: What the load step prescribes.
            plane: Where the plane may start, shape (3,).
        """
        plane = control.prescribed(plane)
        if control.force == 0.0:
            plane[0] = self.levers.first_touch(self.distance, plane[1:])
        return plane

    def interference(self, plane: Array, displacement: Array) -> Array:
        """Return how far the plane is below the nodes, negative where it is above, (n,) [mm].

        Args:
            plane: Approach [mm] and slopes, shape (3,).
            displacement: Downward displacements of the nodes, shape (n,) [mm].
        """
        return self.levers.matrix @ plane - displacement - self.distance

    def supported_motions(self, free: Flags, at: Flags) -> Array:
        """Return the combinations of free motions that move some of the nodes, shape (k, k').

        They are scaled so that ``levers.scaled(free)[at]`` times them has orthonormal columns, all
        ranks together.

        Args:
            free: Motions that are free, shape (3,).
            at: Which of this rank's nodes are meant, shape (n,).
        """
        levers = self.levers.scaled(free)[at]
        values, vectors = np.linalg.eigh(self.levers.summed(levers.T @ levers))
        supported = values > UNSUPPORTED * max(values.max(initial=0.0), 1.0)
        scaled: Array = vectors[:, supported] / np.sqrt(values[supported])
        return scaled

    def on_springs(
        self, control: Control, start: Array, displacement: Array, stiffness: Array
    ) -> Array:
        """Return where the plane comes to rest on springs at the nodes, shape (3,).

        Args:
            control: What the load step prescribes.
            start: The plane to start from, with what is prescribed of it, shape (3,).
            displacement: Downward displacements of the nodes, shape (n,) [mm].
            stiffness: Stiffnesses of springs that only push, shape (n,) [N/mm].

        Raises:
            NotConverged: When nothing can hold the plane.
        """

        def respond(plane: Array) -> PlaneResponse[None]:
            depth = self.interference(plane, displacement)
            return PlaneResponse(
                loads=self.levers.loads(stiffness * np.maximum(depth, 0.0)),
                stiffness=lambda: self.levers.stiffness(np.where(depth > 0.0, stiffness, 0.0)),
                state=None,
            )

        return find_equilibrium(respond, control, start, self.levers.half)[0]


def not_found(control: Control, reason: str, iterations: int) -> NotConverged:
    """Return the error of a load step whose contact was not found.

    Args:
        control: What the load step prescribes.
        reason: Name of the reason.
        iterations: Iterations that were made.
    """
    return NotConverged(
        f"the contact of the rough block at {control}",
        reason=reason,
        iterations=iterations,
        remedy="take smaller load steps (load.steps)",
    )


class ContactSolution(NamedTuple):
    """Contact of a rough top with a rigid plane; arrays hold this rank's part.

    Attributes:
        end: Plane, displacement, and what the method starts from in further load steps.
        nodal_force: Contact forces of the nodes of the top, shape (n,) [N].
        touching: Whether these nodes are in contact, shape (n,).
        iterations: Active sets that were solved for, or Newton steps.
        linear_iterations: Iterations of the linear solver.
        reason: Name of the reason to stop.
    """

    end: Guess
    nodal_force: Array
    touching: NDArray[np.bool_]
    iterations: int
    linear_iterations: int
    reason: str


def largest(values: Array, comm: Any) -> float:
    """Return the largest size of numbers over all ranks; 0 where there are none.

    Args:
        values: This rank's numbers.
        comm: MPI communicator.

    Note:
        Collective.
    """
    return float(comm.allreduce(float(np.abs(values).max(initial=0.0)), op=MPI.MAX))
