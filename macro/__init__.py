"""The elastic block in dolfinx, pressed by a rigid plane through one contact law per patch.

BlockShape → block_mesh → Block (with a Material) → Interface (with a PatchGrid)
→ PressedBlock (with one ContactLaw per patch) → PressState for every load step.

`make_correction` gives what a finite block adds to the half-space; rough_block_mesh → Block
→ ObstacleBlock meshes the roughness itself, as a reference.
"""

from macro.block import Block
from macro.compliance import plain_compliance
from macro.condense import HalfSpaceField, make_correction
from macro.correction import Correction, Sag
from macro.elasticity import Material
from macro.interface import ContactLaw, Interface
from macro.kept import cached_correction, correction_is_kept
from macro.mesh import BOTTOM, SIDES, TOP, BlockMesh, block_mesh
from macro.obstacle import ObstacleBlock, ObstacleState
from macro.output import write_fields, write_rough_fields
from macro.pressed import PressedBlock, PressState
from macro.rough_mesh import MeshQuality, rough_block_mesh

__all__ = [
    "BOTTOM",
    "SIDES",
    "TOP",
    "Block",
    "BlockMesh",
    "ContactLaw",
    "Correction",
    "HalfSpaceField",
    "Interface",
    "Material",
    "MeshQuality",
    "ObstacleBlock",
    "ObstacleState",
    "PressState",
    "PressedBlock",
    "Sag",
    "block_mesh",
    "cached_correction",
    "correction_is_kept",
    "make_correction",
    "plain_compliance",
    "rough_block_mesh",
    "write_fields",
    "write_rough_fields",
]
