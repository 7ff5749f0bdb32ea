"""Equilibrium of a meshed body under contact at one load step, however it was solved."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from patchlaw.geometry.rigid_plane import RigidPlane
from patchlaw.support.arrays import Array


class NodalContact(NamedTuple):
    """Contact of nodes of a rough face.

    Attributes:
        x: Abscissae of the n nodes, shape (n,) [mm].
        y: Their ordinates [mm].
        force: Their contact forces [N].
        area: Their tributary areas [mm²].
        pressure: Their contact pressures [MPa]; 0 at the vertices of quadratic triangles, which
            have no area.
        gap: Their gaps [mm].
        region: Regions 0 … m − 1 of contact that they are in; −1 outside.
    """

    x: Array
    y: Array
    force: Array
    area: Array
    pressure: Array
    gap: Array
    region: NDArray[np.intp]


class FaceShear(NamedTuple):
    """Shear of a face with friction.

    Attributes:
        shift: Shift of the plane along the axes of the face [mm].
        force: Shear force on the plane along them [N].
        dissipated: Energy lost to friction since the start [N mm].
        sample_stress: Shear stresses on the body at this rank's samples of laws, shape (n, 2)
            [MPa].
        stick_closure: Closures at which as much area is in contact as sticks at these samples,
            shape (n,) [mm].
    """

    shift: tuple[float, float]
    force: tuple[float, float]
    dissipated: float
    sample_stress: Array
    stick_closure: Array


def _no_numbers() -> Array:
    return np.empty(0)


@dataclass(frozen=True, kw_only=True, eq=False)
class FaceEquilibrium:
    """Equilibrium of a meshed body whose face is in contact with a rigid plane.

    It is not the contact itself. A `ContactState` holds the contact of a whole surface on one
    process, with its spots and fields. Here the unknowns are displacements that are distributed
    over ranks: displacements, samples of laws and nodes are those of this rank, and all else is the
    same on every rank. Of meshed roughness, `macro.nodal_contact` gathers what a `ContactState` is
    made of.

    Args:
        plane: The plane; its centre is the middle of the patches.
        force: Force on the face against its normal [N].
        moment: First moments of the pressures along x and y about the middle, shape (2,) [N mm].
        patch_force: Forces on the N patches, shape (N,) [N].
        patch_pressure: Their mean pressures, shape (N,) [MPa].
        patch_closure: Their mean closures: the approach of the plane less the displacement of the
            face into the body, and, with laws, less the macroscopic gap, shape (N,) [mm].
        contact_area: Real contact area [mm²]; None where a law does not know it. Of meshed
            roughness, with its border within facets, see `macro.contact.face_nodes.covered`.
        displacement: This rank's owned displacements, dof by dof, those by other loads than the
            contact included [mm]; in a user's own problem they are in the user's function.
        reaction: Force that the supports bear [N]; equals ``force`` in equilibrium.
        iterations: Newton steps, or active sets that were solved for.
        linear_iterations: Iterations of the linear solver, all steps together.
        residuals: Norms of the residual before each Newton step and at the end, relative to that of
            the contact forces.
        reason: Name of the reason to stop.
        sample_closure: Closures of this rank's samples of laws, patches or points, (n,) [mm].
        sample_pressure: Pressures of these samples, shape (n,) [MPa].
        patch_area: Contact areas of the patches of meshed roughness, shape (N,) [mm²]; by nodes,
            each with its tributary area, as in ``nodal_area``.
        nodal_area: Tributary area of the nodes in contact [mm²].
        nodes: Number of nodes in contact.
        contacts: Number of connected regions of contact.
        mean_separation: Mean gap between the plane and the meshed roughness [mm].
        peak_pressure: Largest nodal pressure [MPa].
        nodal: Contact of this rank's nodes of meshed roughness.
        shear: Shear of a face with friction; None without.
    """

    plane: RigidPlane
    force: float
    moment: Array
    patch_force: Array
    patch_pressure: Array
    patch_closure: Array
    contact_area: float | None = None
    displacement: Array = field(default_factory=_no_numbers)
    reaction: float = np.nan
    iterations: int = 0
    linear_iterations: int = 0
    residuals: Array = field(default_factory=_no_numbers)
    reason: str = ""
    sample_closure: Array = field(default_factory=_no_numbers)
    sample_pressure: Array = field(default_factory=_no_numbers)
    patch_area: Array = field(default_factory=_no_numbers)
    nodal_area: float = 0.0
    nodes: int = 0
    contacts: int = 0
    mean_separation: float = np.nan
    peak_pressure: float = np.nan
    nodal: NodalContact | None = None
    shear: FaceShear | None = None

    @property
    def approach(self) -> float:
        """Approach of the plane at the middle of the patches [mm]."""
        return self.plane.approach

    @property
    def tilt(self) -> tuple[float, float]:
        """Change of the approach along x and y [mm/mm]."""
        return self.plane.tilt
