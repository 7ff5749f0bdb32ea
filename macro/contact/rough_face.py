"""The rough face of a body, which a rigid plane is pressed on.

Theory: section 12 of ``docs/theory.md``.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple, Self

import numpy as np

from patchlaw.geometry.face_frame import UPWARD
from patchlaw.geometry.patches import PatchGrid
from patchlaw.geometry.rigid_plane import (
    UNSUPPORTED,
    Control,
    PlaneLevers,
    PlaneResponse,
    find_equilibrium,
)
from patchlaw.macro.bodies import Block
from patchlaw.macro.contact.loaded_face import LoadedFace
from patchlaw.macro.elastic_body import ElasticBody
from patchlaw.macro.mesh.block import TOP
from patchlaw.macro.mesh.contact_face import ContactFacets, contact_facets
from patchlaw.support.arrays import Array, Flags
from patchlaw.support.errors import InputError, NotConverged


@dataclass(frozen=True, eq=False)
class RoughFace:
    """The rough face of a body that is meshed with its roughness: around z = 0, looking along z.

    Args:
        body: The body.
        marker: Marker of the face's facets.
        lengths: Sides (Lx, Ly) of the face's rectangle, which begins at the origin [mm]. A plane
            turns about its middle.
    """

    body: ElasticBody
    marker: int
    lengths: tuple[float, float]

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
        return cls(block, TOP, block.mesh.shape.interface)

    @cached_property
    def facets(self) -> ContactFacets:
        """The facets whose cells this rank owns; there may be none."""
        mesh = self.body.mesh
        return contact_facets(mesh.mesh, mesh.facet_tags.find(self.marker), UPWARD)

    @cached_property
    def modulus(self) -> float:
        """Largest contact modulus E* of the cells behind the face [MPa].

        Raises:
            InputError: When no facet has the marker.
        """
        behind = self.body.materials_of(self.facets.cell)
        if not behind:
            raise InputError("no facet of the body has this marker", value=self.marker)
        return max(material.contact_modulus for material in behind)

    @property
    def whole(self) -> PatchGrid:
        """One patch of the whole face."""
        return PatchGrid(grid=(1, 1), lengths=self.lengths)

    @cached_property
    def loaded(self) -> LoadedFace:
        """The face with quadrature that is exact for products of two basis functions."""
        return LoadedFace(self.body, self.facets, self.whole, 2 * self.body.degree)


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


class Guess(NamedTuple):
    """Where an iteration on meshed roughness starts, and what a solution is for further ones.

    Attributes:
        plane: Approach [mm] and slopes of the plane, shape (3,).
        displacement: This rank's owned degrees of freedom [mm].
        contact: Contact forces of its nodes, or pressures of its quadrature points, shape (n,).
    """

    plane: Array
    displacement: Array
    contact: Array


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
    touching: Flags
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
    return float(comm.allreduce(float(np.abs(values).max(initial=0.0)), max))
