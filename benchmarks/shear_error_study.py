"""Are the errors of the shear that runs state those that they have?

    .venv/bin/python benchmarks/shear_error_study.py [--scenes N] [--seed S]
        [--laws | --samples | --normal | --steps]

Scenes are drawn anew for every seed: rough half-spaces and blocks on 48² or 64² cells, with any
Poisson's ratio up to 0.45 and a coefficient of friction from 0.1 to 0.8, pressed to 1 to 15 %
contact area by a force or an approach, then sheared on one or two legs, by a shift or a shear
force. The errors by grid and body are judged by the same run on four times as many cells a side.
Every second scene is also judged with what the coupling changes, by a coupled run on twice as many
cells.

With ``--laws`` the scenes have patch laws on 48² cells (consistent or isolated, 1 to 4 × 4
patches), and are judged by coupled cells on the block, on twice as many a side. With ``--samples``
a law of a sample on 16² cells stands for a face of 4 × 4 of them on a block, which is judged by
coupled cells on 24² of every sample, with the edges at any place of the sample. With ``--normal``
such faces are pressed without friction. With ``--steps`` half-spaces of 24² cells are sheared on
circles, around corners, along with the load or, coupled, while and after they are pressed, in few
steps; the errors by steps of shear, energy lost and area that slips are judged by smaller steps on
the same cells. Run it from the project's root.
"""

import argparse
import os
import tempfile
import time
from functools import cache
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

from patchlaw import NotConverged
from patchlaw.geometry import Spectrum, synthesise
from patchlaw.multiscale import Run, Scene, run
from patchlaw.multiscale.models.measured_errors.shear import (
    error_by_steps,
    gone,
    parted_path,
    parts_of,
)

FINER, COUPLED_ON, TILES = 4, 2, 4
"""Cells a side of the runs that judge, over those of the scene, and samples along a face."""
BLOCK = {"young_modulus": 4000.0}
BY_STEPS, CELLS = ("shear", "energy", "area that slips"), 24
ALLOWED = 1.5
"""True errors over stated ones that count as kept."""


def scene_of(random, kind):
    """Return one scene as nested dictionaries, without its shear, and how it will be sheared."""
    slope, waves = float(random.uniform(0.05, 0.2)), (2, int(random.integers(4, 9)))
    nu, mu = float(random.uniform(0.0, 0.45)), float(random.uniform(0.1, 0.8))
    modulus, area = BLOCK["young_modulus"] / (1.0 - nu**2), float(random.uniform(0.01, 0.15))
    laws, samples = kind == "laws", kind in ("samples", "normal")
    kinds = ("consistent", "isolated") if laws else ("analytic", "concurrent")
    coupling = str(random.choice(kinds))
    cells = 48 if laws else int(random.choice([48, 64]))
    if samples:
        cells, waves = 16, (1, int(random.integers(2, 4)))
    spectrum = {
        "hurst": float(random.uniform(0.5, 1.0)),
        "waves": list(waves),
        "rms_slope": slope,
        "seed": int(random.integers(2**31)),
    }
    data = {
        "surface": {"spectrum": spectrum, "grid": [cells, cells], "lengths": [1.0, 1.0]},
        "block": BLOCK | {"poisson_ratio": nu, "height": float(random.choice([0.5, 1.0, 3.0]))},
        "micro": {"model": "half-space"},
        "coupling": {"kind": coupling},
        "friction": {"coefficient": mu, "coupled": False},
        "load": {"force": 0.5 * area * slope * modulus, "steps": 1},
        "output": {"check": "last", "figures": False, "report": False},
    }
    patches = int(random.choice([1, 2, 4]))
    if laws:
        data["patches"] = {"grid": [patches, patches]}
        data["block"]["cells"] = [8, 8, 6]
    if samples:
        del data["coupling"]
        data["law"] = {"kind": "representative"}
        data["surface"]["periodic"] = True
        data["block"] |= {"lengths": [float(TILES)] * 2, "cells": [8, 8, 5]}
        data["load"]["force"] *= TILES**2
    legs = [float(random.uniform(0.2, 0.95)), float(random.uniform(-0.9, 0.9))]
    turns = np.radians([float(random.uniform(0, 360)), float(random.choice([0.0, 0.0, 90.0]))])
    ways = np.cumsum(turns)[: 1 + int(random.integers(2))]
    by_force, by_approach = random.random() < 0.4, random.random() < 0.3
    points = np.stack([np.cos(ways), np.sin(ways)], axis=1) * np.array(legs)[: len(ways), None]
    return data, points, by_force, by_approach


def sheared(data, points, *, by_force, by_approach):
    """Return the scene with its shear, in parts of what slides."""
    hardly = data["load"] | {"shear": [1e-9, 0.0], "shear_steps": 1}
    alone = data | {"load": hardly, "output": data["output"] | {"check": "none"}}
    pressed = run(Scene.from_dict(alone)).steps[-1]
    slides = data["friction"]["coefficient"] * pressed.force_N
    load = dict(data["load"])
    if by_approach:
        load = {"approach": pressed.approach_mm, "steps": 1}
    if not by_force:
        slides *= 1.5 / pressed.tangential_stiffness_N_per_mm
    key = "shear_force" if by_force else "shear"
    load |= {key: (slides * points).tolist(), "shear_steps": 2}
    return data | {"load": load}


def finer(data, cells, **changes):
    """Return the last load step of a scene on other cells, with some changes."""
    surface = data["surface"] | {"grid": [cells] * 2}
    output = data["output"] | {"check": "none"}
    return run(Scene.from_dict(data | {"surface": surface, "output": output} | changes)).steps[-1]


def on_cells_of_face(data, cells, place):
    """Return the last load step of a face of samples, each on some cells, pressures coupled."""
    said = dict(data["surface"]["spectrum"])
    heights = synthesise(Spectrum(**said), grid=(cells, cells), lengths=(1.0, 1.0)).heights
    heights = np.roll(heights, place, axis=(0, 1))
    alike = {key: data[key] for key in ("micro", "load")} | {"coupling": {"kind": "concurrent"}}
    if "friction" in data:
        alike["friction"] = data["friction"] | {"coupled": True}
    block = {key: data["block"][key] for key in ("young_modulus", "poisson_ratio", "height")}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "face.npy"
        np.save(path, np.tile(heights, (TILES, TILES)))
        surface = {"file": str(path), "height_unit": "mm", "lengths": [float(TILES)] * 2}
        face = {"surface": surface, "block": block, "output": data["output"] | {"check": "none"}}
        return run(Scene.from_dict(alike | face)).steps[-1]


def judged_without_friction(number, random):
    """Press a face of samples without friction; print it, and return its true and stated error."""
    data, *_ = scene_of(random, "normal")
    del data["friction"]
    step = run(Scene.from_dict(data)).steps[-1]
    cells = 3 * data["surface"]["grid"][0] // 2
    place = tuple(random.integers(0, cells, 2).tolist())
    off = abs(on_cells_of_face(data, cells, place).approach_mm - step.approach_mm)
    stated, whole = step.approach_error_mm, sum(error for _, error in step.errors)
    told = ", ".join(
        f"{cause} {error / whole * stated / step.approach_mm:.2%}" for cause, error in step.errors
    )
    nu, size, missed = data["block"]["poisson_ratio"], step.approach_mm, off > ALLOWED * stated
    print(
        f"{number:3d} ν {nu:.2f}: approach {off / size:.2%} off, {stated / size:.2%} stated: "
        f"{told}{' MISSED' * missed}",
        flush=True,
    )
    return {"normal": (off, stated)}


def stepped_scene(random):
    """Return a scene of few load steps as nested dictionaries."""
    data, *_ = scene_of(random, "cells")
    data["surface"]["grid"], data["coupling"] = [CELLS] * 2, {"kind": "analytic"}
    data["micro"]["finite_slopes"] = False
    data["output"]["check"] = "none"
    kind = str(random.choice(["circle", "corners", "along", "pressed", "pressed along"]))
    data["friction"]["coupled"] = "pressed" in kind
    size, turn = float(random.uniform(0.2, 0.9)), float(random.uniform(0.0, 2.0 * np.pi))
    count = int(random.integers(1, 4))
    ways = [0.0, *random.uniform(0.0, 2.0 * np.pi, count - 1)]
    ways = turn + (2.0 * np.pi / 16 * np.arange(17) if kind == "circle" else np.array(ways))
    points = size * np.stack([np.cos(ways), np.sin(ways)], axis=1)
    pressed = sheared(data, points, by_force=random.random() < 0.4, by_approach=False)["load"]
    loads = pressed | {
        "steps": int(random.integers(1, 4)),
        "shear_steps": int(random.integers(1, 4)),
    }
    if kind == "circle":
        loads["shear_steps"] = 1
    if "along" in kind:
        del loads["shear_steps"]
        last = np.append(random.uniform(0.4, 1.0, count - 1), 1.0)
        loads |= {"shear_path": "along", "force": (loads["force"] * last).tolist()}
        key = "shear" if "shear" in loads else "shear_force"
        loads[key] = (np.array(loads[key]) * last[:, None]).tolist()
    return data | {"load": loads}, kind


def judged_by_steps(number, random):
    """Go a path in few load steps; print and return true and stated errors by the steps."""
    data, kind = stepped_scene(random)
    whole = Run(Scene.from_dict(data))
    list(whole.load_steps())
    coupling, steps = whole.coupling, whole.steps
    friction, model = coupling.friction_model, coupling.parts.micro

    @cache
    def end(times):
        state, shear = gone(model, friction, parted_path(steps, [times] * len(steps)))
        slips = shear.slipping.sum() / shear.closed.sum() * state.contact_area_fraction
        return np.array(
            [*(shear.force if steps[-1].by_shift else shear.shift), shear.dissipated, slips]
        )

    def apart(one, other):
        x, y, lost, slips = one - other
        return np.abs([np.hypot(x, y), lost, slips])

    parts = parts_of(len(steps))
    stated = error_by_steps(lambda each: end(each[0]), end(1), [parts] * len(steps), apart)
    stated[2] = max(stated[2], 2.0 / CELLS**2)
    exact = 2.0 * end(2 * parts) - end(parts)  # errors are of first order at last
    off, sizes = apart(exact, end(1)), np.maximum(apart(exact, np.zeros(4)), 1e-12)
    told = ", ".join(
        f"{name} {one:.2%} ({error:.2%} stated)"
        for name, one, error in zip(BY_STEPS, off / sizes, stated / sizes, strict=True)
    )
    missed = [name for name, one, error in zip(BY_STEPS, off, stated, strict=True)
              if one > ALLOWED * error]  # fmt: skip
    print(f"{number:3d} {kind}, {len(steps)} steps: {told} {'MISSED ' * bool(missed)}"
          f"{', '.join(missed)}", flush=True)  # fmt: skip
    return dict(zip(BY_STEPS, zip(off, stated, strict=True), strict=True))


def of(step, by_force):
    names = ("shear_x_mm", "shear_y_mm") if by_force else ("shear_force_x_N", "shear_force_y_N")
    return np.array([getattr(step, name) for name in names])


def judged(number, random, kind):
    """Run one scene; print it, and return true and stated error by what it is judged by."""
    began = time.perf_counter()
    data, points, by_force, by_approach = scene_of(random, kind)
    how = {"by_force": by_force, "by_approach": by_approach}
    data = sheared(data, points, **how)
    step = run(Scene.from_dict(data)).steps[-1]
    own, parts = of(step, by_force), dict(step.shear_errors)
    cells, size = data["surface"]["grid"][0], float(np.hypot(*own))
    rows = {}
    if kind == "cells":
        exact = of(finer(data, FINER * cells), by_force)
        stated = sum(error for cause, error in parts.items() if cause != "coupling")
        rows["cells"] = float(np.hypot(*(exact - own))), stated
    if kind != "cells" or number % 2 == 0:
        on = {"friction": data["friction"] | {"coupled": True}}
        if kind == "laws":
            on["coupling"] = {"kind": "concurrent"}
        if kind == "samples":
            place = tuple(random.integers(0, 3 * cells // 2, 2).tolist())
            exact = on_cells_of_face(data, 3 * cells // 2, place)
            by_load = not by_approach
            name = "approach_mm" if by_load else "force_N"
            off = abs(getattr(exact, name) - getattr(step, name))
            stated = step.approach_error_mm if by_load else step.force_error_N
            rows["normal"] = off, stated
        else:
            exact = finer(data, COUPLED_ON * cells, **on)
        off = float(np.hypot(*(of(exact, by_force) - own)))
        rows["coupling"] = off, sum(parts.values())
    told = ", ".join(f"{cause} {error / size:.2%}" for cause, error in parts.items())
    if "normal" in rows:
        off, stated = (one / getattr(step, name) for one in rows["normal"])
        told += f" ({name[:-3].strip('_')} {off:.2%} off, {stated:.2%} stated)"
    found = "; ".join(f"{name} {off / size:.2%}" for name, (off, _) in rows.items()
                      if name != "normal")  # fmt: skip
    step_kind = data.get("coupling", data.get("law"))["kind"]
    nu, mu = data["block"]["poisson_ratio"], data["friction"]["coefficient"]
    load = f"{'force' if by_force else 'shift'}{', approach' * by_approach}"
    missed = any(off > ALLOWED * stated for off, stated in rows.values())
    print(
        f"{number:3d} {step_kind:10s} {cells}² ν {nu:.2f} µ {mu:.2f} "
        f"{len(points)} legs, {load}: true {found}; stated {told} "
        f"({time.perf_counter() - began:.0f} s){' MISSED' * missed}",
        flush=True,
    )
    return rows


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--scenes", type=int, default=60)
    parser.add_argument("--seed", type=int, default=0)
    others = parser.add_mutually_exclusive_group()
    others.add_argument("--laws", action="store_true", help="patch laws in place of cells")
    others.add_argument("--samples", action="store_true", help="laws of samples in place of cells")
    others.add_argument("--steps", action="store_true", help="errors by few load steps")
    others.add_argument("--normal", action="store_true", help="those without friction")
    given = parser.parse_args()
    kind = "laws" if given.laws else "samples" if given.samples else "cells"
    found = {"cells": [], "coupling": [], "normal": []} | {name: [] for name in BY_STEPS}
    for number in range(given.first, given.first + given.scenes):
        try:
            random = np.random.default_rng([given.seed, number])
            if given.normal:
                rows = judged_without_friction(number, random)
            elif given.steps:
                rows = judged_by_steps(number, random)
            else:
                rows = judged(number, random, kind)
        except NotConverged as error:
            print(f"{number:3d} not converged: {error}", flush=True)
            continue
        for name, row in rows.items():
            found[name].append(row)
    names = {
        "cells": "by grid and body",
        "coupling": "with the coupling",
        "normal": "of the normal load",
    } | {name: f"by steps, of the {name}" for name in BY_STEPS}
    for name, what in names.items():
        if not found[name]:
            continue
        off, stated = np.array(found[name]).T
        kept = int((off <= ALLOWED * stated).sum())
        print(
            f"{what}: true error within {ALLOWED} × the stated one on {kept} of {len(off)}; stated "
            f"over true in the median {np.median(stated / np.maximum(off, 1e-300)):.2f}"
        )


if __name__ == "__main__":
    main()
