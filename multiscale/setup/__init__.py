"""The problem a scene describes: surface, patches, micro model, shapes of meshes, checks.

`surface_and_block` makes these two and refuses what could never fit, `reference_meshes` plans the
meshes of a reference, and `problem` is the record of all of it, with the decision for the values
that the scene left open.
"""
