"""Hard surfaces and contacts: first and full touch, summits on summits, spikes, holes, patches."""

from __future__ import annotations

from typing import Any

import numpy as np
from hard.bench import CELLS, case, lawless, of_heights, off, solved

from patchlaw.geometry import Asperities, Control, Material
from patchlaw.micro import AsperityModel

x = (np.arange(CELLS) + 0.5) / CELLS - 0.5
DOME = -(x[:, None] ** 2 + x**2) / 0.8
ONE_CELL = np.pad(np.full((1, 1), 0.01), ((CELLS // 2, CELLS // 2 - 1),) * 2)
FLAT, GAPS, SPIKE = 0.0 * DOME, DOME.copy(), 0.1 * DOME
SPIKE[7, 9] += 0.02
GAPS[3:6, 3:6] = GAPS[20:30, :4] = np.nan
STEP = np.where(x[:, None] > 0.0, 0.01, 0.0) + FLAT


@case(
    1, "first touch of a ball from 1e-10 mm, and back onto it", "Hertz' force; none at last", 5e-3
)
def first_touch() -> tuple[Any, ...]:
    grid = (np.arange(33) + 0.5) / 33 - 0.5
    ball, way = of_heights(-(grid[:, None] ** 2 + grid**2)), [1e-10, 1e-8, 1e-6]
    found = solved("consistent", micro__model="circular", load__approach=[*way, 0.0], **ball)
    hertz = (
        4
        / 3
        * Material(young_modulus=4000.0, poisson_ratio=0.15).contact_modulus
        * np.sqrt(0.5)
        * np.array(way) ** 1.5
    )
    return off(found.force_N[:3], hertz) + found.force_N[3], found


@case(2, "full contact, pressed on", "as stiff as a flat surface", 5e-3)
def full_contact() -> tuple[Any, ...]:
    deep = {"block__height": "3 mm", "load__approach": ["2 mm", "2.2 mm"]}
    rough, flat = solved("concurrent", **deep), solved("concurrent", **deep, **of_heights(FLAT))
    return off(np.diff(rough.force_N), np.diff(flat.force_N)), lawless(rough), lawless(flat)


@case(2, "flat patches, each alone: laws are no functions of closure", "within 10 % of one", 0.1)
def flat_patches() -> tuple[Any, ...]:
    flat = of_heights(FLAT)
    found, one = (solved("isolated", patches__grid=[n, n], **flat) for n in (4, 1))
    return off(found, one), found


@case(3, "all load on one of 16 patches, others without asperity", "as without patches", 1e-3)
def one_loaded_patch() -> tuple[Any, ...]:
    surface = of_heights(ONE_CELL)
    found = solved("consistent", **surface)
    return off(found, solved("concurrent", patches__grid=[1, 1], **surface)), found


@case(3, "a single patch", "as without patches", 0.02)
def a_single_patch() -> tuple[Any, ...]:
    found = solved("consistent", patches__grid=[1, 1])
    return off(found, solved("concurrent")), found


@case(3, "64 × 64 patches of 4 cells each", "as without patches", 5e-3)
def many_patches() -> tuple[Any, ...]:
    fine = {"surface__grid": [128, 128], "patches__grid": [64, 64]}
    found = solved("consistent", **fine)
    return off(found, solved("concurrent", **fine)), found


def summits(ratio: float, place: list[float], lower: float = 0.0) -> Asperities:
    """Return summits of radius 0.1 mm, of principal radii in a ratio, at places along x."""
    ones = np.ones(len(place))
    return Asperities(
        x=np.array(place), y=0.5 * ones, z=-lower * np.arange(len(place)), angle=0.0 * ones,
        radius_major=0.1 * np.sqrt(ratio) * ones, radius_minor=0.1 / np.sqrt(ratio) * ones,
        lengths=(1.0, 1.0), highest=0.0, mean_height=0.0,
    )  # fmt: skip


def pressed(approach: float, *given: Any) -> Any:
    """Press summits that interact."""
    return AsperityModel("elliptic", summits(*given), contact_modulus=4000.0).press(
        Control(approach=approach)
    )


@case(4, "merging summits: 0.04 mm apart, pressed 0.02 mm", "residual of gaps and forces", 1e-10)
def merging() -> tuple[Any, ...]:
    state = pressed(0.02, 4.0, [0.5, 0.54])
    return state.residual, state


@case(4, "a summit 1e-9 mm off and 1e-9 mm lower, overlapping", "both carry what one does", 1e-6)
def twin_beside_a_summit() -> tuple[Any, ...]:
    pair, one = pressed(0.02, 1.0, [0.5, 0.5 + 1e-9], 1e-9), pressed(0.02, 1.0, [0.5])
    return off(pair.force, one.force), pair


@case(5, "principal radii in a ratio of 10⁶, e → 1", "Hertz' asymptote", 1e-5)
def needle() -> tuple[Any, ...]:
    needle, ball = pressed(1e-3, 1e6, [0.5]), pressed(1e-3, 1.0, [0.5])
    # β = b²/a²: R'/R'' = 1/(β (Λ − 1)), Λ = ln(4/√β); next terms are of order β ln β
    beta = 1e-7
    for _ in range(60):
        beta = 1e-6 / (np.log(4 / np.sqrt(beta)) - 1.0)
    log = np.log(4 / np.sqrt(beta))
    limit = np.pi / np.sqrt(2) * ((log - 1.0) / beta) ** 0.25 * log**-1.5
    return off(needle.force, limit * ball.force), needle


@case(5, "principal radii in a ratio of 1 + 10⁻⁹, e → 0", "as the circle", 1e-9)
def nearly_round() -> tuple[Any, ...]:
    oval, ball = (pressed(1e-3, ratio, [0.5]) for ratio in (1.0 + 1e-9, 1.0))
    return off(oval.force, ball.force), oval


def couplings_agree(heights: Any) -> tuple[Any, ...]:
    """Compare laws on a surface to no laws; its slopes count where they are not too steep."""
    steep = float(np.abs(np.diff(heights, axis=0)).max()) * CELLS > 1.0
    surface = {"micro__finite_slopes": not steep, **of_heights(heights)}
    found = solved("consistent", **surface)
    return off(found, solved("concurrent", **surface)), found


for name, heights in {
    "a spike of one cell, 20 µm": SPIKE, "a step of 10 µm": STEP,
    "a plateau": np.minimum(DOME, -0.02), "a single raised cell": ONE_CELL,
}.items():  # fmt: skip
    case(13, name, "as without laws", 0.02)(lambda heights=heights: couplings_agree(heights))


@case(
    14,
    "49 of 1024 heights missing, filled on request; small slopes",
    "as without missing heights",
    1e-6,
)
def holes() -> tuple[Any, ...]:
    """Fill heights that nothing touches: they count in finite slopes alone, there by 1e-4."""
    small: dict[str, Any] = {"micro__finite_slopes": False}
    found = solved("consistent", surface__missing="fill", **small, **of_heights(GAPS))
    return off(found, solved("consistent", **small, **of_heights(DOME))), found


@case(15, "one patch, wider than the block is high: warned of", "rough approximation", 0.5)
def wide_patch() -> tuple[Any, ...]:
    wide = {"patches__grid": [1, 1], "block__height": "0.2 mm"}
    found, right = (solved(kind, **wide) for kind in ("isolated", "concurrent"))
    return off(found, right), found


@case(19, "summits 1e-13 mm apart: a singular matrix", "both carry what one does", 1e-6)
def coincident() -> tuple[Any, ...]:
    pair, one = pressed(0.02, 1.0, [0.5, 0.5 + 1e-13]), pressed(0.02, 1.0, [0.5])
    return off(pair.force, one.force), pair
