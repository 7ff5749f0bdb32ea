"""Twins of a scene: each returns another scene, and what its tables are in those of the first."""

from copy import deepcopy

import numpy as np

from benchmarks.twin_tables import NOTHING, UNITS

KEYS = {
    "lengths": "mm", "height": "mm", "approach": "mm", "shear": "mm", "sliding": "mm",
    "crown": "mm", "temperature_jump": "mm", "displacement": "mm", "heights": "mm", "ticks": "mm",
    "young_modulus": "MPa", "hardness": "MPa", "pressure": "MPa", "pressures": "MPa",
    "largest_pressure": "MPa", "force": "N", "shear_force": "N", "viscosity": "Pa s",
    "speed": "m/s", "density": "t/mm³", "plane": "t", "conductivity": "W/m/K", "gas": "W/m/K",
    "resistivity": "ohm m", "wear.coefficient": "1/MPa", "wear": "1/MPa",
    "conductance.temperature": "K, radiating", "shift": "mm", "samples": "mm",
}  # fmt: skip
"""Units of keys of a scene."""


def without(table, *parts):
    """Return tables without the columns whose names have one of some parts."""
    return {
        name: (unit, NOTHING if any(part in name for part in parts) else values)
        for name, (unit, values) in table.items()
    }


def changed_keys(value, change, section=""):
    """Return sections whose keys are as ``change(section, key, value)`` has them, if not None."""
    if isinstance(value, list | tuple):
        return [changed_keys(one, change, section) for one in value]
    if not isinstance(value, dict):
        return value
    return {
        key: changed_keys(one, change, key) if (made := change(section, key, one)) is None else made
        for key, one in value.items()
    }


def scaled(data, random):
    """Other units of length, modulus, time and conductivities, none of them round."""
    sizes = np.exp(random.uniform(-1.5, 1.5, 5))

    def factor(unit):
        powers = UNITS[unit]
        return float(np.prod(sizes[: len(powers)] ** np.array(powers, float)))

    def times(value, by):
        if isinstance(value, str):
            return value
        if isinstance(value, list | tuple):
            return [times(one, by) for one in value]
        return value * by

    def change(section, key, one):
        unit = KEYS.get(f"{section}.{key}") or KEYS.get(key)
        nested = isinstance(one, dict) or key in ("stage", "supports", "regions")
        return times(one, factor(unit)) if unit and not nested else None

    def back(table):
        return {
            name: (unit, values / factor(unit) if values.dtype.kind == "f" else values)
            for name, (unit, values) in table.items()
        }

    return changed_keys(data, change), back


WORDS = {
    "mm": ("um", 1e3), "MPa": ("GPa", 1e-3), "N": ("kN", 1e-3), "m/s": ("mm/s", 1e3),
    "Pa s": ("mPa s", 1e3), "t": ("kg", 1e3), "t/mm³": ("kg/m^3", 1e12), "1/MPa": ("1/GPa", 1e3),
}  # fmt: skip
"""Other units to write values in, and what a value is multiplied by."""


def worded(data, random):
    """Values with other units, as text."""

    def text(value, word, factor):
        if isinstance(value, list | tuple):
            return [text(one, word, factor) for one in value]
        return value if isinstance(value, str) else f"{float(value * factor)!r} {word}"

    def change(section, key, one):
        unit = KEYS.get(f"{section}.{key}") or KEYS.get(key)
        nested = isinstance(one, dict) or key in ("stage", "supports", "regions")
        if unit not in WORDS or nested or key in ("heights", "ticks", "samples"):
            return None
        return text(one, *WORDS[unit])

    return changed_keys(data, change), lambda table: table


NAMES = {"mirrored": {"left": "right", "top": "upper half"},
         "transposed": {"left": "front", "right": "back"}}  # fmt: skip
PAIRS = {"tilt", "shear", "shear_force", "sliding", "shift", "displacement"}


def moved(data, way):
    """Return a scene mirrored in x, or with x and y exchanged."""
    mirror = way == "mirrored"
    other = NAMES[way] | {b: a for a, b in NAMES[way].items()}

    def pair(value):
        if isinstance(value, str) or value is None:
            return value
        if isinstance(value[0], list | tuple):
            return [pair(one) for one in value]
        x, y, *z = value
        x, y = ((-x if isinstance(x, float) else x), y) if mirror else (y, x)
        return [x, y, *z]

    def turned(heights, above=False):
        if mirror:
            return heights[::-1]
        return heights.T[::-1, ::-1] if above else heights.T

    def axes(value):
        return value if mirror else [value[1], value[0], *value[2:]]

    def change(section, key, one):
        if key == "sliding" and section != "vibration":
            return one
        if key in PAIRS:
            return pair(one)
        if key == "heights":
            return turned(one, above=section == "counter_surface")
        if key == "samples":
            return [turned(each) for each in one]
        if key == "ticks":
            return [-one[0][::-1], *one[1:]] if mirror else axes(one)
        if key in ("lengths", "grid", "cells", "crown"):
            return axes(one)
        if key in ("surface", "contact", "inlet", "outlet") and isinstance(one, str):
            halves = one not in ("top", "upper half") or data["body"]["halves"]
            return other.get(one, one) if halves else one
        return None

    def back(table):
        found = {}
        for name, (unit, values) in table.items():
            if not mirror:
                ends = {f"_{a}{end}": f"_{b}{end}" for a, b in ("xy", "yx") for end in ENDS}
                for end in sorted(ends, key=len, reverse=True):
                    if name.endswith(end):
                        name = name[: -len(end)] + ends[end]
                        break
            elif any(name.endswith(f"_x{end}") for end in ENDS) and name.startswith(ODD):
                values = -values
            if values.ndim == 3:
                values = values[:, ::-1] if mirror else values.transpose(0, 2, 1)
            found[name] = unit, values
        # before the shear changes it is that along x, one way
        return without(found, "tangential_stiffness")

    return changed_keys(data, change), back


ENDS = ("", "_mm", "_N", "_N_mm", "_mm3", "_mm3_per_s", "_fraction")
ODD = ("tilt", "moment", "shear", "map")


def mirrored(data, random):
    """Mirrored in x."""
    return moved(data, "mirrored")


def transposed(data, random):
    """With x and y exchanged."""
    if data.get("body", {}).get("halves"):
        return None
    return moved(data, "transposed")


def flipped(data, random):
    """Mirrored in y."""
    if data.get("body", {}).get("halves"):
        return None
    once, first = moved(data, "transposed")
    twice, second = moved(once, "mirrored")
    last, third = moved(twice, "transposed")
    return last, lambda table: first(second(third(table)))


def shifted(data, random):
    """Shifted over periodic borders."""
    surface, samples = data["surface"], "law" in data
    if not surface.get("periodic") or "missing" in surface:
        return None
    if "cells" in data.get("micro", {}):  # which do not move by whole ones
        return None
    x, y = (int(n) for n in random.integers(1, surface["heights"].shape))
    data = deepcopy(data)
    data["surface"]["heights"] = np.roll(surface["heights"], (x, y), (0, 1))
    if "counter_surface" in data:
        other = data["counter_surface"]
        other["heights"] = np.roll(other["heights"], (-x, y), (0, 1))

    def back(table):
        # coarser grids have other cells; inlets, and patches of one period, stay where they are
        words = ["error", "leak", "transmissivity", "hydraulic", "flow_factor", "constriction"]
        return without(table, *words, *(() if samples else ("patch", "moment", "map")))

    return data, back


def raised(data, random):
    """Heights above another level."""
    data, heights = deepcopy(data), data["surface"]["heights"]
    data["surface"]["heights"] = heights + random.normal() * np.nanstd(heights)
    return data, lambda table: table


def recounted(data, random):
    """Approaches counted from the mean plane."""
    load = data["load"]
    if (
        "approach" in load
        or "zero" in load
        or any("approach" in one for one in load.get("stage", ()))
    ):
        return None
    data = deepcopy(data)
    data["load"]["zero"] = "mean plane"

    def back(table):
        zero = table["first_touch_approach_mm"][1] - table["approach_mm"][1]
        table = without(table, "approach_error")  # which is another one
        table["approach_mm"] = table.pop("first_touch_approach_mm")
        unit, closure = table["patch closure_mm"]
        shape = (-1, *[1] * (closure.ndim - 1))
        table["patch closure_mm"] = unit, closure + zero.reshape(shape)
        return table

    return data, back


SYMMETRIES = {
    one.__name__: one
    for one in (scaled, mirrored, flipped, transposed, shifted, raised, recounted, worded)
}
