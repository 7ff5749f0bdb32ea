"""Whether supports bear what contact exerts on a body: the check of every load step of a mesh.

Contact is known by its stresses, what supports bear by the stiffness of the whole body, rows of
held displacements included. Both are forces and moments on one body, and differ by what equations
of free displacements leave over: nothing but the residual that a solver was allowed.

Theory: section 11 of ``docs/theory.md``.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from petsc4py import PETSc

from macro.contact.loaded_face import ContactFace
from support.arrays import Array
from support.errors import NotBalanced

BALANCE = 1e-6
import os
_DEBUG = os.environ.get("BAL")
_NAMES = ("force along the first axis", "force along the second axis", "force along the normal")
_MOMENTS = ("moment about the first axis", "moment about the second axis", "moment about the normal")


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

    Args:
        face: The contact face of a body, or of two.
        displacement: Displacements by the contact, without those by other loads [mm].
        load: Nodal forces of the contact on displacements that no support holds [N].
        on_supports: Those on displacements that supports hold; None: there are none.
        force: Normal force of the contact, as it is stated [N].
        shear: Shear force on the body along the axes of the face [N].
        tolerance: Largest difference of forces relative to the force, and of moments relative to
            the force on a lever as long as the body.
        what: What was solved for, for an error.
        iterations: Iterations that it took.

    Raises:
        NotBalanced: When what a support bears differs from what the contact exerts, for both
            bodies; says by how much.

    Note:
        Collective.
    """
    frame = face.sides[0].facets.frame
    middle = frame.in_space([face.patches.middle])[0]
    stated = np.array([*shear, -force])
    if _DEBUG: tolerance = np.inf
    vectors = [displacement, load, load.duplicate() if on_supports is None else on_supports]
    parts = zip(*(_by_body(face, vector.array_r) for vector in vectors), strict=True)
    first = 0.0
    for number, (side, (moved, free, held)) in enumerate(zip(face.sides, parts, strict=True)):
        body = side.body
        arms = body.space.tabulate_dof_coordinates()[: body.owned_dofs // 3] - middle
        direct, contact = (
            body.comm.allreduce(_resultant(arms, nodal)) for nodal in (held, free + held)
        )
        borne = body.borne(moved, middle) - direct
        contact[:3] = frame.axes.T @ (stated if number == 0 else -stated)
        left = np.concatenate([frame.axes @ (borne + contact)[k : k + 3] for k in (0, 3)])
        size = np.repeat([1.0, body.size], 3) * max(abs(force), float(np.hypot(*shear)))
        if _DEBUG and size[0]:
            open(_DEBUG, "a").write(f"{np.abs(left / size)} {what} {body.dofs}\n")
        worst = int(np.argmax(np.abs(left) - tolerance * size))
        if not abs(left[worst]) <= tolerance * size[worst]:
            raise _error(frame, contact, borne, worst, tolerance, what, iterations, number)
        if number == 0:
            first = float(frame.normal @ borne[:3])
    return first


def _by_body(face: ContactFace, values: Array) -> tuple[Array, ...]:
    """Return the parts of all bodies in values of this rank's displacements."""
    return face.body.split(values) if len(face.sides) > 1 else (values,)


def _resultant(arms: Array, nodal: Array) -> Array:
    """Return the sum of this rank's nodal forces, and of their moments, shape (6,)."""
    forces = nodal.reshape(-1, 3)
    return np.concatenate([forces.sum(axis=0), np.cross(arms, forces).sum(axis=0)])


def _error(
    frame: Any,
    contact: Array,
    borne: Array,
    worst: int,
    tolerance: float,
    what: str,
    iterations: int,
    number: int,
) -> NotBalanced:
    axis, unit = worst % 3, "N" if worst < 3 else "N mm"
    part = slice(0, 3) if worst < 3 else slice(3, 6)
    exerted, reaction = (float(frame.axes[axis] @ values[part]) for values in (contact, borne))
    name = (_NAMES + _MOMENTS)[worst]
    body = "counter-body" if number else "body"
    return NotBalanced(
        what,
        reason=f"the {name} that contact exerts on the {body} is {-exerted:.7g} {unit}, and "
        f"its supports bear {reaction:.7g} {unit}, where rounding and the solvers' tolerances "
        f"explain {tolerance:.1g} of the force",
        iterations=iterations,
        remedy="leave out options of PETSc that loosen tolerances; without any, please report the "
        "scene, as its results are wrong",
    )
