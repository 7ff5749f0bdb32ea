"""Forces on a meshed block with a rough face, whose slopes are finite or nearly none."""

from helpers.block_cases import rough_contact
from patchlaw.geometry import Control, RefinedShape, places_in_reach

LOW = 0.01
"""Share of the heights at which slopes change the force no more."""


def forces_with_slopes_and_without(surface, material, *, height, approach, fine, sides="free"):
    """Return the force, and that by heights and approach × `LOW` over this share.

    The meshes of both are alike but for their heights.

    Args:
        surface: The rough face, of 1 mm × 1 mm.
        material: The material of the block.
        height: Height of the block [mm].
        approach: Approach of the plane [mm].
        fine: Length of the elements' edges where contact is [mm].
        sides: What holds the sides of the block, ``free`` or ``roller``.
    """
    shape = RefinedShape(
        interface=(1.0, 1.0),
        height=height,
        places=places_in_reach(surface, approach, spacing=fine),
        fine=fine,
        coarse=0.12,
        growth=0.3,
        element="P2",
    )
    forces = []
    for scale in (1.0, LOW):
        scaled = surface.scaled(scale)
        block = rough_contact(shape, scaled, material, sides)
        forces.append(block.solve(Control(approach=approach * scale)).force / scale)
    return forces
