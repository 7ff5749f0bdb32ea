"""True over stated errors of natural frequencies, of blocks drawn at random under laws of samples.

Run by hand: ``.venv/bin/python benchmarks/frequency_errors.py [--blocks 16] [--seed 881]``. The
truth is quadratic elements on three times as many cells along each side, under the same law. Half
a minute.
"""

import argparse

import numpy as np

from patchlaw import Scene, run

CELLS_OF_TRUTH = 3


def drawn(rng: np.random.Generator, element: str) -> tuple[Scene, Scene]:
    """Return a scene of a block on few cells, linear ones halved, and one on the cells of truth."""
    cells = rng.integers(2, 4, 3)
    (length, width, height), hurst = rng.uniform(3.0, 9.0, 3), rng.uniform(0.6, 0.9)
    spectrum = {
        "hurst": float(hurst),
        "waves": [2, 5],
        "rms_height": float(10.0 ** rng.uniform(-4.0, -2.3)),
        "seed": int(rng.integers(1e6)),
    }
    block = {
        "young_modulus": float(10.0 ** rng.uniform(3.5, 5.0)),
        "poisson_ratio": float(rng.uniform(0.1, 0.4)),
        "density": "2000 kg/m^3",
        "sides": "free",
        "lengths": [float(length), float(width)],
        "height": float(height),
    }
    output = {"figures": False, "report": False, "check": "last", "fields": False}
    data = {
        "surface": {"spectrum": spectrum, "grid": [24, 24], "lengths": [0.5, 0.5]},
        "law": {"kind": "representative"},
        "load": {"pressure": float(10.0 ** rng.uniform(-0.5, 1.0)), "steps": 1},
        "vibration": {"modes": 4},
    }
    times = 1 if element == "Q2" else 2
    few = block | {"cells": (times * cells).tolist(), "element": element}
    many = block | {"cells": (CELLS_OF_TRUTH * cells).tolist(), "element": "Q2"}
    return (
        Scene.from_dict(data | {"block": few, "output": output}),
        Scene.from_dict(data | {"block": many, "output": output | {"check": "none"}}),
    )


def main() -> None:
    """Print the ratios of each block, and how many are within 1.5."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--blocks", type=int, default=16)
    parser.add_argument("--seed", type=int, default=881)
    choice = parser.parse_args()
    rng, whole = np.random.default_rng(choice.seed), []
    for number in range(choice.blocks):
        element = ("Q1", "Q2")[number % 2]
        stated, true = (run(scene)[-1].modes for scene in drawn(rng, element))
        ratios = [
            abs(one.frequency_Hz - other.frequency_Hz) / one.frequency_error_Hz
            for one, other in zip(stated, true, strict=False)
        ]
        shares = [one.frequency_error_Hz / one.frequency_Hz for one in stated]
        print(
            f"{number:3d} {element}", np.round(ratios, 2), "stated", np.round(shares, 3), flush=True
        )
        whole += ratios
    held = sum(ratio <= 1.5 for ratio in whole)
    print(f"{held} of {len(whole)} held, median {np.median(whole):.2f}, most {max(whole):.2f}")


if __name__ == "__main__":
    main()
