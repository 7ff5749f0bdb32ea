"""Choice of a micro model by its expected error and cost.

`expected_errors` measures the contacts and bounds the error of every model, `candidates` lists the
models with their costs, and `selection` takes the cheapest that promises a tolerance and keeps it
when checked against a half-space solution.
"""
