"""Elastic bodies in dolfinx, in contact with a rigid plane or with each other.

BlockShape → block_mesh → Block (with a Material) → LoadedFace (with a PatchGrid)
→ LawContactProblem (with one ContactLaw per patch) → FaceEquilibrium for every load step.
A file → read_mesh → TaggedMesh makes a MeshedBody of any shape, which takes the place of the Block;
TaggedMesh → write_mesh → a file that ranks read in parts.

`face_compliance` is the displacement of the contact face in smooth modes; rough_block_mesh → Block
→ UnilateralContactProblem meshes the roughness itself, as a reference.

A module is imported with the first use of one of its names: the compliance of a block's face that
is in the cache takes no finite elements.
"""

from patchlaw.support.packages import load_wheels_mpi, public_names

load_wheels_mpi()

__getattr__, __dir__, __all__ = public_names(__name__, __file__)
