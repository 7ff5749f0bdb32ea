"""Every column of every table of a history, with its unit, and how two of them differ."""

import numpy as np

from patchlaw.multiscale.loading.column import MODE_COLUMNS
from patchlaw.multiscale.loading.load_step import COLUMNS
from patchlaw.multiscale.results.contacts import FIELDS, SPOT_COLUMNS

UNITS = {
    "": (0,), "mm/mm": (0,), "mm": (1,), "mm²": (2,), "mm³": (3,), "MPa": (0, 1), "N": (2, 1),
    "N mm": (3, 1), "mJ": (3, 1), "N/mm": (1, 1), "MPa/mm": (-1, 1), "1/MPa": (0, -1),
    "mm³/s": (3, 0, -1), "Hz": (0, 0, -1), "1/s": (0, 0, -1), "W": (3, 1, -1), "W/K": (1, 0, 0, 1),
    "S": (1, 0, 0, 0, 1), "W/m/K": (0, 0, 0, 1), "ohm m": (0, 0, 0, 0, -1), "Pa s": (0, 1, 1),
    "m/s": (1, 0, -1), "t": (1, 1, 2), "t/mm³": (-2, 1, 2),
    "K, radiating": (-1 / 3, 0, 0, 1 / 3),
}  # fmt: skip
"""Dimensions of units: powers of a length, a modulus, a time, a conductivity for heat, and one for
currents."""
WORK = {"newton_iterations", "linear_iterations", "wall_s", "reason"}
"""Columns that tell what a solution took."""
FLOORS = {"mode participation": 1e-3, "mode contact": 1e-3, "mode element": 1e-3}
"""Least size of a column over the largest one of its unit, by the begin of its name."""
FLOOR = 1e-7
"""The same of others, such as tilts, whose rests are those of closures."""
NOTHING = np.zeros(0)
"""A column that a twin does not tell."""


def tables(history):
    """Return every column of a history, its patches, modes and contacts, with units."""
    found = {}
    for one in COLUMNS:
        values = [one.of(step) for step in history]
        if one.name in WORK or all(value is None for value in values):
            continue
        found[one.name] = one.unit, np.array([np.nan if v is None else v for v in values])
    for name in history._patch_values:
        known = np.array([getattr(step.patches, name) for step in history])
        shape = getattr(history.patches, "grid", known.shape[1:])
        found[f"patch {name}"] = unit_of(name), known.reshape(len(known), *shape)
    for name in MODE_COLUMNS:
        if name not in ("mode", "residual") and history[-1].modes:
            rows = np.array([[getattr(one, name) for one in step.modes] for step in history], float)
            found[f"mode {name}"] = unit_of(name), rows
    for number, record in enumerate(history.contact_records):
        for name in FIELDS:
            values = getattr(record, name)
            if values is None or name in ("x_mm", "y_mm"):
                continue
            parts = (
                {"": values} if len(np.shape(values)) == 2 else dict(zip("xy", values, strict=True))
            )
            for axis, part in parts.items():
                found[f"map {number} {name}_{axis}"] = unit_of(name), np.asarray(part, float)[None]
        for column, name in enumerate(SPOT_COLUMNS[2:], 2):
            values = np.sort(record.spots[:, column])
            found[f"spots {number} {name}"] = unit_of(name), values
    return found


def unit_of(name):
    """Return the unit that the name of a column ends with."""
    ends = {
        "mm2": "mm²", "mm": "mm", "MPa_per_mm": "MPa/mm", "MPa": "MPa", "force_N": "N",
        "mm3_per_s": "mm³/s", "Hz": "Hz", "per_s": "1/s", "mJ_per_mm2": "N/mm",
    }  # fmt: skip
    fits = [end for end in ends if name.endswith(end)]
    return ends[max(fits, key=len)] if fits else ""


def compared(base, other):
    """Yield columns that differ: name, difference over what the column is, and what it was."""
    sizes = {unit: 0.0 for unit in UNITS}
    for name, (unit, values) in base.items():
        if "error" not in name and values.size and values.dtype.kind == "f":
            most = np.abs(values[np.isfinite(values)]).max(initial=0.0)
            sizes[unit] = max(sizes.get(unit, 0.0), most)
    sizes["N mm"] = 1e6 * sizes["N"]  # moments that a plane is free of are rests of 1e-8
    sizes["mm/mm"] = max(sizes["mm/mm"], 1e-2)  # tilts where nothing tilts
    sizes["1/s"] = max(sizes["1/s"], 1e4 * sizes["Hz"])  # so is the damping of modes
    for name in sorted({*base, *other}):
        if (name in base) != (name in other):
            yield name, np.inf, "only in " + ("one" if name in base else "the other")
            continue
        unit, given = base[name]
        found = other[name][1]
        if not found.size:  # a twin that does not tell it
            continue
        if given.shape != found.shape:
            yield name, np.inf, f"{given.shape} and {found.shape}"
        elif given.dtype.kind not in "fiu":
            if (given != found).any():
                yield name, np.inf, f"{given} and {found}"
        elif (np.isfinite(given) != np.isfinite(found)).any():
            yield name, np.inf, f"{given} and {found}"
        else:
            known = np.isfinite(given)
            if not known.any():
                continue
            own = np.abs(given[known]).max()
            floors = [floor for begin, floor in FLOORS.items() if name.startswith(begin)]
            floor = (floors or [FLOOR])[0] * sizes[unit]
            apart = np.abs(given - found)[known].max() / (max(own, floor) or 1.0)
            yield name, float(apart), f"{given[known][-1]!r} and {found[known][-1]!r}"
