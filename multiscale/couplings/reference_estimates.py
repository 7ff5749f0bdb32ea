"""What the meshes of a reference are arranged by: estimates with a half-space under its surface.

The body sinks under its load, so that the plane comes less near to the rough face than to the
undeformed surface. The contact under that plane tells where meshes have to be fine.

Theory: docs/theory.md, section 12.
"""

from __future__ import annotations

import numpy as np
import scipy

from patchlaw.geometry import Control, PatchGrid, RigidPlane, Surface
from patchlaw.geometry.meshes.refined_block import ContactMap
from patchlaw.micro import HalfSpaceModel, influence_matrix
from patchlaw.multiscale.couplings.contact_solver import on_few_cells
from patchlaw.multiscale.inputs.bodies import SceneBody, block_section
from patchlaw.multiscale.scene.scene import Scene
from patchlaw.support.arrays import Array

_COUNTED = 0.9
"""Part of what the face of a body moves that its meshes count on."""

_MOST_CELLS = 512
"""Heights along a side on which contact is estimated."""


def contact_under(plane: RigidPlane, surface: Surface, contact_modulus: float) -> ContactMap:
    """Return where a half-space would be in contact under a plane.

    A body moves that little: contacts under the same load differ by finite slopes alone.

    Args:
        plane: The plane, in coordinates of the rough face.
        surface: The surface.
        contact_modulus: E* [MPa].
    """
    count_x, count_y = surface.grid
    model = HalfSpaceModel(surface, contact_modulus=contact_modulus)
    model = model.resampled((min(count_x, _MOST_CELLS), min(count_y, _MOST_CELLS)))
    state = model.press(Control(approach=plane.approach, tilt=plane.tilt))
    if state.pressures is None or not state.contacts:
        return ContactMap.of_interference(surface, plane.approach, tilt=plane.tilt)
    found = ContactMap.of_pressures(model.surface, np.reshape(state.pressures, model.surface.grid))
    return found.with_islands(surface, plane.approach, plane.tilt)


def plane_over_face(
    plane: RigidPlane, model: HalfSpaceModel, compliance: Array, *, turns: bool
) -> RigidPlane:
    """Return a plane at a prescribed approach in coordinates of the face that has moved.

    The body takes a part of the approach; a tenth of that is kept in reserve.

    Args:
        plane: The plane at the largest load.
        model: The surface on a half-space.
        compliance: Displacement of the face and its slopes by a mean pressure of 1 MPa, beyond
            those of a half-space, shape (3,); see `face_compliance`.
        turns: Whether the plane turns freely, and so with the face.
    """
    solver, surface = on_few_cells(model), model.surface
    counted = np.array([1.0, 0.0, 0.0] if turns else [1.0, 1.0, 1.0])

    def over_face(pressure: float) -> RigidPlane:
        moved = _COUNTED * pressure * compliance * counted
        tilt = plane.tilt[0] - moved[1], plane.tilt[1] - moved[2]
        return RigidPlane.above(surface, plane.approach - float(moved[0]), tilt)

    def excess(pressure: float) -> float:
        """Return what a half-space bears under the plane over the face, less the pressure."""
        at = over_face(pressure)
        step = solver.press(Control(approach=at.approach, tilt=at.tilt))
        return step.force_N / surface.area - pressure

    most = excess(0.0)
    if most <= 0.0:
        return plane
    return over_face(
        scipy.optimize.brentq(excess, 0.0, most, rtol=0.01) if excess(most) < 0.0 else most
    )


def block_compliance(scene: Scene, lengths: tuple[float, float], height: float) -> Array:
    """Return the same as `face_compliance` of a block, which is compressed as a column.

    Args:
        scene: The scene, with its block.
        lengths: Sides of the surface [mm].
        height: Height of the block [mm].
    """
    block = block_section(scene)
    nu, modulus = block.material.poisson_ratio, block.material.young_modulus
    confined = (1.0 + nu) * (1.0 - 2.0 * nu) / (1.0 - nu) if block.sides == "roller" else 1.0
    column = confined * height / modulus
    parts = PatchGrid(grid=(1, 1), lengths=lengths)
    half_space = float(influence_matrix(parts)[0, 0]) * block.material.surface_compliance / np.pi
    return np.array([column - half_space, 0.0, 0.0])


def face_compliance(body: SceneBody, lengths: tuple[float, float]) -> Array:
    """Return what a body adds to a half-space under a uniform pressure on its rough rectangle.

    Args:
        body: The body, placed.
        lengths: Sides of the rectangle [mm].

    Returns:
        Displacement of the middle into the body [mm/MPa], and its slopes along x and y
        [1/MPa], shape (3,): the plane through the mean displacements of 4 × 4 parts.

    Note:
        Collective.
    """
    from patchlaw.macro import LoadedFace, displacements_under

    parts = PatchGrid(grid=(4, 4), lengths=lengths)
    face = LoadedFace(body.body, body.facets[0], parts)
    uniform = np.ones((1, parts.count))
    moved = displacements_under(face, uniform)[0]
    material = body.facts.materials[0]
    moved = moved - influence_matrix(parts) @ uniform[0] * material.surface_compliance / np.pi
    arms = parts.centres - 0.5 * np.asarray(lengths)
    plane = np.linalg.lstsq(np.column_stack([np.ones(parts.count), arms]), moved, rcond=None)[0]
    return np.asarray(plane)
