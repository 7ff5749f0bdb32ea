"""Random scenes with coarse grids."""

from dataclasses import dataclass, replace

import numpy as np

from patchlaw.geometry import Spectrum, Surface, synthesise
from patchlaw.multiscale import Scene, run

KINDS = ("isolated", "consistent", "concurrent", "analytic")
MODELS = (
    {"model": "half-space"},
    {"model": "half-space"},
    {"model": "half-space"},
    {"model": "elliptic"},
    {"model": "circular-independent"},
    {"model": "elliptic-independent"},
)
PLACES = ("anywhere", "anywhere", "middle", "border", "beside a side", "side", "corner")


@dataclass(frozen=True, kw_only=True)
class Case:
    """A scene with its heights, in mm, N and MPa.

    Attributes:
        heights: Heights, shape (nx, ny).
        lengths: Sides of the surface.
        block: Section of the block.
        patches: Numbers of patches.
        micro: Section of the micro model.
        kind: The coupling.
        approach: Largest approach.
        tilt: Slopes of the plane.
        story: What the heights are.
        hardness: Hardness; None for elastic contacts.
        tolerance: Relative tolerance of the tables of laws.
        free_tilt: Whether the plane turns without moment instead of keeping its slopes.
        friction: Coefficient of friction; None for contacts without shear.
        shear: Shifts of the plane, after the normal load or along it.
        shear_path: ``"after"``, or ``"along"`` where there are as many shifts as turning points.
        leak: Whether a fluid flows through the gap, in both directions.
    """

    heights: np.ndarray
    lengths: tuple
    block: dict
    patches: tuple
    micro: dict
    kind: str
    approach: float
    tilt: tuple
    story: str
    hardness: float | None = None
    tolerance: float = 1e-3
    free_tilt: bool = False
    friction: float | None = None
    shear: tuple = ()
    shear_path: str = "after"
    leak: bool = False

    def __str__(self):
        micro, sides = ", ".join(self.micro.values()), self.block["sides"]
        tilt = "free" if self.free_tilt else self.tilt
        return (
            f"{self.kind}, {micro}, {self.story}, heights {self.heights.shape}, patches"
            f" {self.patches}, height {self.block['height']}, {sides}, tilt {tilt}, hardness"
            f" {self.hardness}, friction {self.friction} {self.shear_path}, leak {self.leak}"
        )

    @property
    def nominal_area(self):
        """Area of the surface [mm²]."""
        return self.lengths[0] * self.lengths[1]

    def history(self, folder, output=None, **load):
        """Run the scene.

        Args:
            folder: Where the heights are written.
            output: Keys of the output beside the check, which is off.
            load: Keys of the load other than the tilt, whose lengths are in mm, forces in N.
        """
        path = folder / "heights.npy"
        np.save(path, self.heights)
        load = {"tilt": "free" if self.free_tilt else list(self.tilt)} | load
        data = {
            "surface": {"file": str(path), "lengths": list(self.lengths)},
            "block": self.block,
            "patches": {"grid": list(self.patches)},
            "micro": dict(self.micro),
            "coupling": {"kind": self.kind} | self._tables,
            "load": load,
            "output": {"check": "none"} | (output or {}),
        }
        if self.hardness is not None:
            data["micro"]["hardness"] = self.hardness
        if self.friction is not None:
            # coupled pressures depend on the slip before: the way back is another one
            data["friction"] = {"coefficient": self.friction, "coupled": False}
            load |= self._sheared(len(load.get("approach", load.get("force", ()))))
            data["load"] = load
        if self.leak:
            data["leak"] = {"viscosity": 1e-9, "pressures": [0.2, 0.0]}
        return run(Scene.from_dict(data))

    def _sheared(self, points):
        """Return the keys of the load for shear; along the normal load with as many points."""
        shifts = list(map(list, self.shear))
        if self.shear_path == "along":
            return {"shear": (shifts * points)[:points], "shear_path": "along"}
        return {"shear": shifts, "shear_steps": 2}

    @property
    def _tables(self):
        return {"table_tolerance": self.tolerance} if self.kind in KINDS[:2] else {}


def drawn(seed):
    """Return a random scene."""
    random = np.random.default_rng(seed)
    grid = tuple(int(n) for n in random.integers(14, 34, 2))
    if random.random() < 0.3:
        grid = (grid[0], grid[0])
    lengths = (1.0, round(float(grid[1] / grid[0] * random.choice([1.0, 1.0, 0.8, 1.3])), 6))
    patches = tuple(int(n) for n in random.integers(1, 5, 2))
    heights, story = _heights(random, grid, lengths, patches)
    tilted = random.random() < 0.3
    depth = float(np.ptp(heights))
    micro = dict(MODELS[random.integers(len(MODELS))])
    kind = KINDS[random.integers(len(KINDS))]
    poisson_ratio = float(random.uniform(0.0, 0.45))
    modulus = float(10 ** random.uniform(0, 5))
    hardness = None
    if (
        micro["model"] == "half-space"
        and kind in ("analytic", "concurrent")
        and random.random() < 0.6
    ):
        slopes = np.gradient(heights, lengths[0] / grid[0], lengths[1] / grid[1])
        steepness = float(np.sqrt(np.mean(np.square(slopes)))) or 0.1
        hardness = float(10 ** random.uniform(-2.0, 0.0)) * steepness * modulus
        hardness /= 1.0 - poisson_ratio**2
    cells = [max(4, patches[0]), max(4, patches[1]), 4]
    case = Case(
        heights=heights,
        lengths=lengths,
        block={
            "young_modulus": modulus,
            "poisson_ratio": poisson_ratio,
            "height": float(random.choice([1.0, random.uniform(0.2, 3.0)])),
            "sides": str(random.choice(["free", "free", "roller"])),
            "cells": cells,
        },
        patches=patches,
        micro=micro,
        kind=kind,
        approach=float(random.uniform(0.02, 0.2)) * depth,
        tilt=tuple(float(t) for t in random.uniform(-0.1, 0.1, 2) * depth)
        if tilted
        else (0.0, 0.0),
        story=story,
        hardness=hardness,
        free_tilt=bool(random.random() < 0.15),
    )
    return _with_shear_and_leak(case, np.random.default_rng((seed, 1)))


def _with_shear_and_leak(case, random):
    """Return a case that half-space contacts also solve with friction, a fluid, or both."""
    if case.micro["model"] != "half-space" or case.kind not in ("analytic", "concurrent"):
        return case
    if random.random() < 0.6:
        size = case.approach * 10 ** random.uniform(-2.0, 0.0)
        case = replace(
            case,
            friction=float(10 ** random.uniform(-1.5, 0.0)),
            shear=tuple((float(x), float(y)) for x, y in size * random.normal(size=(3, 2))),
            shear_path=str(random.choice(["after", "along"])),
        )
    return replace(case, leak=bool(random.random() < 0.5))


def _heights(random, grid, lengths, patches):
    story = str(random.choice(["spectrum", "spectrum", "spectrum", "caps", "steps", "honed"]))
    if story == "caps":
        return _caps(random, grid, lengths, patches)
    if story == "honed":
        return _honed(random, grid, lengths), story
    spectrum = Spectrum(
        hurst=float(random.uniform(0.3, 1.0)),
        waves=(float(random.choice([1, 2])), float(random.uniform(3, min(grid) / 3))),
        rms_slope=float(10 ** random.uniform(-2, 0.5)),
        seed=int(random.integers(1 << 30)),
    )
    heights = synthesise(spectrum, grid=grid, lengths=lengths).heights
    if story == "steps":
        step = np.ptp(heights) / random.integers(8, 60)
        heights = np.round(heights / step) * step
    return np.array(heights), story


def _honed(random, grid, lengths):
    """Return a plateau crossed by grooves that meet the border, sampled 6 to 10 times a wave."""
    waves = min(grid) / float(random.uniform(6.0, 10.0))
    spectrum = Spectrum(
        hurst=0.8, waves=(1.0, waves), rms_slope=0.02, seed=int(random.integers(1 << 30))
    )
    plateau = synthesise(spectrum, grid=grid, lengths=lengths)
    x, y = plateau.x[:, None], plateau.y
    depth, heights = float(10 ** random.uniform(-3.0, -1.5)), np.array(plateau.heights)
    width = 0.5 * min(lengths) / waves
    for angle in (30.0, -30.0):
        across = x * np.sin(np.radians(angle)) + y * np.cos(np.radians(angle))
        for at in random.uniform(across.min(), across.max(), 3):
            heights -= depth * np.exp(-(((across - at) / width) ** 2))
    return heights


def _caps(random, grid, lengths, patches):
    """Return paraboloids over a floor, at places that decide something."""
    flat = Surface(heights=np.zeros(grid), lengths=lengths)
    x, y = flat.x[:, None], flat.y
    radius, rise = float(10 ** random.uniform(-0.7, 0.5)), 0.0
    heights, places = np.full(grid, -0.02 / radius), []
    for _ in range(random.integers(1, 4)):
        name = str(random.choice(PLACES))
        at = [_place(random, name, length, n) for length, n in zip(lengths, patches, strict=True)]
        if name == "side":
            at[1] = float(random.uniform(0.0, lengths[1]))
        cap = -rise - ((x - at[0]) ** 2 + (y - at[1]) ** 2) / (2.0 * radius)
        heights, rise = np.maximum(heights, cap), float(random.uniform(0.0, 1e-3 / radius))
        places.append(name)
    return heights, "caps: " + ", ".join(places)


def _place(random, name, length, patches):
    if name == "middle":
        return 0.5 * length
    if name == "border":
        return length * int(random.integers(patches + 1)) / patches
    if name == "beside a side":
        return float(random.choice([0.06, length - 0.06]))
    if name in ("side", "corner"):
        return float(random.choice([0.0, length]))
    return float(random.uniform(0.0, length))
