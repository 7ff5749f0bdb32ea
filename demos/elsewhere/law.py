"""The law of patch (0, 0) of laws.csv as a function; what is beside it needs only numpy.

Straight lines go through the rows. Before the first row the pressure is zero, beyond the last one
the line continues.
"""

import csv

import numpy as np

with open("laws.csv", newline="") as file:
    rows = [row for row in csv.DictReader(file) if (row["ix"], row["iy"]) == ("0", "0")]
columns = "closure_mm", "pressure_MPa"
closure, pressure = (np.array([float(row[name]) for row in rows]) for name in columns)
rises = np.cumprod(np.append(True, np.diff(closure) > 0.0)).astype(bool)  # a function until then
closure, pressure = closure[rises], pressure[rises]
slopes = np.diff(pressure) / np.diff(closure)


def law(c):
    """Return pressures [MPa] and their slopes [MPa/mm] at closures [mm]."""
    row = np.clip(np.searchsorted(closure, c) - 1, 0, len(slopes) - 1)
    slope = np.where(c > closure[0], slopes[row], 0.0)
    return np.where(c > closure[0], pressure[row] + slope * (c - closure[row]), 0.0), slope
