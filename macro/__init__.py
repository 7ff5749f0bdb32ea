"""Elastic bodies in dolfinx, in contact with a rigid plane or with each other.

BlockShape → block_mesh → Block (with a Material) → LoadedFace (with a PatchGrid)
→ LawContactProblem (with one ContactLaw per patch) → FaceContactState for every load step.
A file → read_mesh → TaggedMesh makes a MeshedBody of any shape, which takes the place of the Block;
TaggedMesh → write_mesh → a file that ranks read in parts.

`face_compliance` is the displacement of the contact face in smooth modes; rough_block_mesh → Block
→ UnilateralContactProblem meshes the roughness itself, as a reference.
"""

from geometry.materials import Material
from macro.bodies import Block, MeshedBody
from macro.compat import vector_space
from macro.compliance.face_compliance import FaceCompliance, face_compliance
from macro.contact.contact_forces import ContactLaw
from macro.contact.contact_problem import ContactProblem
from macro.contact.face_contact_state import FaceContactState
from macro.contact.face_pair import FacePair
from macro.contact.interface import Interface
from macro.contact.law_operator import LawOperator, LawsAtPoints
from macro.contact.law_problem import LawContactProblem
from macro.contact.loaded_face import (
    LoadedFace,
    displacements_under,
    largest_rise,
    patch_compliance_matrix,
)
from macro.contact.rough_face import RoughFace
from macro.contact.unilateral_problem import (
    UnilateralContactProblem,
    nodal_contact,
)
from macro.elastic_body import ElasticBody
from macro.fields import FieldStep, write_fields, write_rough_fields
from macro.mesh.block import BOTTOM, SIDES, TOP, MeshQuality, block_mesh, rough_block_mesh
from macro.mesh.contact_face import ContactFacets, contact_facets
from macro.mesh.from_file import read_mesh
from macro.mesh.supports import Loads, Support, Traction, check_loads, check_supports
from macro.mesh.tagged import TaggedMesh, planar_face
from macro.mesh.xdmf import write_mesh

__all__ = [
    "BOTTOM",
    "SIDES",
    "TOP",
    "Block",
    "ContactFacets",
    "ContactLaw",
    "ContactProblem",
    "ElasticBody",
    "FaceCompliance",
    "FaceContactState",
    "FacePair",
    "FieldStep",
    "Interface",
    "LawContactProblem",
    "LawOperator",
    "LawsAtPoints",
    "LoadedFace",
    "Loads",
    "Material",
    "MeshQuality",
    "MeshedBody",
    "RoughFace",
    "Support",
    "TaggedMesh",
    "Traction",
    "UnilateralContactProblem",
    "block_mesh",
    "check_loads",
    "check_supports",
    "contact_facets",
    "displacements_under",
    "face_compliance",
    "largest_rise",
    "nodal_contact",
    "patch_compliance_matrix",
    "planar_face",
    "read_mesh",
    "rough_block_mesh",
    "vector_space",
    "write_fields",
    "write_mesh",
    "write_rough_fields",
]
