"""What a load step is found from: a model of a contact, pressed by a rigid plane.

cell_contact      the contact problem of the surface itself, cell by cell or summit by summit
patch_contact     laws of patches on the compliance of a body, or along the path of their rows
face_contact      laws on the contact face of finite elements

problem           presses a model along a path of load steps

None of them knows a scene. `setup` makes a `coupling` of a scene, which makes its model and
measures the errors of its load steps: a `cell_coupling`, a `patch_coupling` with laws of patches, a
`representative_coupling` with laws of samples, or a `reference_coupling`, beside the meshes of
which its model stands. What is said of a
coupling is in `coupling`, `describe` and `validity`.

measured_errors   what load steps err by, by cause
"""
