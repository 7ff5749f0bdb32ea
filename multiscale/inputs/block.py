"""The block of a scene: its section, material, shape and cells."""

from __future__ import annotations

from geometry import BlockShape, Material, Surface
from multiscale.inputs.surfaces import located
from multiscale.scene.scene import Scene
from multiscale.scene.sections import BlockSection

Cells = tuple[int, int, int]

LAW_BLOCK_CELLS: Cells = (40, 40, 25)
"""Cells of a block that carries laws on its mesh, those of Waddad et al. 2016, or contacts."""
FIELD_CELLS: Cells = (20, 20, 12)
"""Cells of a block that is meshed after the load for its fields under the mean pressures of
patches."""


def make_shape(scene: Scene, surface: Surface, unstated: Cells) -> BlockShape:
    """Return the shape and cells of a scene's block under its surface.

    Args:
        scene: The scene.
        surface: Its surface.
        unstated: Cells of the block where the scene states none.

    Raises:
        InputError: When they do not fit together or the coupling; names file and key.
    """
    block = block_section(scene)
    lengths = block.lengths or surface.lengths
    with located(scene, "block"):
        return BlockShape(
            interface=lengths,
            height=block.height_under(lengths),
            cells=block_cells(scene, unstated),
            element=block.element,
            grading=block.grading,
            margin=block.margin,
            margin_cells=block.margin_cells if block.margin else 0,
            margin_grading=block.margin_grading if block.margin else 1.0,
        )


def block_material(scene: Scene) -> Material:
    """Return the elastic constants of a scene's block."""
    block = block_section(scene)
    return Material(young_modulus=block.young_modulus, poisson_ratio=block.poisson_ratio)


def block_section(scene: Scene) -> BlockSection:
    """Return the section on the block of a scene that has one.

    Raises:
        ValueError: When its body is a mesh.
    """
    if scene.block is None:
        raise ValueError("a scene with a body of its own has no block")
    return scene.block


def block_cells(scene: Scene, unstated: Cells) -> Cells:
    """Return the cells of the flat block's mesh.

    Args:
        scene: The scene.
        unstated: Cells where the scene states none: laws need a fine mesh under every patch, and
            contacts are to be seen in fields; the mean pressures of patches need less.
    """
    cells = block_section(scene).cells
    return unstated if cells is None or cells == "auto" else cells
