"""What the force of a run is expected to be off by, cause by cause, before anything is solved.

Bounds rather than means: each is what nearly all measured cases keep. Two measures of the contacts
carry them: κ, the mean displacement of the half-space below the loads over the approach, tells how
much the block has to say; β is the share of the overlap within an eighth of the interface's side
from its border. Measured against a block of 24 × 24 × 16 cells under 32 × 32 loads on four surfaces
each of Set 1 of Waddad et al. 2016 and of 1 to 6 waves, κ from 0.03 to 0.4 and β up to 0.4, blocks
of 0.3, 1 and 3 mm.
"""

from __future__ import annotations

import numpy as np

from geometry.statistics import roughness
from geometry.surface import Surface
from micro import Choice, HalfSpaceModel, MicroModel, ScaledModel
from micro.auto.errors import contact_error, grid_error
from micro.auto.measures import contact_measures
from micro.regions.islands import IslandModel
from multiscale.planning.contact_estimate import Contacts
from multiscale.reference.meshes import ReferenceMeshes
from multiscale.scene import Scene
from multiscale.stage import Stage

_SLOPES = 0.56
"""Force that finite slopes take, over the mean square gradient: 2.6 % at an rms gradient of 0.215
(the rough block meshed in itself, at full height and at a tenth)."""


def expected_errors(stage: Stage) -> dict[str, float]:
    """Return bounds of the relative error of the force by cause; their sum is what is promised.

    Finite slopes are left out: every model but the explicit rough mesh is their limit.

    Args:
        stage: The scene's ingredients.
    """
    if stage.meshes is not None:
        return {"mesh": mesh_error(stage.meshes)}
    errors = {"micro model": micro_error(stage.surface, stage.model, stage.nearest, stage.choice)}
    if stage.by_laws:
        errors["laws between their rows"] = stage.table_tolerance
    if stage.embedded:
        at = stage.contacts
        grid, size = stage.patches.grid, max(stage.surface.lengths)
        errors["coupling"] = coupling_error(stage.scene, grid, size, at)
        errors["block"] = block_error(stage.scene, stage.shape.cells, grid, at)
    return {cause: float(error) for cause, error in errors.items()}


def mesh_error(meshes: ReferenceMeshes) -> float:
    """Return the bound of what the finest mesh of a reference leaves.

    Measured on a sphere and on Set 1: linear elements miss 7, 2.7, 0.7 % with 4, 8, 16 edges along
    a contact's radius, quadratic ones 2, 0.8, 0.3 % with 1.5, 2.1, 3. Coarser
    linear ones err less than that law would have it: on one surface of 2 to 6 waves, with 1 and 3
    edges, 6 and 7 % more force than quadratic ones of 1.5, themselves some 2 % high.

    Args:
        meshes: The meshes.
    """
    edges = 0.5 * meshes.across
    if meshes.degree == 1:
        return float(min(1.0, 0.4 / edges, 1.5 / edges**2))
    return float(min(1.0, 0.1 / edges, 0.1 / edges**3))


def micro_error(
    surface: Surface, model: MicroModel, nearest: float, choice: Choice | None
) -> float:
    """Return the bound of a micro model's own error.

    Args:
        surface: The surface.
        model: Its model.
        nearest: How near the plane comes anywhere [mm].
        choice: Why it was chosen, if it was.
    """
    if choice is not None:
        return max(choice.taken.expected_error, choice.taken.checked_error or 0.0)
    loads = [contact_measures(surface, part * nearest, periodic=False) for part in (0.5, 1.0)]
    if isinstance(model, HalfSpaceModel):
        factor = min(np.divide(model.surface.grid, surface.grid))
        return max(grid_error(at, factor) for at in loads)
    kind = model.name
    if isinstance(model, IslandModel):
        kind = "islands"
    elif isinstance(model, ScaledModel):
        kind = "scaled"
    return max(contact_error(kind, at) for at in loads)


def coupling_error(scene: Scene, grid: tuple[int, int], size: float, at: Contacts) -> float:
    """Return the bound of what the coupling leaves out.

    Laws on the block stand for where the contacts were when they were made; laws alone cut
    contacts at the borders of patches; few patches on a plain mesh load it where no contact is.

    Args:
        scene: The scene.
        grid: Patches in x and y.
        size: Longer side of the interface [mm].
        at: Its contacts.
    """
    coupling, few = scene.coupling, min(grid)
    if coupling.kind == "isolated":
        return 0.15 if few == 1 else 0.5
    if coupling.kind != "consistent":
        return 0.0
    free = 0.0
    if scene.loading.tilt == "free":
        free = 0.15 if few < 4 else 0.1 if few < 8 else 0.05 if few < 16 else 0.03
    if not coupling.decomposed:
        return free + at.yielding * 1.2 / few
    share = 0.14 if few < 4 else 0.12 if few < 8 else 0.09
    if not 0.4 <= scene.block.height / size <= 2.5:  # bending is no small thing there
        share *= 6.0 if few == 1 else 2.0 if few < 8 else 1.0
    return free + share * at.yielding


def block_error(
    scene: Scene, cells: tuple[int, int, int], grid: tuple[int, int], at: Contacts
) -> float:
    """Return the bound of what the block's mesh leaves, or its body term of few modes.

    Args:
        scene: The scene.
        cells: Cells of a mesh under laws, under the interface in x and y, and in depth.
        grid: Patches in x and y.
        at: Its contacts.
    """
    if scene.coupling.decomposed:
        return float(0.005 * at.yielding + 0.015 * np.sqrt(at.border))
    degree = int(scene.block.element[1])
    across = degree * min(c / n for c, n in zip(cells[:2], grid, strict=True))
    return at.yielding * min(2.4, 4.0 / across**2 + 0.5 / across)


def slope_effect(surface: Surface) -> float:
    """Return the part of the force that finite slopes take, an estimate.

    Args:
        surface: The surface.
    """
    return _SLOPES * roughness(surface).sdq ** 2
