"""Compares all sensible ways to compute a scene: error against wall time.

    Configuration     one way to compute the scene                  `configuration`, `catalogue`
    RunResult         what its run gave, in a process of its own    `run_result`, `launching`
    ErrorMeasures     how far it lies from the best                 `error_measures`
    ErrorBreakdown    why                                           `error_breakdown`
    Comparison        all of it                                     `comparison`

`compare` does all of this, `report` and `figures` show it.
"""
