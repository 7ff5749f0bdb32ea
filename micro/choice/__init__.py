"""The micro models by name, and the choice of one by its expected error and cost.

`models` makes models by name and lists them as candidates with their costs, `expected_errors`
measures the contacts and bounds the error of every model, and `selection` takes the cheapest that
promises a tolerance and keeps it when checked against a half-space solution.
"""
