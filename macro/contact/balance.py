"""Whether supports bear what contact exerts on a body: checked at every load step on a mesh.

Contact is known by its stresses, and what supports bear by the stiffness of the whole body, rows of
held displacements included. Both are forces and moments on one body, which differ by the residual
of its free displacements alone: as little as the solver's tolerance allows.

Theory: section 11 of ``docs/theory.md``.
"""

from __future__ import annotations

import numpy as np
from petsc4py import PETSc

from patchlaw.macro.contact.loaded_face import ContactFace
from patchlaw.support.arrays import Array
from patchlaw.support.errors import NotBalanced

_ROUNDING, _MOST = 1e-6, 1e-4
"""Least and largest relative difference that is allowed, whatever the solver's tolerance. The load
steps of all tests are below 1e-7; 1e-4 is less than the errors that runs state."""

_AXES = ("along the first axis", "along the second axis", "along the normal")


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
    sides, whole = face.sides, face.body
    axes, middle = sides[0].facets.frame.axes, face.patches.middle
    point = sides[0].facets.frame.in_space([middle])[0]
    allowed = min(_ROUNDING + tolerance * float(np.sqrt(whole.dofs / 3)), _MOST)
    stated, reactions = np.array([*shear, -force]), []
    held = load.duplicate() if on_supports is None else on_supports
    parts = [
        whole.split(each.array_r) if len(sides) > 1 else (each.array_r,)
        for each in (displacement, load, held)
    ]
    for side, moved, on_free, on_held, sign in zip(sides, *parts, (1.0, -1.0), strict=False):
        body = side.body
        arms = body.space.tabulate_dof_coordinates()[: body.owned_dofs // 3] - point
        direct, exerted = (
            axes @ body.comm.allreduce(_resultant(arms, nodal))
            for nodal in (on_held, on_free + on_held)
        )
        borne = axes @ body.borne(moved, point).T - direct
        exerted[:, 0] = sign * stated
        size = np.array([1.0, body.size]) * max(abs(force), float(np.hypot(*shear)))
        left = np.abs(exerted + borne) / np.where(size > 0.0, size, 1.0)
        axis, kind = np.unravel_index(np.argmax(left), left.shape)
        if not left[axis, kind] <= allowed:
            owner = "body" if sign > 0.0 else "counter-body"
            name, unit = (("force", "N"), ("moment", "N mm"))[kind]
            around = "" if kind == 0 else "about the middle of the contact face, "
            raise NotBalanced(
                what,
                reason=f"NOT_BALANCED: the supports of the {owner} bear a {name} of "
                f"{borne[axis, kind]:.7g} {unit} {around}{_AXES[axis]}, against "
                f"{-exerted[axis, kind]:.7g} {unit} by the contact, where {allowed:.1g} of "
                f"{size[kind]:.4g} {unit} may be left over",
                iterations=iterations,
                remedy="leave out PETSc's options that loosen tolerances; if there are none, these "
                "results are wrong: please report the scene",
            )
        reactions.append(float(borne[2, 0]))
    return reactions[0]


def _resultant(arms: Array, nodal: Array) -> Array:
    """Return the sums of this rank's nodal forces and of their moments, shape (3, 2)."""
    forces = nodal.reshape(-1, 3)
    return np.stack([forces.sum(axis=0), np.cross(arms, forces).sum(axis=0)], axis=1)
