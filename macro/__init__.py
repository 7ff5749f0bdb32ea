"""The elastic block in dolfinx, pressed by a rigid plane through one contact law per patch.

BlockShape → block_mesh → Block (with a Material) → Interface (with a PatchGrid)
→ PressedBlock (with one ContactLaw per patch) → PressState for every load step.

`face_compliance` gives the compliance of the block's top in few smooth modes, `make_correction`
what a finite block adds to the half-space; rough_block_mesh → Block
→ ObstacleBlock meshes the roughness itself, as a reference.
"""

from macro.block import Block
from macro.body.face_compliance import FaceCompliance, cached_face_compliance, face_compliance
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
    "FaceCompliance",
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
    "cached_face_compliance",
    "correction_is_kept",
    "face_compliance",
    "make_correction",
    "plain_compliance",
    "rough_block_mesh",
    "write_fields",
    "write_rough_fields",
]
