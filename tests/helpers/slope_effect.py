"""Change of a half-space model's force by finite slopes."""

from dataclasses import replace

from patchlaw.geometry import Control, Material
from patchlaw.micro import FiniteSlopes, coarse_grid, side_stresses


def slope_effect(model, approach, poisson_ratio, tilt=(0.0, 0.0)):
    """Return the relative change of the force; free sides of the model are taken into account."""
    surface, edges = model.surface, []
    if model.sides is not None:
        cells = coarse_grid(surface)
        spacing = surface.lengths[0] / cells[0], surface.lengths[1] / cells[1]
        edges = [side_stresses(model.sides, spacing)]
    material = Material(
        young_modulus=model.contact_modulus * (1.0 - poisson_ratio**2), poisson_ratio=poisson_ratio
    )
    slopes = FiniteSlopes(surface, material, periodic=model.periodic, edge_stresses=edges)
    found = replace(model, slopes=(slopes,)).press(Control(approach=approach, tilt=tilt))
    return found.force / model.press(Control(approach=approach, tilt=tilt)).force - 1.0
