"""What a load step is found from: a model of a contact, pressed by a rigid plane.

cell_contact      the contact problem of the surface itself, cell by cell or summit by summit
patch_contact     laws of patches on the compliance of a body, or along the path of their rows
face_contact      laws on the contact face of finite elements
meshed_contact    the rough surface, meshed

None of them knows a scene.

problem           presses a model along a path of load steps
couplings         make a model from a scene; `setup`, on the ranks of a communicator
measured_errors   what load steps err by, by cause
"""
