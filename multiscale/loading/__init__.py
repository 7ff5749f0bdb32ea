"""What a model is pressed along, and the record of every load step.

load_history       loads as they are stated: turning points, cycles, stages, shear
path               the same written out, a step for every load step; stages
load_step, column  the record of a load step, whose columns are those of ``history.csv``
"""
