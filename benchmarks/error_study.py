"""Are measured errors those that runs have, and is the accuracy kept that was asked for?

Run by hand, ten minutes on an idle core: `.venv/bin/python benchmarks/error_study.py
[measured] [accuracy] [full] [turning] [pressing] [reading] [yielding] [wearing] [shearing] [harder]
[sampled] [--first N] [--last N] [--every N]`.

Scenes are random: hurst, waves, slopes, blocks 0.3, 1 and 3 mm high, tilts, loads; every fourth is
plateau-honed, with grooves that meet the border, on 6 to 10 heights per shortest wave, and every
tenth is steep, with an rms gradient of 0.25 to 0.6. Every fourth has its roughness meshed as its
truth, which all causes are measured against, and so have the steep ones. The truth of the others is
the contact problem on four times as many cells along a side with four more modes of the body: it
has the same finite slopes, and what was measured for them is left out. Approaches count from first
touch of the true surface, so that the error of this zero is part of what is measured.

Three classes more are whole runs on 32² cells, and their truth is the same run on twice as many
cells a side (four times in full contact), in four times as many steps: ``full`` presses rough and
flat faces to about full contact, ``turning`` shears half-spaces along polygons, ``pressing``
presses them with coupled friction (a minute of a core each). What that truth has in common with
the run, modes of the body and slopes, is left out of what is stated. The class ``reading`` judges
area, gap, stiffness of the interface and conductances, and of every third the leak, of others the
shift under a shear force, of runs on 32² and 48² cells, by forces and by approaches, against four
times as many cells a side (20 s of a core each). The class ``wearing`` judges worn volume and
depths, too, of cells and of faces under laws that slide, and of cells that fret, against twice as
many cells or elements a side and many more steps of the distance (half a minute of a core each).
The class ``harder`` reads the same off surfaces that are unusual (`TWISTS`), five seconds of a core
each: scene n has the twist that is left over when n is divided by their number.
The class ``sampled`` reads it off blocks under laws of 2 to 5 samples, whose truth is the mean of
16 others on twice as many cells a side (ten seconds each).
The class ``shearing`` judges the shift or the shear force of half-spaces on 16 to 24 cells a side,
sheared on one to three legs, against four times as many cells a side (half a minute each).
"""

import argparse
import os
import time
from dataclasses import replace

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

from patchlaw import InputError, NotConverged
from patchlaw.geometry import Control, Spectrum, Surface, synthesise
from patchlaw.micro.boundary_elements.finite_slopes import SLOPES
from patchlaw.micro.half_space.error_probe import _Problems
from patchlaw.multiscale import Run, Scene
from patchlaw.multiscale.bodies.bodies import on_body
from patchlaw.multiscale.models.measured_errors.faces import LawErrorProbe

SCENES, MESHED, STEEP, HONED = 40, 4, 10, 4
"""Every so many scenes; honed ones are those that leave 1 when divided."""
MORE_MODES, FINER, MOST_CELLS = 4, 4, 512
MANY = 16
"""Samples whose mean is the truth of a few."""
LAWS = 8
"""Every so many scenes whose stiffness is read have laws."""
BANDS = ((2, 10), (1, 6), (2, 8), (3, 12), (2, 14))
CLASSES = (
    *("full", "turning", "pressing", "reading", "yielding", "wearing", "shearing"),
    *("harder", "sampled"),
)
OF_READING = "reading", "yielding", "harder", "sampled"
"""Classes that judge what is read off load steps, see `read_scene`."""
TWISTS = "few", "full", "lay", "honed", "steep", "smooth", "long", "units"
"""What is unusual about scenes of the class ``harder``: one to five contacts of a cell, nearly full
contact, ridges along one side, plateaus with grooves, slopes of 0.4 to 0.6, slopes below 1e-3,
sides 1 : 3 to 1 : 5 of odd numbers of cells, sides of 0.1 µm to 0.1 mm or 10 m to 10 km. Their
bodies insulate, so that gas conducts most of the heat."""
STEPS_OF_TRUTH = 4
OF_OTHERS = []
"""True over stated errors of contact area and mean gap, of the scenes that are not meshed."""
READ = {
    "force_N": "force_error_N",
    "approach_mm": "approach_error_mm",
    "contact_area_fraction": "contact_area_fraction_error",
    "mean_separation_mm": "mean_separation_error_mm",
    "interface_stiffness_N_per_mm": "interface_stiffness_error_N_per_mm",
    "approach_stiffness_N_per_mm": "approach_stiffness_error_N_per_mm",
    "thermal_conductance_W_per_K": "thermal_conductance_error_W_per_K",
    "electrical_conductance_S": "electrical_conductance_error_S",
    "leak_x_mm3_per_s": "leak_error_x_mm3_per_s",
    "leak_y_mm3_per_s": "leak_error_y_mm3_per_s",
    "shear_x_mm": "shear_error_mm",
    "shear_force_x_N": "shear_force_error_N",
    "worn_volume_mm3": "worn_volume_error_mm3",
    "worn_depth_mm": "worn_depth_error_mm",
}
ALIKE = "body", "coupling", "steps"
"""Causes of the error of a shear that its truth has, too."""
LEAKING, SHEARED = 1, 2
"""Scenes that read a leak, or a shift under a shear force: those that leave so much over threes."""
FRETTING, FACES, DISTANCES = 10, 3, 12
"""Scenes that wear: every so many by fretting, as many faces under laws; and into how many parts of
equal ratios the truth takes each distance."""
KINDS = ("concurrent", "concurrent", "analytic", "concurrent", "consistent", "concurrent")


def is_meshed(number):
    """Tell whether the truth of a scene is its meshed roughness."""
    return number % MESHED == 0 or number % STEEP == 0


def is_honed(number):
    """Tell whether a scene is plateau-honed."""
    return number % HONED == 1


def spectrum_of(number):
    """Return the spectrum of a scene's roughness."""
    random = np.random.default_rng(77_000 + number)
    band = BANDS[random.integers(3 if is_meshed(number) else len(BANDS))]
    slopes = (0.25, 0.6) if number % STEEP == 0 else (0.08, 0.25)
    return {
        "hurst": float(random.uniform(0.5, 1.0)),
        "waves": list(band),
        "rms_slope": float(random.uniform(*slopes)),
        "seed": 500 + number,
    }


def surface_of(number, count):
    """Return the surface of a scene on a grid of count × count heights."""
    spectrum = Spectrum(**spectrum_of(number) | {"waves": tuple(spectrum_of(number)["waves"])})
    surface = synthesise(spectrum, grid=(count, count), lengths=(1.0, 1.0))
    if not is_honed(number):
        return surface
    random = np.random.default_rng(78_000 + number)
    x, y, heights = surface.x[:, None], surface.y, np.array(surface.heights)
    level = float(random.uniform(0.0, 1.0)) * 5e-3  # of the plateau, which the summits lose
    worn = -2e-3 * np.logaddexp(0.0, (level - heights) / 2e-3)
    width = 0.35 / spectrum.waves[1]
    for angle in (32.0, -32.0):
        across = x * np.sin(np.radians(angle)) + y * np.cos(np.radians(angle))
        for at in random.uniform(-0.4, 1.3, 4):
            worn -= float(random.uniform(2e-3, 1e-2)) * np.exp(-(((across - at) / width) ** 2))
    return Surface(heights=worn, lengths=(1.0, 1.0))


def scene(number):
    """Return one scene of the study as nested dictionaries."""
    random = np.random.default_rng(79_000 + number)
    spectrum = spectrum_of(number)
    deepest = 9e-3 * max(1.0, spectrum["rms_slope"] / 0.25)
    load = {"approach": float(random.uniform(3e-3, deepest)), "steps": 2}
    if random.random() < 0.4:
        load["tilt"] = [float(random.uniform(-3e-3, 3e-3)) for _ in range(2)]
    kind = "concurrent" if is_meshed(number) else KINDS[random.integers(len(KINDS))]
    surface = {"lengths": [1.0, 1.0]}
    if is_honed(number):
        count = round(float(random.uniform(6.0, 10.0)) * spectrum["waves"][1])
        surface |= {"heights": surface_of(number, count).heights}
        load["approach"] = float(random.uniform(1e-3, 4e-3))
    else:
        count = int(random.choice([64, 96, 128]))
        surface |= {"spectrum": spectrum, "grid": [count, count]}
    return {
        "surface": surface,
        "block": {
            "young_modulus": 4000.0,
            "poisson_ratio": float(random.choice([0.15, 0.3])),
            "height": float(random.choice([0.3, 1.0, 1.0, 3.0])),
        },
        "micro": {"model": "half-space"},
        "coupling": {"kind": kind},
        "load": load,
    }


def meshed_force(data):
    """Return the force of the meshed roughness at the last load step, and its error bar [N]."""
    whole = data | {
        "surface": data["surface"] | {"grid": [192, 192]},
        "coupling": {"kind": "reference"},
        "load": data["load"] | {"steps": 1},
    }
    run = Run(Scene.from_dict(whole))
    list(run.load_steps())
    record = run.history().reference
    run.close()
    return float(record.force.value[-1]), float(record.force.error[-1])


def finer_contact(run, number):
    """Return the contact on more cells and with more modes, under the last load step's plane."""
    setup, step = run.coupling, run.steps[-1]
    terms = setup.bodies.terms(side_term=True) if setup.scene.has_body else None
    body = on_body(terms, setup.parts.materials, setup.parts.counter_surface, more_modes=MORE_MODES)
    surface = surface_of(number, min(FINER * setup.parts.micro.surface.grid[0], MOST_CELLS))
    model = replace(setup.parts.micro, surface=surface, highest=surface.highest)
    order = SLOPES if setup.parts.finite_slopes else 0
    return body(model, order).press(Control(approach=step.approach_mm, tilt=step.tilt))


def measured(numbers):
    """Run scenes; print and return rows of the true error, its uncertainty and the stated one."""
    rows = []
    for number in numbers:
        data, began = scene(number), time.perf_counter()
        run = Run(Scene.from_dict(data))
        list(run.load_steps())
        step, meshed = run.steps[-1], is_meshed(number)
        if not step.force_N > 0.0:
            print(f"{number:3d} no contact")
            continue
        parts = dict(step.errors)
        if meshed:
            try:
                true, bar = meshed_force(data)
            except InputError as error:
                print(f"{number:3d} is not meshed: {error}")
                continue
            stated = step.force_error_N
        else:
            contact = finer_contact(run, number)
            true, bar = contact.force, 0.0
            stated = step.force_error_N - parts["slopes"]
            OF_OTHERS.append(
                [
                    abs(step.contact_area_fraction - contact.contact_area_fraction)
                    / step.contact_area_fraction_error,
                    abs(step.mean_separation_mm - contact.mean_separation)
                    / step.mean_separation_error_mm,
                ]
            )
        rows.append((abs(step.force_N - true), bar, stated, meshed, true))
        told = ", ".join(f"{cause} {error / true:.2%}" for cause, error in parts.items())
        print(
            f"{number:3d} {data['coupling']['kind']:10s} {run.coupling.parts.surface.grid[0]:3d}² "
            f"{'honed ' * is_honed(number)}{'steep ' * (number % STEEP == 0)}height "
            f"{data['block']['height']:g}, {step.force_N:.4g} N: off by "
            f"{step.force_N / true - 1:+.2%} ± {bar / true:.2%}, stated {stated / true:.2%} "
            f"({told}) {time.perf_counter() - began:.0f} s{' meshed' if meshed else ''}",
            flush=True,
        )
    return np.array(rows)


def class_scene(kind, number):
    """Return one scene of a class as nested dictionaries, and how many steps a way it takes."""
    random = np.random.default_rng([CLASSES.index(kind), number])
    nu, slope = float(random.uniform(0.0, 0.45)), float(10 ** random.uniform(-2.5, -0.7))
    modulus, full = 4000.0 / (1.0 - nu**2), kind == "full"
    data = {
        "surface": {"grid": [32, 32], "lengths": [1.0, 1.0]},
        "block": {"young_modulus": 4000.0, "poisson_ratio": nu},
        "micro": {"model": "half-space"},
        "coupling": {
            "kind": str(random.choice(["analytic", "concurrent"])) if full else "analytic"
        },
        "output": {"check": "last", "figures": False, "report": False},
    }
    if data["coupling"]["kind"] == "concurrent":
        data["block"]["height"] = float(random.choice([0.5, 1.0, 3.0]))
    elif full and random.random() < 0.5:
        data["surface"]["periodic"] = True
    slope *= 0.3 if full else 1.0
    flat = full and random.random() < 0.25
    data["surface"]["spectrum"] = {
        "hurst": float(random.uniform(0.5, 1.0)),
        "waves": [1, int(random.integers(2, 6))],
        "rms_slope": 1e-3 * slope if flat else slope,
        "seed": int(random.integers(2**31)),
    }
    share = random.uniform(0.8, 4.0) if full else random.uniform(0.02, 0.2)
    steps = int(random.choice([1, 2, 4]))
    data["load"] = {"force": 0.5 * float(share) * slope * modulus, "steps": 1 if full else steps}
    if full:
        return data, 1
    data["friction"] = {"coefficient": float(10 ** random.uniform(-1.0, 0.0))}
    if kind == "pressing":
        data["friction"]["coupled"] = True
        data["load"] |= {"shear": [[1e-9, 0.0]], "shear_steps": 1}  # friction asks for some
        return data, steps
    legs = int(random.integers(2, 6))
    ways = np.cumsum(random.uniform(0.1, 2.1, legs)) + float(random.uniform(0.0, 6.3))
    lengths = random.uniform(0.1, 0.7, legs)
    points = np.cumsum(lengths[:, None] * np.stack([np.cos(ways), np.sin(ways)], axis=1), axis=0)
    slides, key = data["friction"]["coefficient"] * data["load"]["force"], "shear"
    if np.hypot(*points.T).max() < 0.95 and random.random() < 0.5:
        key = "shear_force"
    else:
        hardly = data["load"] | {"shear": [[1e-9, 0.0]], "shear_steps": 1}
        alone = data | {"load": hardly, "output": data["output"] | {"check": "none"}}
        slides *= 1.5 / last_step(alone).tangential_stiffness_N_per_mm
    data["load"] |= {key: (slides * points).tolist(), "shear_steps": int(random.integers(1, 4))}
    return data, data["load"]["shear_steps"]


def read_scene(kind, number):
    """Return one scene whose quantities are read, as nested dictionaries, drawn without rounding.

    Cells are 24² to 48² of 6 a wave and more, loads those that close 0.5 to 60 % of the face.
    """
    random, yields = np.random.default_rng([CLASSES.index(kind), number]), kind == "yielding"
    twist = TWISTS[number % len(TWISTS)] if kind == "harder" else None
    low, high = float(random.uniform(1.0, 3.0)), float(random.uniform(1.5, 4.0))
    cells = [int(count) for count in random.integers(24, 49, 2)]
    aspect, nu = float(random.uniform(0.6, 1.6)), float(random.uniform(0.0, 0.48))
    slope, young = float(10 ** random.uniform(-1.7, -0.6)), float(10 ** random.uniform(3.0, 5.6))
    modulus = young / (1.0 - nu**2)
    most = min(cells[0], cells[1] / aspect) / 6.0  # waves along x with 6 cells each, both ways
    kind = str(random.choice(["analytic", "concurrent", "periodic"]))
    if number % LAWS == 0 and not yields and not twist:
        kind = "consistent"
    data = {
        "surface": {
            "grid": cells,
            "lengths": [1.0, aspect],
            "spectrum": {
                "hurst": float(random.uniform(0.3, 1.0)),
                "waves": [low, min(low * high, max(most, 1.2 * low))],
                "rms_slope": slope,
                "seed": int(random.integers(2**31)),
            },
        },
        "block": {"young_modulus": young, "poisson_ratio": nu},
        "micro": {"model": "half-space"},
        "coupling": {"kind": kind},
        "conductance": {
            "conductivity": ["0.2 W/m/K" if twist else "50 W/m/K"], "resistivity": ["1.7e-7 ohm m"],
            "gas": "0.026 W/m/K", "temperature_jump": "0.4 um",
        },
        "output": {"check": "last", "figures": False, "report": False},
    }  # fmt: skip
    if kind == "periodic":
        data["surface"]["periodic"], data["coupling"]["kind"] = True, "analytic"
    elif kind != "analytic":
        data["block"]["height"] = float(10 ** random.uniform(-0.5, 0.5))
    share = float(random.choice([10 ** random.uniform(-2.3, -0.3), random.uniform(0.05, 0.6)]))
    if twist:
        share = twisted(data, twist, random, share)
        cells, lengths = data["surface"]["grid"], data["surface"]["lengths"]
        slope, aspect = data["surface"]["spectrum"]["rms_slope"], lengths[0] * lengths[1]
    force = 0.5 * share * slope * modulus * aspect
    if kind != "consistent" and random.random() < (1.0 if yields else 0.4):
        data["micro"]["hardness"] = float(random.uniform(0.3, 1.0)) * slope * modulus
    data["load"] = {"force": force, "steps": int(random.choice([1, 3]))}
    sheared = number % 3 == SHEARED and kind != "consistent" and "hardness" not in data["micro"]
    quiet = data | {"output": data["output"] | {"check": "none"}}
    if sheared:
        coefficient, slides = float(random.uniform(0.1, 0.8)), float(random.uniform(0.2, 1.2))
        data["friction"], key = {"coefficient": coefficient}, "shear_force"
        if twist:  # coupled truths take minutes
            data["friction"]["coupled"] = False
        slides *= coefficient * force
        if slides > 0.9 * coefficient * force or random.random() < 0.5:
            key, hardly = "shear", data["load"] | {"shear": [[1e-9, 0.0]], "shear_steps": 1}
            step = last_step(quiet | {"friction": data["friction"], "load": hardly})
            slides *= 1.5 / step.tangential_stiffness_N_per_mm
        data["load"] |= {key: [[slides, 0.0]], "shear_steps": 2}
    elif random.random() < 0.4:  # the plane that this force would take
        data["load"] = {"approach": last_step(quiet).approach_mm, "steps": 2}
    if number % 3 == LEAKING or twist:
        data["leak"] = {"viscosity": "1 mPa s", "pressures": ["2 bar", "1 bar"]}
        data["leak"]["direction"] = "both" if twist else "x"
    if twist == "honed":
        data["surface"] = honed(data["surface"])
    return data


def sampled_scene(number):
    """Return one scene of a block under laws of samples, and the same of the mean of many.

    There are 2 to 5 samples of 24² to 32² cells, in truth others, on twice as many cells a side.
    Loads are forces, and approaches not judged: they count from the highest of the samples.
    """
    random = np.random.default_rng([CLASSES.index("sampled"), number])
    data = read_scene("sampled", number)
    surface, sides = data["surface"], [float(one) for one in random.uniform(4.0, 9.0, 2)]
    for key in ("friction", "leak"):
        data.pop(key, None)
    count, seed = int(random.integers(2, 6)), int(random.integers(2**30))
    cells = int(random.integers(24, 33))
    surface |= {"grid": [cells, cells], "lengths": [1.0, 1.0]}
    surface.pop("periodic", None)
    low = float(random.uniform(1.0, 1.5))
    surface["spectrum"]["waves"] = [low, cells / float(random.uniform(6.0, 10.0))]
    slope, nu = surface["spectrum"]["rms_slope"], data["block"]["poisson_ratio"]
    modulus = data["block"]["young_modulus"] / (1.0 - nu**2)
    share = float(10 ** random.uniform(-1.7, -0.4))
    force = 0.5 * share * slope * modulus * sides[0] * sides[1]
    if "hardness" in data["micro"]:
        data["micro"]["hardness"] = float(random.uniform(0.3, 1.0)) * slope * modulus
        del data["conductance"]
    height = float(random.uniform(2.0, 6.0))
    data["block"] |= {"lengths": sides, "height": height, "cells": [2, 2, 2]}
    data["coupling"] = {"table_tolerance": 0.01}
    data["load"] = {"force": force, "steps": 1}
    data["law"] = {"kind": "representative", "seeds": list(range(seed, seed + count))}
    if random.random() < 0.4:
        data["friction"] = {"coefficient": float(random.uniform(0.1, 0.8))}
        shear = float(random.uniform(0.2, 0.8)) * data["friction"]["coefficient"] * force
        data["load"] |= {"shear_force": [[shear, 0.0]], "shear_steps": 2}
    many = {"kind": "representative", "seeds": list(range(seed + count, seed + count + MANY))}
    return data, finer_surface(data, 2) | {"law": many}


def twisted(data, twist, random, share):
    """Make a scene unusual, see `TWISTS`; return the share of the face that its load closes."""
    surface, block = data["surface"], data["block"]
    spectrum, cells = surface["spectrum"], surface["grid"]
    if twist == "few":
        return float(random.uniform(1.0, 5.0)) / (cells[0] * cells[1])
    if twist == "full":
        spectrum["rms_slope"] *= 0.1
        return float(random.uniform(0.8, 4.0))
    if twist == "lay":
        along, across = sorted(random.uniform(1.0, 3.0, 2)), [2.0, min(cells) / 6.0]
        ways = ("waves_x", "waves_y") if random.random() < 0.5 else ("waves_y", "waves_x")
        surface["lengths"] = [1.0, 1.0]
        del spectrum["waves"]
        spectrum |= {ways[0]: [float(one) for one in along], ways[1]: across}
    elif twist == "steep":
        spectrum["rms_slope"] = float(random.uniform(0.4, 0.6))
    elif twist == "smooth":
        spectrum["rms_slope"] = float(10 ** random.uniform(-6.0, -3.0))
    elif twist == "long":
        cells[:] = [int(one) for one in 2 * random.integers([8, 24], [13, 33]) + 1]
        lengths = surface["lengths"] = [1.0, float(random.uniform(3.0, 5.0))]
        if random.random() < 0.5:
            cells.reverse()
            lengths.reverse()
        most = min(cells[0], cells[1] * lengths[0] / lengths[1]) / 6.0
        spectrum["waves"] = [min(lengths[0], 0.8 * most), most]
    elif twist == "units":
        size = float(10 ** random.choice([random.uniform(-4, -1), random.uniform(4, 7)]))
        surface["lengths"] = [size * one for one in surface["lengths"]]
        if "height" in block:
            block["height"] *= size
        data["conductance"]["temperature_jump"] = f"{0.4 * size!r} um"
    return share


def honed(surface):
    """Return a surface whose summits are worn to a plateau and that is grooved, on its cells.

    Args:
        surface: The surface as a section of a scene, with spectrum and grid.
    """
    about = surface["spectrum"] | {"waves": tuple(surface["spectrum"]["waves"])}
    made = synthesise(Spectrum(**about), grid=surface["grid"], lengths=surface["lengths"])
    random, x, y = np.random.default_rng(about["seed"]), made.x[:, None], made.y
    rms = float(np.std(made.heights))
    level = float(random.uniform(0.0, 1.0)) * rms
    heights = made.heights - 0.1 * rms * np.logaddexp(0.0, (made.heights - level) / (0.1 * rms))
    width = 3.0 * max(
        one / count for one, count in zip(surface["lengths"], surface["grid"], strict=True)
    )
    for angle in (32.0, -32.0):
        across = x * np.sin(np.radians(angle)) + y * np.cos(np.radians(angle))
        for at in random.uniform(-0.4, 1.3, 3):
            heights -= (
                float(random.uniform(0.5, 3.0)) * rms * np.exp(-(((across - at) / width) ** 2))
            )
    kept = {key: surface[key] for key in ("lengths", "periodic") if key in surface}
    return kept | {"heights": heights}


def finer_surface(data, times):
    """Return the changes of a scene that make its surface the same on more cells."""
    surface = data["surface"]
    if "heights" in surface:
        cells = [times * count for count in surface["heights"].shape]
        return {"micro": data["micro"] | {"cells": cells}}
    return {"surface": surface | {"grid": [times * count for count in surface["grid"]]}}


def worn_scene(number):
    """Return one scene that wears as nested dictionaries, and the same much finer.

    The mean worn depth is 0.02 to 5 times the rms height of the roughness.
    """
    random = np.random.default_rng([CLASSES.index("wearing"), number])
    data = read_scene("yielding", number)  # cells, no laws
    del data["conductance"]
    data.pop("leak", None)
    data["surface"]["grid"] = [max(count // 2, 16) for count in data["surface"]["grid"]]
    face = number % FRETTING != 0 and random.random() < 1.0 / FACES
    if face or random.random() < 0.7:
        data["micro"].pop("hardness", None)
    surface = Run(Scene.from_dict(data)).coupling.parts.surface
    lengths, rms = surface.lengths, float(np.std(surface.heights))
    shape = data["surface"]
    force = data["load"].get("force") or last_step(data).force_N
    depth = rms * float(10 ** random.uniform(-1.7, 0.7))
    data["wear"] = {"coefficient": 1e-8}
    slid = depth * float(np.prod(lengths)) / (1e-8 * force)
    finer = {"surface": shape | {"grid": [2 * count for count in shape["grid"]]}}
    if number % FRETTING == 0:
        data["friction"] = {"coefficient": float(random.uniform(0.1, 0.8)), "coupled": False}
        hardly = {"force": force, "shear": [[1e-9, 0.0]], "shear_steps": 1}
        stiffness = last_step(data | {"load": hardly}).tangential_stiffness_N_per_mm
        way = float(random.uniform(0.4, 1.5)) * data["friction"]["coefficient"] * force / stiffness
        data["wear"] = {"coefficient": depth * float(np.prod(lengths)) / (force * way)}
        data["load"] = {"force": force, "shear": [[way, 0.0], [-way, 0.0]], "shear_steps": 3}
        finer["load"] = data["load"] | {"shear_steps": 12}
        return data, finer
    distances = [slid * float(random.uniform(0.03, 0.3)), slid]
    if face:
        sides, cells = [float(one) for one in random.uniform(4.0, 9.0, 2)], [3, 3, 2]
        force *= float(np.prod(sides) / np.prod(lengths))
        data["block"] |= {"lengths": sides, "height": float(random.uniform(2.0, 6.0))}
        data["block"]["cells"] = cells
        data["law"], data["coupling"] = {"kind": "representative"}, {"table_tolerance": 0.01}
        data["surface"].pop("periodic", None)
        data["load"] = {"force": force, "steps": 1}
        finer["block"] = data["block"] | {"cells": [4 * count for count in cells]}
    data["load"] = data["load"] | {"steps": 1}
    if random.random() < 0.4 and not data["surface"].get("periodic"):
        turn = (0.3 if face else 0.5) * rms / max(lengths)
        data["load"]["tilt"] = [float(one) for one in random.uniform(-turn, turn, 2)]
    if random.random() < 0.4:
        alone = data | {"load": data["load"] | {"sliding": distances[:1]}}
        del alone["load"]["sliding"], alone["wear"]
        held = {"approach": last_step(alone).approach_mm}
        data["load"] = {k: v for k, v in data["load"].items() if k not in ("force", "approach")}
        data["load"] |= held
    parts = [one * 10 ** np.linspace(-3.0, 0.0, DISTANCES) for one in distances]
    every = np.unique(np.concatenate(parts))
    finer["load"] = data["load"] | {"sliding": [float(one) for one in every]}
    data["load"] = data["load"] | {"sliding": distances}
    return data, finer


def shear_scene(number):
    """Return one scene that is sheared on one to three legs, and their number."""
    random = np.random.default_rng([60, number])
    cells = [int(count) for count in random.integers(16, 25, 2)]
    aspect, nu = float(random.uniform(0.7, 1.4)), float(random.uniform(0.0, 0.45))
    slope, low = float(10 ** random.uniform(-2.0, -0.7)), float(random.uniform(1.0, 1.6))
    most, periodic = min(cells[0], cells[1] / aspect) / 6.0, bool(random.random() < 0.3)
    spectrum = {
        "hurst": float(random.uniform(0.4, 1.0)),
        "waves": [low, max(most, 1.3 * low)],
        "rms_slope": slope,
        "seed": int(random.integers(2**31)),
    }
    surface = {"grid": cells, "lengths": [1.0, aspect], "spectrum": spectrum}
    share = float(10 ** random.uniform(-1.7, -0.4))
    force = 0.5 * share * slope * 4000.0 / (1.0 - nu**2) * aspect
    coefficient, load = float(10 ** random.uniform(-1.0, 0.0)), {"force": force, "steps": 1}
    data = {
        "surface": surface | ({"periodic": True} if periodic else {}),
        "block": {"young_modulus": 4000.0, "poisson_ratio": nu},
        "micro": {"model": "half-space"},
        "coupling": {"kind": "analytic"},
        "output": {"check": "last", "figures": False, "report": False},
        "friction": {"coefficient": coefficient, "coupled": False},
    }
    legs = int(random.integers(1, 4))
    ways = np.cumsum(random.uniform(0.1, 2.1, legs)) + float(random.uniform(0.0, 6.3))
    lengths = random.uniform(0.15, 0.8, legs)
    points = np.cumsum(lengths[:, None] * np.stack([np.cos(ways), np.sin(ways)], axis=1), axis=0)
    key, slides = "shear_force", coefficient * force
    if np.hypot(*points.T).max() >= 0.9 or random.random() >= 0.5:
        key, hardly = "shear", load | {"shear": [[1e-9, 0.0]], "shear_steps": 1}
        quiet = data | {"load": hardly, "output": data["output"] | {"check": "none"}}
        slides *= 1.5 / last_step(quiet).tangential_stiffness_N_per_mm
    data["load"] = load | {
        key: (slides * points).tolist(),
        "shear_steps": int(random.integers(1, 4)),
    }
    return data, legs


def judged_shear(number):
    """Shear one scene; print it, and return its true and stated error and the size."""
    data, legs = shear_scene(number)
    surface, load = data["surface"], data["load"]
    finer = data | {
        "surface": surface | {"grid": [FINER * count for count in surface["grid"]]},
        "output": data["output"] | {"check": "none"},
        "load": load | {"shear_steps": load["shear_steps"] * (STEPS_OF_TRUTH if legs > 1 else 1)},
    }
    step, true = last_step(data), last_step(finer)
    name, unit = ("shear_force", "N") if "shear" in load else ("shear", "mm")
    own, exact = (
        np.array([getattr(one, f"{name}_{axis}_{unit}") for axis in "xy"]) for one in (step, true)
    )
    parts = {cause: e for cause, e in step.shear_errors if cause not in ("body", "coupling")}
    off, stated, size = np.hypot(*(own - exact)), sum(parts.values()), np.hypot(*exact)
    told = ", ".join(f"{cause} {error / size:.2%}" for cause, error in parts.items())
    print(
        f"{number:3d} {name} {surface['grid']} {step.contact_area_fraction:.0%} in contact, {legs} "
        f"legs of {load['shear_steps']}: off by {off / size:.2%}, stated {stated / size:.2%}"
        f"{' MISSED' * bool(off > 1.5 * stated)} ({told})",
        flush=True,
    )
    return off, 0.0, stated


def last_step(data):
    """Return the last load step of a scene."""
    *_, step = Run(Scene.from_dict(data)).load_steps()
    return step


def of_class(kind, numbers):
    """Run scenes of a class; print and return true errors and stated ones, by quantity."""
    found = {}
    reads = kind in (*OF_READING, "wearing")
    if reads:  # what the truth has in common with the run
        _Problems.slopes_error = lambda self: np.zeros(3)
        _Problems.body_error = lambda self: {}
    if kind == "sampled":
        LawErrorProbe.discretisation = lambda self: 2 * (np.zeros_like(self.answer),)
        LawErrorProbe._at_edges = lambda self, _: np.zeros_like(self.state.sample_pressure)
    if kind == "shearing":
        tell(np.array([judged_shear(number) for number in numbers]), "shearing")
        return
    for number in numbers:
        began, steps = time.perf_counter(), 1
        try:
            if kind in ("wearing", "sampled"):
                data, other = (worn_scene if kind == "wearing" else sampled_scene)(number)
                finer = data | other
            else:
                data, steps = (read_scene(kind, number), 1) if reads else class_scene(kind, number)
                times = 4 if reads or kind == "full" else 2
                finer = data | finer_surface(data, times)
            finer["output"] = data["output"] | {"check": "none"}
            coupling = data["coupling"].get("kind", "representative")
            if reads and coupling == "consistent":
                finer["coupling"] = {"kind": "concurrent"}
            if not reads and kind != "full":
                every = "shear_steps" if kind == "turning" else "steps"
                finer["load"] = data["load"] | {every: STEPS_OF_TRUTH * steps}
                finer["friction"] = data["friction"] | {"coupled": True}
            step, true = last_step(data), last_step(finer)
        except (NotConverged, InputError) as error:  # such as a load that a hardness cannot bear
            print(f"{number:3d} has no solution: {error}", flush=True)
            continue
        told = []
        for name, off, stated, size in quantities(kind, step, true):
            missed = bool(off > 1.5 * stated)
            found.setdefault(name, []).append((off, 0.0, stated))
            told.append(
                f"{name} off by {off / size:.2%}, stated {stated / size:.2%}{' MISSED' * missed}"
            )
        causes = ", ".join(
            f"{cause} {error:.2g}" for cause, error in (*step.errors, *step.shear_errors)
        )
        print(
            f"{number:3d} {kind} {coupling} {step.contact_area_fraction:.0%} in "
            f"contact, {steps} steps: {'; '.join(told)} ({causes}) "
            f"{time.perf_counter() - began:.0f} s",
            flush=True,
        )
    for name, rows in found.items():
        tell(np.array(rows), f"{kind}, {name}")


def quantities(kind, step, true):
    """Yield name, true error, stated error and size of what a class is judged by."""
    if kind in (*OF_READING, "wearing"):
        for name, error in READ.items():
            values, known = [getattr(one, name) for one in (step, true)], getattr(step, error)
            prescribed = known == 0.0 and "stiffness" not in name
            prescribed |= kind == "sampled" and name == "approach_mm"  # and their zero is another
            if values == [None, None] or prescribed:
                continue
            off = np.inf if None in values else abs(values[0] - values[1])
            if name.startswith("shear") and known is not None:
                known = sum(error for cause, error in step.shear_errors if cause not in ALIKE)
            yield name, off, np.inf if known is None else known, abs(values[1] or 1.0)
        return
    parts = dict(step.errors)
    alike = sum(parts.get(cause, 0.0) for cause in ("body", "slopes"))
    kept = 1.0 - alike / sum(parts.values()) if alike else 1.0
    known = step.approach_error_mm
    yield (
        "approach",
        abs(step.approach_mm - true.approach_mm),
        np.inf if known is None else kept * known,
        step.approach_mm,
    )
    if kind == "full":
        return
    force, shift = (
        np.array([[getattr(one, f"{name}_{axis}_{unit}") for axis in "xy"] for one in (step, true)])
        for name, unit in (("shear_force", "N"), ("shear", "mm"))
    )
    if kind == "turning":
        stated = sum(error for cause, error in step.shear_errors if cause != "body")
        pair = shift if step.shear_force_error_N == 0.0 else force
        yield "shear", np.hypot(*(pair[0] - pair[1])), stated, np.hypot(*pair[0])
    for name, error in (("dissipated_mJ", "dissipated_error_mJ"),
                        ("slip_area_fraction", "slip_area_error")):  # fmt: skip
        values, known = [getattr(one, name) for one in (step, true)], getattr(step, error)
        size = max(values) or 1.0
        yield name, abs(values[0] - values[1]), np.inf if known is None else known, size


def tell(rows, what):
    """Print how stated errors compare with true ones."""
    off, bar, stated = rows[:, :3].T
    known = np.isfinite(stated)
    off, bar, stated = off[known], bar[known], stated[known]
    within = off - bar <= 1.5 * stated
    share = np.divide(off, stated, out=np.where(off > 0.0, np.inf, 0.0), where=stated > 0.0)
    print(
        f"{what}: {within.sum()} of {len(off)} scenes, {len(rows) - len(off)} without error; true "
        f"error within 1.5 × the stated one: {within.mean():.0%}; stated over true in the median: "
        f"{1.0 / max(np.median(share), 1e-12):.2f}; true over stated at most: {share.max():.2f}"
    )


def accuracies(numbers):
    """Ask for an accuracy; print and return what was asked for, found, and whether it was kept."""
    rows = []
    for number in numbers:
        data, began = scene(number), time.perf_counter()
        if is_honed(number):
            continue  # maps are not refined: an accuracy asks for a spectrum
        random = np.random.default_rng(number)
        wanted = float(random.choice([0.01, 0.02, 0.05]))
        asked = {key: value for key, value in data.items() if key not in ("micro", "coupling")}
        asked |= {"accuracy": wanted, "surface": data["surface"] | {"grid": None}}
        run = Run(Scene.from_dict(asked))
        list(run.load_steps())
        step, kind = run.steps[-1], run.scene.coupling.kind
        own = time.perf_counter() - began
        if not step.force_N > 0.0:
            continue
        if is_meshed(number):
            true, bar = meshed_force(data)
        elif kind != "reference":
            true, bar = finer_contact(run, number).force, 0.0
        else:
            continue
        off, decision = step.force_N / true - 1.0, run.scene.decision
        rows.append((wanted, off, bar / true))
        print(
            f"{number:3d} {kind:10s} {decision.taken}: asked {wanted:.0%}, off by "
            f"{off:+.2%} ± {bar / true:.2%}, promised {decision.error:.2%}, "
            f"{own:.0f} s "
            f"and {time.perf_counter() - began - own:.0f} s for the truth",
            flush=True,
        )
    return np.array(rows)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("what", nargs="*", default=["measured", "accuracy"])
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--last", type=int, default=SCENES)
    parser.add_argument("--every", type=int, default=1, help="of laws of patches among reading: 8")
    given = parser.parse_args()
    numbers = range(given.first, given.last, given.every)
    if "measured" in given.what:
        rows = measured(numbers)
        tell(rows, "all")
        for name, kind in (("against meshed roughness", 1), ("against finer cells", 0)):
            if (rows[:, 3] == kind).any():
                tell(rows[rows[:, 3] == kind], name)
        of_others = np.transpose(OF_OTHERS) if OF_OTHERS else ()  # of meshed scenes alone: none
        for name, ratios in zip(("contact area", "mean gap"), of_others, strict=False):
            print(
                f"{name}: true within 1.5 × stated in {np.mean(ratios <= 1.5):.0%} of "
                f"{len(ratios)}, {np.median(ratios):.2f} of it in the median"
            )
    for kind in CLASSES:
        if kind in given.what:
            of_class(kind, numbers)
    if "accuracy" in given.what:
        rows = accuracies(numbers)
        kept = np.abs(rows[:, 1]) - rows[:, 2] <= rows[:, 0]
        print(f"accuracy kept by {kept.mean():.0%} of {len(rows)} scenes")


if __name__ == "__main__":
    main()
