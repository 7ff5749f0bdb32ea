"""From a scene to its results: a run, the accuracy it keeps, its files, many runs.

scene_run             a scene's load steps, one after the other, and their history
resolving, refining   grids, elements and rows that keep a stated accuracy, chosen before the run
output                results folders, reports, and what a run goes on from
cases                 many scenes on any number of ranks, gone on with after a kill
sweep                 a scene for many values of its keys: rows, means and bands
configurations        all sensible ways to compute a scene, and
comparison            their errors over time
difference            two runs beside each other
"""

AGAINST = {"reference": "reference", "concurrent": "concurrent", "half-space": "analytic"}
"""What the others can be compared against, the best first, and the coupling of each."""

AT = ("pressure", "approach", "slid")
"""What two runs can have in common where they are compared."""
