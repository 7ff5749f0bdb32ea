"""The micro model of a scene: the one it states, or one chosen for its largest load."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from geometry import Material
from geometry.patches import PatchGrid, patch_means
from geometry.surface import Surface
from micro import (
    Choice,
    MicroModel,
    choose,
    micro_model,
)
from multiscale.costs.contact_work import kind_work, reach
from multiscale.couplings.load_steps import ContactCoupling
from multiscale.loading.stepper import LoadHistory, load_steps
from multiscale.machine.rates import this_machine
from multiscale.scene.scene import Scene
from multiscale.setup.contact_estimate import largest_local_approach, rough_half_space

_FEW_SUMMITS = 30  # that interact, for the cost of models that may be taken

SOLUTIONS_OF_LAWS = 40
"""Approaches that a table of laws takes, roughly."""


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


def chosen_model(
    scene: Scene, surface: Surface, patches: PatchGrid, tolerance: float, label: str | None = None
) -> Choice:
    """Choose the micro model at the load that brings the plane nearest anywhere.

    Where the force or the moment is prescribed, a half-space of few cells tells how near that is.

    Args:
        scene: The scene.
        surface: Its surface.
        patches: Its patches.
        tolerance: Relative error of the force.
        label: The candidate to take, if it is known.
    """
    kind, plane = scene.coupling.kind, estimated_plane(scene, surface)
    at = reach(surface, plane, summits=_FEW_SUMMITS)
    by_laws = kind in ("isolated", "consistent")
    solutions = SOLUTIONS_OF_LAWS if by_laws else scene.loading.load_history.count

    def cost(model: str, cells: int) -> float:
        work = kind_work(model, cells, at)
        return solutions * work.seconds(this_machine())

    return choose(
        surface,
        contact_modulus=_modulus(scene),
        approach=largest_local_approach(plane, surface),
        tolerance=tolerance,
        patches=patches if scene.coupling.kind != "analytic" else None,
        solutions=solutions,
        cost=cost,
        label=label,
    )


def estimated_plane(scene: Scene, surface: Surface) -> tuple[float, tuple[float, float]]:
    """Return the plane at the largest load, where loads are prescribed from a coarse half-space."""
    rough = rough_half_space(surface, _modulus(scene))
    whole = PatchGrid(grid=(1, 1), lengths=surface.lengths)
    return find_plane_at_largest_load(
        scene.loading.load_history, rough, whole, patch_means(surface, whole)
    )


def find_plane_at_largest_load(
    load_history: LoadHistory,
    model: MicroModel,
    patches: PatchGrid,
    mean_heights: NDArray[np.float64],
) -> tuple[float, tuple[float, float]]:
    """Return the largest approach and the slopes there, from the half-space where not given.

    Raises:
        NotConverged: When the plane is not found in smaller steps either.
    """
    if load_history.quantity == "approach" and load_history.tilt is not None:
        return load_history.largest, load_history.tilt
    alone = ContactCoupling(model, patches, mean_heights)
    there = replace(load_history, points=(load_history.largest,), steps=1, force_change=None)
    (step,) = load_steps(alone, there)
    return step.approach_mm, step.tilt


def _modulus(scene: Scene) -> float:
    return Material(
        young_modulus=scene.block.young_modulus, poisson_ratio=scene.block.poisson_ratio
    ).contact_modulus
