"""From a scene to its results: a run, the accuracy it keeps, its files, many runs.

scene_run             a scene's load steps, one after the other, and their history
accuracy, refining    grids, elements and rows that keep a stated accuracy, chosen before the run
output                results folders, reports, and what a run goes on from
studies               sweeps over scenes, and methods and results compared
"""
