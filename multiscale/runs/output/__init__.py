"""What a run writes: tables, figures, report, fields, checkpoint; its folder."""

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
