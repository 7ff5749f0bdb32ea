"""Equilibrium of a meshed body in contact at one load step, and whether its supports bear it.

Theory: section 11 of ``docs/theory.md``.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from petsc4py import PETSc

from patchlaw.geometry import RigidPlane
from patchlaw.macro.contact.loaded_face import ContactFace
from patchlaw.support import Array, Indices, NotBalanced


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
    region: Indices


class FaceShear(NamedTuple):
    """Shear of a face with friction.

    Attributes:
        shift: Shift of the plane along the axes of the face [mm].
        force: Shear force on the plane along them [N].
        dissipated: Energy lost to friction since the start [N mm].
        sample_stress: Shear stresses on the body at this rank's samples of laws, shape (n, 2)
            [MPa].
        sample_slip: Displacements of the plane along both axes beyond those of the body there, with
            what asperities take before they slip, shape (n, 2) [mm].
        stick_closure: Closures at which as much area is in contact as sticks at these samples,
            shape (n,) [mm].
    """

    shift: tuple[float, float]
    force: tuple[float, float]
    dissipated: float
    sample_stress: Array
    sample_slip: Array
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
            face into the body, and, with laws, less the macroscopic gap and what has worn off,
            shape (N,) [mm].
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
        sample_worn_depth: Depths that have worn off there, shape (n,) [mm].
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
    sample_worn_depth: Array = field(default_factory=_no_numbers)
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


_ROUNDING, _MOST = 1e-6, 1e-4
"""Least and largest relative difference that is allowed, whatever the solver's tolerance. The load
steps of all tests are below 1e-7; 1e-4 is less than the errors that runs state."""

_AXES = ("along the first axis", "along the second axis", "along the normal")
_KINDS = ("force", "N", ""), ("moment", "N mm", "about the middle of the contact face, ")


def checked_reaction(
    face: ContactFace,
    displacement: PETSc.Vec,
    load: PETSc.Vec,
    on_supports: PETSc.Vec | None = None,
    *,
    force: float,
    shear: tuple[float, float] = (0.0, 0.0),
    tolerance: float,
    what: str,
    iterations: int,
) -> float:
    """Return the force that supports bear along the normal, once all forces are in balance [N].

    Contact is known by its stresses, and what supports bear by the stiffness of the whole body,
    rows of held displacements included. Both are forces and moments on one body, which differ by
    the residual of its free displacements alone: as little as the solver's tolerance allows.

    A residual of norm r leaves forces of at most √n r over, with n nodes, and moments of that times
    their levers (Cauchy and Schwarz).

    Args:
        face: The contact face of a body, or of two.
        displacement: Displacements by the contact, without those by other loads [mm].
        load: Nodal forces of the contact on displacements that no support holds [N].
        on_supports: Those on displacements that supports hold; None: there are none.
        force: Normal force of the contact, as it is stated [N].
        shear: Shear force on the body along the axes of the face [N].
        tolerance: Of the solver: norm of the residual relative to that of the load.
        what: What was solved for, for an error.
        iterations: Iterations that it took.

    Raises:
        NotBalanced: When supports of either body bear other forces or moments than the contact
            exerts on it; says by how much.

    Note:
        Collective.
    """
    sides, whole, frame = face.sides, face.body, face.sides[0].facets.frame
    axes, point = frame.axes, frame.in_space([face.patches.middle])[0]
    allowed = min(_ROUNDING + tolerance * float(np.sqrt(whole.dofs / 3)), _MOST)
    held = load.duplicate() if on_supports is None else on_supports
    vectors = [each.array_r for each in (displacement, load, held)]
    parts = [whole.split(each) if len(sides) > 1 else (each,) for each in vectors]
    reactions = []
    for body, moved, on_free, on_held, sign in zip(
        [side.body for side in sides], *parts, (1.0, -1.0), strict=False
    ):
        arms = body.space.tabulate_dof_coordinates()[: body.owned_dofs // 3] - point
        direct, exerted = (
            axes @ body.comm.allreduce(_resultant(arms, nodal))
            for nodal in (on_held, on_free + on_held)
        )
        borne = axes @ body.borne(moved, point).T - direct
        exerted[:, 0] = sign * np.array([*shear, -force])
        size = np.array([1.0, body.size]) * max(abs(force), float(np.hypot(*shear)))
        left = np.abs(exerted + borne) / np.where(size > 0.0, size, 1.0)
        if not (left <= allowed).all():
            worst = np.unravel_index(np.argmax(left), left.shape)
            owner = "body" if sign > 0.0 else "counter-body"
            raise NotBalanced(
                what,
                reason=f"NOT_BALANCED: the supports of the {owner} bear "
                f"{_in_words(worst, borne, exerted)}, where {allowed:.1g} of "
                f"{size[worst[1]]:.4g} may be left over",
                iterations=iterations,
                remedy="leave out PETSc's options that loosen tolerances; if there are none, these "
                "results are wrong: please report the scene",
            )
        reactions.append(float(borne[2, 0]))
    return reactions[0]


def _in_words(worst: tuple[Any, ...], borne: Array, exerted: Array) -> str:
    """Return the part of a load on the supports, and of that on the contact, that differs most."""
    axis, kind = worst
    name, unit, around = _KINDS[kind]
    against = f"against {-exerted[axis, kind]:.7g} {unit} by the contact"
    return f"a {name} of {borne[axis, kind]:.7g} {unit} {around}{_AXES[axis]}, {against}"


def _resultant(arms: Array, nodal: Array) -> Array:
    """Return the sums of this rank's nodal forces and of their moments, shape (3, 2)."""
    forces = nodal.reshape(-1, 3)
    return np.stack([forces.sum(axis=0), np.cross(arms, forces).sum(axis=0)], axis=1)
