"""Resolves what a scene leaves open to values, and sets up its problem.

`auto_keys` says which keys are open, `problem_setup` sets up the problem with values for them,
`accuracy` finds values whose errors, measured at the largest load, keep an accuracy, and
`mesh_accuracy` does so with the meshes of a reference.
"""
