"""Compares all sensible ways to compute a scene: error against wall time.

    Configuration     one way to compute the scene                  `configuration`, `catalogue`
    RunResult         what its run gave, in a process of its own    `configuration`, `launching`
    ErrorMeasures     how far it lies from the best                 `errors`
    ErrorBreakdown    why                                           `errors`
    Comparison        all of it                                     `comparison`

`compare` does all of this and writes it, with `figures`.
"""

AGAINST = {"reference": "reference", "concurrent": "concurrent", "half-space": "analytic"}
"""What the others can be compared against, the best first, and the coupling of each."""
