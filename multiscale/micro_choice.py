"""The micro model of a scene: the one it states, or one chosen for its largest load."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from geometry.patches import PatchGrid, patch_means
from geometry.surface import Surface
from micro import (
    Choice,
    HalfSpaceModel,
    MicroModel,
    choose,
    contact_modulus,
    micro_model,
    resampled,
)
from multiscale.coupling import AnalyticCoupling
from multiscale.loading import Programme
from multiscale.scene import Scene

DEFAULT_TOLERANCE = 0.02
"""Relative error of the force that a micro model is chosen for, unless the scene says."""

SOLUTIONS_OF_LAWS = 40
"""Approaches that a table of laws takes, roughly."""

_ESTIMATE_CELLS = 96


def stated_model(scene: Scene, surface: Surface) -> MicroModel:
    """Return the micro model that a scene names."""
    return micro_model(
        scene.micro.model,
        surface,
        contact_modulus=_modulus(scene),
        solver=scene.micro.solver,
        curvature=scene.micro.curvature,
        border=scene.micro.border,
    )


def chosen_model(scene: Scene, surface: Surface, patches: PatchGrid) -> Choice:
    """Choose the micro model at the load that brings the plane nearest anywhere."""
    programme = scene.loading.programme
    approach, tilt = expected_plane(scene, surface)
    rise = 0.5 * float(np.abs(np.multiply(surface.lengths, tilt)).sum())
    laws = scene.coupling.kind in ("isolated", "consistent")
    return choose(
        surface,
        contact_modulus=_modulus(scene),
        approach=approach + rise,
        tolerance=scene.micro.tolerance or DEFAULT_TOLERANCE,
        patches=patches if scene.coupling.kind != "analytic" else None,
        solutions=SOLUTIONS_OF_LAWS if laws else len(programme.targets),
    )


def expected_plane(scene: Scene, surface: Surface) -> tuple[float, tuple[float, float]]:
    """Return the largest approach and the slopes there, before there is a micro model.

    Where the force or the moment is prescribed, a half-space of few cells tells them.
    """
    programme = scene.loading.programme
    if programme.quantity == "approach" and programme.tilt is not None:
        return programme.largest, programme.tilt
    cells = min(surface.grid[0], _ESTIMATE_CELLS), min(surface.grid[1], _ESTIMATE_CELLS)
    rough = HalfSpaceModel(
        surface=resampled(surface, cells),
        contact_modulus=_modulus(scene),
        highest=surface.highest,
    )
    whole = PatchGrid(grid=(1, 1), lengths=surface.lengths)
    return furthest_plane(programme, rough, whole, patch_means(surface, whole))


def furthest_plane(
    programme: Programme, model: MicroModel, patches: PatchGrid, mean_heights: NDArray[np.float64]
) -> tuple[float, tuple[float, float]]:
    """Return the largest approach and the slopes there, from the half-space where not given."""
    if programme.quantity == "approach" and programme.tilt is not None:
        return programme.largest, programme.tilt
    alone = AnalyticCoupling(model, patches, mean_heights)
    step = alone.press(programme.control(programme.largest))
    return step.approach_mm, step.tilt


def _modulus(scene: Scene) -> float:
    return contact_modulus(scene.block.young_modulus, scene.block.poisson_ratio)
