"""The stiffness of an interface, −dF/dū, through its boundaries and couplings, and its error.

    python benchmarks/interface_stiffness.py couplings --surfaces 10 --seed 9301
    python benchmarks/interface_stiffness.py laws --surfaces 14 --seed 11
    python benchmarks/interface_stiffness.py jumps --surfaces 11 --seed 11
    python benchmarks/interface_stiffness.py yielding --surfaces 60 --seed 11

``couplings``: rough maps of 128² cells and 4 waves on the side, pressed on a periodic half-space, a
free one, a cube, and by consistent laws. Printed are rms differences from the cube at three forces.
``laws``: drawn maps of 48² and 64² cells on drawn blocks; consistent laws of one patch against the
cells that they are made from, at 16 forces. ``jumps``: how far the stiffness of these cells leaves
a smooth curve through the loads around, as it jumps with every cell that touches.
``yielding``: drawn maps of which many cells yield, against the slope of a parabola through ln F
over the mean gap, from 10 % below to 10 % above the approach.
"""

import argparse

import numpy as np

from patchlaw import Control, Scene, Spectrum, run, synthesise
from patchlaw.micro import HalfSpaceModel


def couplings(surfaces, seed):
    """Print rms differences of the stiffness between boundaries and couplings."""
    ways = {
        "periodic": {"kind": "analytic"},
        "free half-space": {"kind": "analytic"},
        "cube": {"kind": "concurrent"},
        "consistent, 1 patch": {"kind": "consistent"},
        "consistent, 16 patches": {"kind": "consistent"},
    }
    found = []
    for number in range(seed, seed + surfaces):
        spectrum = {"hurst": 0.8, "waves": [4, 24], "rms_slope": 0.1, "seed": number}
        found.append([])
        for name, coupling in ways.items():
            periodic = name == "periodic"
            surface = {"spectrum": spectrum, "grid": [128, 128], "lengths": [1.0, 1.0]}
            scene = {
                "surface": surface | {"periodic": periodic},
                "block": {"young_modulus": 200e3, "poisson_ratio": 0.3, "height": 1.0},
                "patches": {"grid": [4, 4] if "16" in name else [1, 1]},
                "coupling": coupling,
                "load": {"force": 1200.0, "steps": 3},
                "output": {"check": "none", "figures": False, "report": False},
            }
            history = run(Scene.from_dict(scene))
            found[-1].append(history.interface_stiffness_N_per_mm)
        print(number, np.round(found[-1] / found[-1][2], 3).tolist(), flush=True)
    ratios = np.array(found) / np.array(found)[:, 2:3] - 1.0
    for name, rms in zip(ways, np.sqrt(np.mean(ratios**2, axis=0)), strict=True):
        print(f"{name:24}", "  ".join(f"{100 * one:5.2f} %" for one in rms))


def drawn_blocks(surfaces, seed):
    """Yield drawn scenes of a rough block without a coupling, and their largest forces."""
    rng = np.random.default_rng(seed)
    for _ in range(surfaces):
        n, low = int(rng.choice([48, 64])), float(rng.uniform(1.5, 5.0))
        waves, slope = (
            [low, float(min(low * rng.uniform(2.0, 7.0), n / 4))],
            rng.uniform(0.03, 0.25),
        )
        hurst, ratio, height = rng.uniform(0.4, 1.0), rng.uniform(0.1, 0.4), rng.uniform(0.3, 2.0)
        spectrum = {"hurst": float(hurst), "waves": waves, "rms_slope": float(slope)}
        spectrum["seed"] = int(rng.integers(1e6))
        block = {"young_modulus": 1e3, "poisson_ratio": float(ratio), "height": float(height)}
        scene = {
            "surface": {"spectrum": spectrum, "grid": [n, n], "lengths": [1.0, 1.0]},
            "block": block,
            "patches": {"grid": [1, 1]},
            "output": {"check": "none", "figures": False, "report": False},
        }
        yield scene, float(1e3 * slope * rng.uniform(0.003, 0.15))


def laws(surfaces, seed):
    """Print by how much the stiffness of consistent laws differs from that of the cells."""
    every = []
    for scene, force in drawn_blocks(surfaces, seed):
        scene["load"] = {"force": force, "steps": 16}
        cells, law = (
            run(Scene.from_dict(scene | {"coupling": {"kind": kind}}))
            for kind in ("concurrent", "consistent")
        )
        known, found = cells.interface_stiffness_N_per_mm, law.interface_stiffness_N_per_mm
        every.append(found / known - 1.0)
        touching = cells.contact_area_fraction[-1] * scene["surface"]["grid"][0] ** 2
        print(f"{touching:5.0f} cells touch in the end: {_sizes(every[-1])}", flush=True)
    print(f"all: {_sizes(every)}")


def jumps(surfaces, seed):
    """Print how far the stiffness of cells leaves a smooth curve, within 8 % of a force."""
    for scene, force in drawn_blocks(surfaces, seed):
        for share in (0.25, 0.5, 1.0):
            forces = (share * force * np.linspace(0.92, 1.08, 41)).tolist()
            load = {"load": {"force": forces, "steps": 1}, "coupling": {"kind": "concurrent"}}
            cells = run(Scene.from_dict(scene | load))
            closed = cells.mean_separation_mm[20] - cells.mean_separation_mm
            slope = np.polyder(np.polyfit(closed, np.log(cells.force_N), 2))
            smooth = cells.force_N * np.polyval(slope, closed)
            print(_sizes(cells.interface_stiffness_N_per_mm / smooth - 1.0), flush=True)


def _sizes(apart):
    """Return the rms and the largest of relative differences, as text."""
    rms, most = np.sqrt(np.mean(np.square(apart))), np.abs(apart).max()
    return f"{100.0 * rms:.2f} % rms, at most {100.0 * most:.1f} %"


def drawn(rng):
    """Return a drawn model of which cells yield, and an approach."""
    n, low = int(rng.choice([48, 64, 96])), rng.uniform(1.5, 4.0)
    waves = low, min(low * rng.uniform(2.0, 8.0), n / 4)
    slope = rng.uniform(0.05, 0.3)
    spectrum = Spectrum(
        hurst=rng.uniform(0.4, 1.0), waves=waves, rms_slope=slope, seed=int(rng.integers(1e6))
    )
    surface = synthesise(spectrum, grid=(n, n), lengths=(1.0, 1.0))
    modulus = 10.0 ** rng.uniform(3.0, 5.3)
    hardness = modulus * slope * 10.0 ** rng.uniform(-1.3, -0.2)
    model = HalfSpaceModel(surface, contact_modulus=modulus, hardness=hardness, tolerance=1e-7)
    return model, float(np.std(surface.heights)) * rng.uniform(0.5, 3.0)


def yielding(surfaces, seed):
    """Print how often the stated error holds while cells yield, and its size."""
    rng, rows = np.random.default_rng(seed), []
    for _ in range(surfaces):
        model, approach = drawn(rng)
        state, force, gap = None, [], []
        shares = np.concatenate([[0.3, 0.6], np.arange(0.9, 1.1001, 0.01)])
        for share in shares:
            start = None if state is None else state.start
            state = model.press(Control(approach=share * approach), start=start)
            if share > 0.8:
                force.append(state.force)
                gap.append(state.gap.mean())
            if abs(share - 1.0) < 1e-9:
                found, cells, here = model.stiffness(state), int(state.yielding.sum()), state.force
                middle = gap[-1]
        if not found.scatter:
            continue
        width = gap[0] - gap[-1]
        slope = np.polyfit((np.array(gap) - middle) / width, np.log(force), 2)[1]
        true = -here * slope / width
        off = abs(found.interface / true - 1.0)
        rows.append([cells, off, found.scatter])
        print(f"{cells:5d} yielding, off by {off:.3f}, stated {rows[-1][2]:.3f}", flush=True)
    rows = np.array(rows)
    for least in (1, 30, 100):
        some = rows[rows[:, 0] >= least]
        held = (some[:, 1] <= 1.5 * some[:, 2]).mean()
        off, stated = (100.0 * np.median(some[:, k]) for k in (1, 2))
        print(
            f"from {least} cells on: {len(some)} contacts, {held:.0%} within 1.5 × stated; "
            f"off by {off:.1f} %, stated {stated:.1f} % (medians), "
            f"90 % state up to {100 * np.quantile(some[:, 2], 0.9):.0f} %"
        )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("study", choices=("couplings", "laws", "jumps", "yielding"))
    parser.add_argument("--surfaces", type=int, default=10)
    parser.add_argument("--seed", type=int, default=9301)
    choice = parser.parse_args()
    globals()[choice.study](choice.surfaces, choice.seed)
