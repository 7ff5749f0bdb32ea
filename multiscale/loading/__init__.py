"""What a model is pressed along, and the record of every load step.

load_history, stages      loads as they are stated: turning points, cycles, stages, shear
path                      the same written out, a step for every load step
load_step, column, leak   the record of a load step, whose columns are those of ``history.csv``
energy                    work of the plane and its balance with the energies
"""
