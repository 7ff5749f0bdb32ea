"""The elastic block in dolfinx, in contact with a rigid plane.

BlockShape → block_mesh → Block (with a Material) → Interface (with a PatchGrid)
→ LawContactProblem (with one ContactLaw per patch) → LawContactState for every load step.

`face_compliance` is the displacement of the contact face in smooth modes; rough_block_mesh → Block
→ UnilateralContactProblem meshes the roughness itself, as a reference.
"""

from geometry.materials import Material
from macro.block import Block
from macro.compliance.face_compliance import FaceCompliance, face_compliance
from macro.contact.law_interface import (
    ContactLaw,
    Interface,
    displacements_under,
    patch_compliance_matrix,
)
from macro.contact.law_problem import LawContactProblem, LawContactState
from macro.contact.unilateral_problem import (
    UnilateralContactProblem,
    UnilateralContactState,
    nodal_contact,
)
from macro.fields import write_fields, write_rough_fields
from macro.mesh.block import BOTTOM, SIDES, TOP, BlockMesh, block_mesh
from macro.mesh.rough_surface import MeshQuality, rough_block_mesh

__all__ = [
    "BOTTOM",
    "SIDES",
    "TOP",
    "Block",
    "BlockMesh",
    "ContactLaw",
    "FaceCompliance",
    "Interface",
    "LawContactProblem",
    "LawContactState",
    "Material",
    "MeshQuality",
    "UnilateralContactProblem",
    "UnilateralContactState",
    "block_mesh",
    "displacements_under",
    "face_compliance",
    "nodal_contact",
    "patch_compliance_matrix",
    "rough_block_mesh",
    "write_fields",
    "write_rough_fields",
]
