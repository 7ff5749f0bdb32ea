"""Compares random scenes with twins that must agree, in every column of every table; see --help.

A scene is a dictionary whose heights and meshes are arrays; its twins are made from it: in other
units, mirrored, transposed, shifted over periodic borders, raised, counted from another zero, in
finer load steps, resumed, by another coupling, through Python, on two ranks.
"""

import argparse
import hashlib
import json
import os
import pickle
import signal
import subprocess
import sys
import tempfile
import time
import traceback
import warnings
from collections import defaultdict
from copy import deepcopy
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from helpers.box_msh import write_box
from helpers.resumed_runs import gone_on, ran_past

from patchlaw import InputError, NotConverged, Spectrum, synthesise
from patchlaw.multiscale import Run, Scene
from patchlaw.multiscale.loading.column import MODE_COLUMNS
from patchlaw.multiscale.loading.load_step import COLUMNS, LOOSE
from patchlaw.multiscale.results.contacts import FIELDS, SPOT_COLUMNS

KINDS = ("concurrent", "analytic", "consistent", "isolated", "representative", "points")
FEATURES = (
    "tilt", "unload", "zero", "hardness", "friction", "leak", "heat", "wear", "vibration", "body",
    "counter_surface", "counter_body", "crown", "zones", "roller", "cells", "warm", "stages",
    "asperities", "small slopes", "samples", "missing",
)  # fmt: skip

# Dimensions of units and of keys as powers of a length, a modulus, a time, a conductivity for heat
# and one for currents.
UNITS = {
    "": (0,), "mm/mm": (0,), "mm": (1,), "mm²": (2,), "mm³": (3,), "MPa": (0, 1), "N": (2, 1),
    "N mm": (3, 1), "mJ": (3, 1), "N/mm": (1, 1), "MPa/mm": (-1, 1), "1/MPa": (0, -1),
    "mm³/s": (3, 0, -1), "Hz": (0, 0, -1), "1/s": (0, 0, -1), "W": (3, 1, -1), "W/K": (1, 0, 0, 1),
    "S": (1, 0, 0, 0, 1), "W/m/K": (0, 0, 0, 1), "ohm m": (0, 0, 0, 0, -1), "Pa s": (0, 1, 1),
    "m/s": (1, 0, -1), "t": (1, 1, 2), "t/mm³": (-2, 1, 2),
    "K, radiating": (-1 / 3, 0, 0, 1 / 3),
}  # fmt: skip
KEYS = {
    "lengths": "mm", "height": "mm", "approach": "mm", "shear": "mm", "sliding": "mm",
    "crown": "mm", "temperature_jump": "mm", "displacement": "mm", "heights": "mm", "ticks": "mm",
    "young_modulus": "MPa", "hardness": "MPa", "pressure": "MPa", "pressures": "MPa",
    "largest_pressure": "MPa", "force": "N", "shear_force": "N", "viscosity": "Pa s",
    "speed": "m/s", "density": "t/mm³", "plane": "t", "conductivity": "W/m/K", "gas": "W/m/K",
    "resistivity": "ohm m", "wear.coefficient": "1/MPa", "wear": "1/MPa",
    "conductance.temperature": "K, radiating", "shift": "mm", "samples": "mm",
}  # fmt: skip
FLOORS = {"tilt_x": 1e-9, "tilt_y": 1e-9}
WORK = {"newton_iterations", "linear_iterations", "wall_s", "reason"}
"""Columns that tell what a solution took."""


# Scenes
def rough(random, grid, lengths, slope, periodic):
    """Return heights of a random surface, of a window of one that is larger unless periodic."""
    share = 1 if periodic else 2
    waves = (float(random.uniform(1, 3)) * share, float(random.uniform(4, min(grid) / 3)) * share)
    spectrum = Spectrum(
        hurst=random.uniform(0.3, 1.0), waves=waves, rms_slope=slope, seed=int(random.integers(1e9))
    )
    sides = tuple(share * side for side in lengths)
    whole = synthesise(spectrum, grid=tuple(share * n for n in grid), lengths=sides)
    return np.array(whole.heights[: grid[0], : grid[1]])


class Drawn:
    """A random scene.

    Args:
        seed: Seed.
        only: Features of which the scene has as many as go together; random ones when not given.
        kind: The coupling; a random one when not given.
    """

    def __init__(self, seed, only=(), kind=None):
        self.random = random = np.random.default_rng(seed)
        self.kind = kind or str(random.choice(KINDS, p=[0.2, 0.15, 0.2, 0.05, 0.25, 0.15]))
        self.grid = tuple(int(n) for n in random.integers(14, 23, 2))
        self.lengths = tuple(float(side) for side in random.uniform(0.6, 1.6, 2))
        self.slope = float(10 ** random.uniform(-2, -0.3))
        self.modulus, self.ratio = float(10 ** random.uniform(0, 5)), float(random.uniform(0, 0.45))
        self.contact = self.modulus / (1.0 - self.ratio**2)
        self.samples = self.kind == "representative"
        self.periodic = self.samples or (self.kind == "analytic" and random.random() < 0.4)
        self.heights = rough(random, self.grid, self.lengths, self.slope, self.periodic)
        self.face = tuple(8.0 * side for side in self.lengths) if self.samples else self.lengths
        self.area, self.rms = float(np.prod(self.face)), float(self.heights.std())
        self.mean = float(10 ** random.uniform(-2.3, -0.6)) * self.slope * self.contact
        self.data = self._base()
        self.used = []
        names = list(only) or [n for n in FEATURES if random.random() < 0.25]
        for name in random.permutation(names):
            before = deepcopy(self.data)
            try:
                getattr(self, f"_{name.replace(' ', '_')}")(self.data)
                Scene.from_dict(written(self.data))
                self.used.append(str(name))
            except (InputError, KeyError):
                self.data = before

    def __str__(self):
        load = {key: value for key, value in self.data["load"].items() if key != "stage"}
        return f"{self.kind}, {self.grid}, {', '.join(self.used) or 'plain'}, {load}"

    def _base(self):
        random, kind = self.random, self.kind
        block = {"young_modulus": self.modulus, "poisson_ratio": self.ratio}
        block["height"] = float(random.uniform(0.5, 1.5)) * min(self.face)
        surface = {"heights": self.heights, "lengths": self.lengths}
        if self.periodic and not self.samples:
            surface["periodic"] = True
        depth = float(random.uniform(0.02, 0.15)) * float(np.ptp(self.heights))
        loads = {"approach": depth, "force": self.mean * self.area, "pressure": self.mean}
        key = str(random.choice(list(loads)))
        load = {key: [loads[key]]}
        data = {"surface": surface, "block": block, "load": load | {"steps": 2}}
        data["output"] = {
            "figures": False,
            "report": False,
            "check": str(random.choice(["last", "none", "all"])),
        }
        if self.samples:
            data["law"] = {"kind": "representative"}
            block |= {"lengths": self.face, "cells": [4, 3, 3]}
            return data
        data["coupling"] = {"kind": {"points": "consistent"}.get(kind, kind)}
        if kind == "points":
            data["coupling"]["interface"] = "pointwise"
        data["patches"] = {"grid": [int(n) for n in random.integers(2, 5, 2)]}
        if kind in ("isolated", "points", "consistent"):
            data["coupling"]["table_tolerance"] = 1e-2
            block["cells"] = [2 * n for n in data["patches"]["grid"]] + [4]
        if random.random() < 0.3 and kind in ("analytic", "concurrent"):
            data["output"]["contact"] = "all"
        return data

    def _key(self, data):
        return next(key for key in ("approach", "force", "pressure") if key in data["load"])

    def _tilt(self, data):
        slopes = self.random.uniform(-0.5, 0.5, 2) * self.rms / np.array(self.face)
        free = self.random.random() < 0.5
        data["load"]["tilt"] = "free" if free else slopes.tolist()

    def _unload(self, data):
        key = self._key(data)
        most = data["load"][key][0]
        data["load"][key] = [most, 0.4 * most, 0.9 * most]
        if self.random.random() < 0.4:
            data["load"]["cycles"] = 2

    def _zero(self, data):
        if "approach" in data["load"]:
            raise KeyError
        data["load"]["zero"] = "mean plane"

    def _hardness(self, data):
        share = 10 ** self.random.uniform(-0.9, 0.3)
        data.setdefault("micro", {})["hardness"] = float(share * self.slope * self.contact)

    def _friction(self, data):
        data["friction"] = {"coefficient": float(10 ** self.random.uniform(-1.3, -0.2))}
        if "wear" in data and "sliding" in data["load"]:
            data["friction"]["speed"] = float(self.random.uniform(0.1, 3.0))
            return
        size = self.rms * 10 ** self.random.uniform(-2.5, -0.5)
        data["load"]["shear"] = (size * self.random.normal(size=(2, 2))).tolist()
        data["load"]["shear_steps"] = 2
        if self.kind in ("concurrent", "analytic"):
            data["friction"]["coupled"] = bool(self.random.random() < 0.3)

    def _leak(self, data):
        self._fluid = {"viscosity": 10 ** self.random.uniform(-3, 0), "pressures": [0.3, 0.1]}
        data["leak"] = dict(self._fluid)
        if self.samples:
            self._onto_mesh(data)
            edges = [("left", "right"), ("front", "back")][self.random.integers(2)]
            data["leak"] |= dict(zip(("inlet", "outlet"), edges, strict=True))

    def _heat(self, data):
        data["conductance"] = {
            "conductivity": [float(self.random.uniform(1, 50)), 0.7],
            "resistivity": [1.7e-8, float(10 ** self.random.uniform(-8, -6))],
        }
        if self.random.random() < 0.6:
            jump = float(self.rms * self.random.uniform(0.01, 0.1))
            more = {"gas": 0.026, "temperature_jump": jump, "temperature": 400.0, "emissivity": 0.8}
            data["conductance"] |= more

    def _wear(self, data):
        distances = np.cumsum(10 ** self.random.uniform(0, 2, 2))
        depth = self.rms * 10 ** self.random.uniform(-1.5, 0.3)
        data["wear"] = {"coefficient": float(depth / (self.mean * distances[-1]))}
        if "shear" in data["load"]:
            data["wear"]["coefficient"] *= float(distances[-1] / self.rms)
        else:
            data["load"]["sliding"] = distances.tolist()

    def _vibration(self, data):
        for name in ("block", "body", "counter_body"):
            if name in data:
                data[name]["density"] = float(self.random.uniform(1e-9, 8e-9))
        data["vibration"] = {"modes": 4}
        if self.random.random() < 0.4 and "counter_body" not in data:
            data["vibration"]["plane"] = float(5e-9 * self.area * min(self.face))
        if "friction" in data and self.random.random() < 0.6:
            data["vibration"]["sliding"] = self.random.normal(size=2).tolist()

    def _onto_mesh(self, data, halves=False):
        """Put the surface on a body from a mesh, instead of the block."""
        if "body" in data:
            return
        block = data.pop("block")
        size = (*self.face, block["height"])
        counts = [4, 3, 3]
        ticks = [np.linspace(0.0, side, n + 1) for side, n in zip(size, counts, strict=True)]
        data["body"] = {
            "ticks": ticks, "halves": halves, "contact": "top",
            "supports": [{"surface": "bottom", "displacement": [0.0, 0.0, 0.0]}],
            "young_modulus": block["young_modulus"], "poisson_ratio": block["poisson_ratio"],
        }  # fmt: skip
        if self.random.random() < 0.3:
            side, held = str(self.random.choice(["left", "back"])), ["free", "free", 0.0]
            held = [0.0, "free", "free"] if side == "left" else ["free", 0.0, "free"]
            data["body"]["supports"].append({"surface": side, "displacement": held})

    def _body(self, data):
        self._onto_mesh(data)

    def _counter_surface(self, data):
        other = rough(self.random, self.grid, self.lengths, 0.5 * self.slope, self.periodic)
        data["counter_surface"] = {"heights": other, "lengths": self.lengths}
        if self.periodic and not self.samples:
            data["counter_surface"]["periodic"] = True

    def _counter_body(self, data):
        other = {"young_modulus": 0.3 * self.modulus, "poisson_ratio": 0.2}
        if self.samples or self.random.random() < 0.4:
            levels = np.linspace(0.0, 0.8 * min(self.face), 3)
            across = [
                np.linspace(0.0, side, n + 1) for side, n in zip(self.face, (3, 4), strict=True)
            ]
            other |= {
                "ticks": [*across, levels], "halves": False, "above": True, "contact": "bottom",
                "supports": [{"surface": "top", "displacement": [0.0, 0.0, 0.0]}],
            }  # fmt: skip
            self._onto_mesh(data)
            top = data["body"]["ticks"][2]
            data["body"]["ticks"][2] = top - top[-1]
        data["counter_body"] = other

    def _crown(self, data):
        radius = np.square(self.face) / (8.0 * self.rms)
        data["law"]["crown"] = (radius / self.random.uniform(0.2, 1.0, 2)).tolist()

    def _zones(self, data):
        if "body" in data:
            raise KeyError
        self._onto_mesh(data, halves=True)
        heights = rough(self.random, self.grid, self.lengths, 0.7 * self.slope, periodic=True)
        region = {"surface": "upper half", "heights": heights, "lengths": self.lengths}
        data["law"]["regions"] = [region]

    def _roller(self, data):
        data["block"]["sides"] = "roller"

    def _cells(self, data):
        data.setdefault("micro", {})["cells"] = [int(n * 1.5) for n in self.grid]

    def _warm(self, data):
        self._onto_mesh(data)
        data["body"] |= {"thermal_expansion": 1e-5}
        rise = self.rms / np.ptp(data["body"]["ticks"][2]) / 1e-5
        data["body"]["temperature"] = float(self.random.uniform(-0.5, 0.5) * rise)

    def _stages(self, data):
        key, load = self._key(data), data["load"]
        most = load.pop(key)[0]
        stages = [{key: 0.6 * most, "steps": 1}, {key: most}]
        if self.random.random() < 0.5:
            stages += [{key: 0.5 * most}]
        for name in ("shear", "sliding", "shear_steps", "cycles"):
            value = load.pop(name, None)
            if value is not None and name in ("shear", "sliding"):
                stages[-1][name] = value if name == "sliding" else value[:1]
        load["stage"] = stages

    def _asperities(self, data):
        data.setdefault("micro", {})["model"] = str(
            self.random.choice(["elliptic", "circular", "elliptic-independent"])
        )

    def _small_slopes(self, data):
        data.setdefault("micro", {})["finite_slopes"] = bool(self.random.random() < 0.5)

    def _samples(self, data):
        more = [
            rough(self.random, self.grid, self.lengths, self.slope, periodic=True) for _ in range(2)
        ]
        data["law"]["samples"] = more

    def _missing(self, data):
        holes = self.random.random(self.grid) < 0.03
        data["surface"]["heights"] = np.where(holes, np.nan, self.heights)
        data["surface"] |= {"missing": "fill", "detrend": "plane"}


def written(data):
    """Return a scene as a dictionary of which the program reads files."""

    def walked(value, key=""):
        if isinstance(value, dict):
            value = {name: walked(one, name) for name, one in value.items()}
            if "ticks" in value:
                ticks, halves = value.pop("ticks"), value.pop("halves")
                value.pop("above", None)
                name = hashlib.sha256(pickle.dumps((ticks, halves))).hexdigest()[:16] + ".msh"
                if not Path(name).exists():
                    write_box(name, ticks, halves=halves)
                value["mesh"] = name
            if "heights" in value:
                value["file"] = _map_file(value.pop("heights"))
            return value
        if key == "samples":
            return [_map_file(one) for one in value]
        return value

    return walked(data)


def _map_file(heights):
    name = hashlib.sha256(np.ascontiguousarray(heights)).hexdigest()[:16] + ".npy"
    np.save(name, heights)
    return name


def ran(data, comm=None):
    """Return the history of a scene."""
    whole = Run(Scene.from_dict(written(data)), comm)
    try:
        for _ in whole.load_steps():
            pass
        return whole.history()
    finally:
        whole.close()


# Tables
def tables(history):
    """Return every column of a history, its patches, modes and contacts, with units."""
    found = {}
    for one in COLUMNS:
        values = [one.of(step) for step in history]
        if one.name in WORK or all(value is None for value in values):
            continue
        found[one.name] = one.unit, np.array([np.nan if v is None else v for v in values])
    for name in history._patch_values:
        values = np.array([getattr(step.patches, name) for step in history])
        shape = getattr(history.patches, "grid", (values.shape[1],))
        found[f"patch {name}"] = unit_of(name), values.reshape(len(values), *shape)
    for name in MODE_COLUMNS:
        if name not in ("mode", "residual") and history[-1].modes:
            rows = [[getattr(one, name) for one in step.modes] for step in history]
            found[f"mode {name}"] = unit_of(name), np.array(rows, float)
    for number, record in enumerate(history.contact_records):
        for name in FIELDS:
            values = getattr(record, name)
            if values is None or name in ("x_mm", "y_mm"):
                continue
            parts = {"": values} if len(np.shape(values)) == 2 else dict(zip("xy", values))
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
    sizes["N mm"] = 1e4 * sizes["N"]  # moments: those that a plane is free of are rests of 1e-8
    if not any(name.startswith("patch") for name in other):  # shifted, which moves their borders
        base = {n: v for n, v in base.items() if not n.startswith(("patch", "moment", "map"))}
    for name in sorted({*base, *other}):
        if (name in base) != (name in other):
            yield name, np.inf, "only in " + ("one" if name in base else "the other")
            continue
        unit, given = base[name]
        found = other[name][1]
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
            floor = FLOORS.get(name, 1e-7) * sizes[unit]
            apart = np.abs(given - found)[known].max() / (max(own, floor) or 1.0)
            yield name, float(apart), f"{given[known][-1]!r} and {found[known][-1]!r}"


# Twins: each returns another scene, and what its tables are in those of the first
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

    def walked(value, section=""):
        if isinstance(value, list | tuple):
            return [walked(one, section) for one in value]
        if not isinstance(value, dict):
            return value
        changed = {}
        for key, one in value.items():
            unit = KEYS.get(f"{section}.{key}") or KEYS.get(key)
            nested = isinstance(one, dict) or (key in ("stage", "supports", "regions"))
            changed[key] = times(one, factor(unit)) if unit and not nested else walked(one, key)
        return changed

    def back(table):
        return {
            name: (unit, values / factor(unit) if values.dtype.kind == "f" else values)
            for name, (unit, values) in table.items()
        }

    return walked(data), back


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

    def walked(value, section=""):
        if isinstance(value, list | tuple):
            return [walked(one, section) for one in value]
        if not isinstance(value, dict):
            return value
        changed = {}
        for key, one in value.items():
            if key == "sliding" and section != "vibration":
                changed[key] = one
            elif key in PAIRS:
                changed[key] = pair(one)
            elif key == "heights":
                changed[key] = turned(one, above=section == "counter_surface")
            elif key == "samples":
                changed[key] = [turned(each) for each in one]
            elif key == "ticks":
                changed[key] = [-one[0][::-1], *one[1:]] if mirror else axes(one)
            elif key in ("lengths", "grid", "cells", "crown"):
                changed[key] = axes(one)
            elif key in ("surface", "contact", "inlet", "outlet") and isinstance(one, str):
                halves = one not in ("top", "upper half") or data["body"]["halves"]
                changed[key] = other.get(one, one) if halves else one
            else:
                changed[key] = walked(one, key)
        return changed

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
        return found

    return walked(data), back


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
    if not (samples or surface.get("periodic")) or "missing" in surface:
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
        if samples:
            return table
        return {n: v for n, v in table.items() if not n.startswith(("patch", "moment", "map"))}

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
        table = dict(table)
        table["approach_mm"] = table.pop("first_touch_approach_mm")
        unit, closure = table["patch closure_mm"]
        shape = (-1, *[1] * (closure.ndim - 1))
        table["patch closure_mm"] = unit, closure + zero.reshape(shape)
        return table

    return data, back


SYMMETRIES = (scaled, mirrored, flipped, transposed, shifted, raised, recounted)


def all_at_once(data, random):
    """All of these, one after another."""
    backs = []
    for twin in SYMMETRIES:
        if (made := twin(data, random)) is not None:
            data, back = made
            backs.append(back)

    def back(table):
        for one in reversed(backs):
            table = one(table)
        return table

    return data, back


def tried(seed, only, kind, allowed):
    """Yield the twin, the column that differs, by how much, and what it is."""
    case = Drawn(seed, only, kind)
    print(f"scene {seed}: {case}", flush=True)
    history = ran(case.data)
    if any(LOOSE in step.warnings for step in history) or not history.force_N.any():
        return
    base, random = tables(history), lambda: np.random.default_rng((seed, 1))
    for name, wrong in consistent(case, history):
        yield "alone", name, wrong, ""
    for name, apart, told in derivatives(case.data, random()):
        yield "derivative", name, apart * allowed / 1e-3, told
    found = list(differences(base, all_at_once(case.data, random())))
    if all(apart <= limit(allowed, name) for name, apart, _ in found):
        for one in found:
            yield "all", *one
        return
    for twin in SYMMETRIES:
        if (made := twin(case.data, random())) is not None:
            for one in differences(base, made):
                yield twin.__name__, *one


def limit(allowed, name):
    """Return what a column may differ by."""
    return allowed * (100.0 if "error" in name else 1.0)


def differences(base, made):
    """Yield the columns of a twin, the differences, and what they are."""
    data, back = made
    try:
        found = back(tables(ran(data)))
    except (InputError, NotConverged) as error:
        yield "ended", np.inf, str(error)
        return
    yield from compared(base, found)


def consistent(case, history):
    """Yield what must hold of one history, and how far it does not."""
    force, area = history.force_N, case.area
    for name in ("contact_area_fraction", "yielding_area_fraction", "slip_area_fraction"):
        values = getattr(history, name)
        yield (
            f"{name} within 0 and 1",
            float(
                np.nanmax(
                    np.append(
                        [
                            values,
                        ],
                        0,
                    )
                )
                > 1 + 1e-12
                or np.nanmin(np.append(values, 0.0)) < 0
            ),
        )
    yield (
        "mean pressure",
        float(np.abs(history.mean_pressure_MPa * area / force - 1.0)[force > 0].max()),
    )
    for step in history:
        for one in COLUMNS:
            error = one.error_of(step) if one.error else None
            if error is not None and not error >= 0.0:
                yield f"{one.error} below zero", 1.0
        checked = case.data["output"]["check"]
        if checked == "all" or (checked == "last" and step is history[-1]):
            for one in COLUMNS:
                if one.error and one.of(step) is not None and one.error_of(step) is None:
                    yield f"{one.error} missing", 1.0


ELASTIC = ("hardness", "friction", "wear", "unload", "stages", "warm", "asperities")


def neighbour(data, random):
    """One more load step that is a little further; None where loads turn or leave traces."""
    if any(word in str(data) for word in ("hardness", "friction", "wear", "stage", "temperature")):
        return None
    key = next(key for key in ("approach", "force", "pressure") if key in data["load"])
    if len(data["load"][key]) > 1:
        return None
    data, most = deepcopy(data), data["load"][key][0]
    data["load"] |= {key: [most, (1.0 + FURTHER) * most], "steps": 1}
    return data


FURTHER = 1e-4


def derivatives(data, random):
    """Yield stiffnesses and energies against differences between neighbouring load steps."""
    if (further := neighbour(data, random)) is None:
        return
    history = ran(further)
    force, approach = np.diff(history.force_N)[0], np.diff(history.approach_mm)[0]
    if not force > 0.0:
        return
    for name, value in (
        ("approach_stiffness_N_per_mm", force / approach),
        ("interface_stiffness_N_per_mm", -force / np.diff(history.mean_separation_mm)[0]),
    ):
        if name == "approach_stiffness_N_per_mm" and data["load"].get("tilt") == "free":
            pass
        stated = getattr(history, name).mean()
        if np.isfinite(stated) and stated:
            yield name, abs(value / stated - 1.0), f"{value} and {getattr(history, name)}"
    energy, work = np.diff(history.elastic_energy_mJ)[0], history.force_N.mean() * approach
    if np.isfinite(energy):
        yield "elastic_energy_mJ", abs(energy / work - 1.0), f"{energy} and {work}"


class Slow(Exception):
    """A scene took longer than it may."""


def main():
    """Run the campaign."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenes", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", nargs="*", default=())
    parser.add_argument("--kind")
    parser.add_argument("--allowed", type=float, default=1e-6)
    parser.add_argument("--longest", type=float, default=60.0)
    choice = parser.parse_args()

    def late(*_):
        raise Slow

    signal.signal(signal.SIGPROF, late)
    os.environ["PATCHLAW_CACHE"] = "off"
    allowed, worst = choice.allowed, defaultdict(float)
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        for seed in range(choice.seed, choice.seed + choice.scenes):
            began = time.process_time()
            signal.setitimer(signal.ITIMER_PROF, choice.longest)
            try:
                for twin, name, apart, told in tried(
                    seed, choice.only, choice.kind, choice.allowed
                ):
                    worst[twin, name] = max(worst[twin, name], apart)
                    if not apart <= limit(choice.allowed, name):
                        print(f"   {twin}: {name} {apart:.1e}: {told}", flush=True)
            except (InputError, NotConverged) as error:
                print(f"   ended: {error}")
            except Slow:
                print("   slow")
            except Exception:
                print(f"   DEFECT: {traceback.format_exc()[-1500:]}")
            finally:
                signal.setitimer(signal.ITIMER_PROF, 0)
            print(f"   {time.process_time() - began:.1f} s", flush=True)


if __name__ == "__main__":
    main()
