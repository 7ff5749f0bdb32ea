"""Runs many scenes: for many values of their keys, or in every sensible way to compute one.

    sweep_cases, configurations     what is run                            `sweep`, `configurations`
    run_cases, CaseResult           runs it on any number of ranks, and goes on after a kill
                                                                           `running`
    SweepResults                    rows, means and bands of a sweep       `sweep`
    Comparison                      error over time of all ways            `comparison`
    Difference                      two runs beside each other             `difference`

`sweep`, `compare` and `difference` do all of this.
"""

AGAINST = {"reference": "reference", "concurrent": "concurrent", "half-space": "analytic"}
"""What the others can be compared against, the best first, and the coupling of each."""

AT = ("pressure", "approach", "slid")
"""What two runs can have in common where they are compared."""
