"""Resolves what a scene leaves open, predicts what its run takes, and says what it will do.

`auto_keys` says which keys are open, `problem_setup` sets up the problem with values for them,
`accuracy` finds values whose errors, measured at the largest load, keep an accuracy, and
`mesh_accuracy` does so with the meshes of a reference. `costs` predicts time and memory from
`contact_costs`, `mesh_costs` and `memory_costs`, with speeds that `machine_speed` measures and
others' use of the cores, `busy_cores`; `plan` and `block_plan` put all of it into sentences before
anything expensive starts.
"""
