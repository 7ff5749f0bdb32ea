"""Random scenes over all features, small ones, whose heights and meshes are arrays."""

import hashlib
import pickle
from copy import deepcopy
from pathlib import Path

import numpy as np
from helpers.box_msh import write_box

from patchlaw import InputError, Spectrum, synthesise
from patchlaw.multiscale import Run, Scene

KINDS = ("concurrent", "analytic", "consistent", "isolated", "representative", "points")
FEATURES = (
    "tilt", "unload", "zero", "hardness", "friction", "leak", "heat", "wear", "vibration", "body",
    "counter_surface", "counter_body", "crown", "zones", "roller", "cells", "warm", "stages",
    "asperities", "slopes", "samples", "missing",
)  # fmt: skip


def rough(random, grid, lengths, slope, periodic):
    """Return heights of a random surface, of a window of one that is larger unless periodic."""
    share = 1 if periodic else 2
    waves = tuple(
        share * float(random.uniform(*ends)) for ends in ((1.0, 2.0), (2.5, min(grid) / 4.5))
    )
    spectrum = Spectrum(
        hurst=random.uniform(0.3, 1.0), waves=waves, rms_slope=slope, seed=int(random.integers(1e9))
    )
    sides = tuple(share * side for side in lengths)
    whole = synthesise(spectrum, grid=tuple(share * n for n in grid), lengths=sides)
    return np.array(whole.heights[: grid[0], : grid[1]])


def shaped(random, heights, lengths):
    """Return heights as they are, in steps, honed, or caps where something is decided."""
    story = str(random.choice(["rough"] * 5 + ["steps", "honed", "caps"]))
    size, shape = heights.std(), heights.shape
    x, y = ((np.arange(n) + 0.5) / n for n in shape)
    x, y = lengths[0] * x[:, None], lengths[1] * y
    if story == "steps":
        step = np.ptp(heights) / random.integers(8, 60)
        heights = np.round(heights / step) * step
    elif story == "honed":  # by grooves that meet the border
        heights, width = 0.3 * heights, 0.12 * min(lengths)
        for angle in np.radians([30.0, -30.0]):
            across = x * np.sin(angle) + y * np.cos(angle)
            for at in random.uniform(across.min(), across.max(), 3):
                heights = heights - size * np.exp(-(((across - at) / width) ** 2))
    elif story == "caps":  # in corners, on sides and borders of patches, beside them, anywhere
        heights = np.full(shape, -0.1)
        for _ in range(random.integers(1, 4)):
            places = random.choice([0.0, 0.05, 1 / 3, 0.5, 1.0, random.random()], 2)
            far = np.square(x - places[0] * lengths[0]) + np.square(y - places[1] * lengths[1])
            heights = np.maximum(heights, -far - random.uniform(0.0, 1e-2))
        heights = heights * (size / heights.std())
    return heights, story


class DrawnScene:
    """A random scene.

    Args:
        seed: Seed.
        only: Features of which the scene has as many as go together; random ones when not given.
        kind: The coupling; a random one when not given.
    """

    def __init__(self, seed, only=(), kind=None):
        self.seed, self.random = seed, np.random.default_rng(seed)
        random = self.random
        self.kind = kind or str(random.choice(KINDS, p=[0.3, 0.3, 0.1, 0.05, 0.15, 0.1]))
        self.grid = tuple(int(n) for n in random.integers(12, 16, 2))
        self.lengths = tuple(float(side) for side in random.uniform(0.6, 1.6, 2))
        self.slope = float(10 ** random.uniform(-2, -0.3))
        self.modulus, self.ratio = float(10 ** random.uniform(0, 5)), float(random.uniform(0, 0.45))
        self.contact = self.modulus / (1.0 - self.ratio**2)
        self.samples = self.kind == "representative"
        share = {"analytic": 0.4, "representative": 0.7}.get(self.kind, 0.0)
        self.periodic = bool(random.random() < share)
        self.heights = rough(random, self.grid, self.lengths, self.slope, self.periodic)
        self.story = "periodic"
        if not (self.periodic or self.samples):
            own = np.random.default_rng((seed, 2))
            self.heights, self.story = shaped(own, self.heights, self.lengths)
        self.face = tuple(8.0 * side for side in self.lengths) if self.samples else self.lengths
        self.area, self.rms = float(np.prod(self.face)), float(self.heights.std())
        self.mean = float(10 ** random.uniform(-2.3, -0.6)) * self.slope * self.contact
        self.data = self._base()
        self.used = []
        names = list(only) or [one for one in FEATURES if random.random() < 0.2]
        for name in random.permutation(names):
            before = deepcopy(self.data)
            try:
                getattr(self, f"_{name.replace(' ', '_')}")(self.data)
                scene_of(self.data)
                self.used.append(str(name))
            except (InputError, KeyError, StopIteration):
                self.data = before

    def __str__(self):
        load = {key: value for key, value in self.data["load"].items() if key != "stage"}
        return f"{self.kind}, {self.grid}, {self.story}, {', '.join(self.used) or 'plain'}, {load}"

    def _base(self):
        random, kind = self.random, self.kind
        block = {"young_modulus": self.modulus, "poisson_ratio": self.ratio}
        block["height"] = float(random.uniform(0.5, 1.5)) * min(self.face)
        surface = {"heights": self.heights, "lengths": self.lengths}
        if self.periodic:
            surface["periodic"] = True
        depth = float(random.uniform(0.02, 0.15)) * float(np.ptp(self.heights))
        loads = {"approach": depth, "force": self.mean * self.area, "pressure": self.mean}
        key = str(random.choice(list(loads)))
        load = {key: [loads[key]], "steps": int(random.integers(1, 3))}
        data = {
            "surface": surface,
            "block": block,
            "load": load | {"steps": int(random.integers(1, 3))},
        }
        data["output"] = {
            "figures": False,
            "report": False,
            "check": str(random.choice(["last", "none", "all"])),
        }
        if self.samples:
            data["law"] = {"kind": "representative"}
            block |= {"lengths": self.face, "cells": [3, 2, 1]}
            return data
        data["coupling"] = {"kind": {"points": "consistent"}.get(kind, kind)}
        if kind == "points":
            data["coupling"]["interface"] = "pointwise"
        data["patches"] = {"grid": [int(n) for n in random.integers(1, 3 + (kind in KINDS[:2]), 2)]}
        if kind in ("isolated", "points", "consistent"):
            data["coupling"]["table_tolerance"] = 2e-2
            block["cells"] = [n + 1 for n in data["patches"]["grid"]] + [2]
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
        counts = [4 if halves else 3, 2, 1]
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
        if self.periodic:
            data["counter_surface"]["periodic"] = True

    def _counter_body(self, data):
        other = {"young_modulus": 0.3 * self.modulus, "poisson_ratio": 0.2}
        if self.samples or self.random.random() < 0.4:
            levels = np.linspace(0.0, 0.8 * min(self.face), 2)
            across = [
                np.linspace(0.0, side, n + 1) for side, n in zip(self.face, (2, 3), strict=True)
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
        data["law"]["crown"] = (radius / self.random.uniform(0.05, 0.2, 2)).tolist()

    def _zones(self, data):
        if "body" in data:
            raise KeyError
        self._onto_mesh(data, halves=True)
        heights = rough(self.random, self.grid, self.lengths, 0.7 * self.slope, periodic=True)
        region = {"surface": "upper half", "heights": heights, "lengths": self.lengths}
        region["periodic"] = self.periodic
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

    def _slopes(self, data):
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
    if not Path(name).exists():
        np.save(name, heights)
    return name


def scene_of(data):
    """Return a scene, with its maps and meshes as files in the working folder."""
    return Scene.from_dict(written(data))


def ran(data, comm=None):
    """Return the history of a scene."""
    whole = Run(scene_of(data), comm)
    try:
        for _ in whole.load_steps():
            pass
        return whole.history()
    finally:
        whole.close()
