"""Resolves what a scene leaves open, counts what its run computes, and says what it will do.

`auto_keys` says which keys are open, `problem_setup` sets up the problem with values for them,
`accuracy` finds values whose errors, measured at the largest load, keep an accuracy, and
`mesh_accuracy` does so with the meshes of a reference. `work` counts cells, unknowns, rows and
products, `memory_costs` bytes; `plan`, `block_plan` and `body_plan` put all of it into sentences
before anything expensive starts. None of them reads a clock.
"""
