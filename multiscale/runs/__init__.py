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

VIEWS = {
    "pressure": ("contact pressure", "MPa", "PRESSURES"),
    "gap": ("gap", "mm", "GAPS"),
    "plastic_depth": ("plastic depth", "mm", "DEPTHS"),
    "worn_depth": ("worn depth", "mm", "DEPTHS"),
    "body_pressure": ("pressure on the body", "MPa", "PRESSURES"),
    "body_worn_depth": ("worn depth of the body", "mm", "DEPTHS"),
    "fluid_pressure": ("fluid pressure", "MPa", "GAPS"),
    "von_Mises": ("von Mises stress", "MPa", "STRESSES"),
    "displacement": ("displacement", "mm", "viridis"),
    "mode": ("natural mode", "", "viridis"),
}
"""What can be shown: its meaning, its unit, and its colours, of
`multiscale.results.figures.style` or matplotlib."""

PAGES = tuple(f"view_{name}.html" for name in VIEWS)
"""Files of the pages."""
