"""One process per code: reads tasks as lines of JSON, answers with times and errors.

Runs under the interpreter of the code that it drives (the peers have an environment of their own).
"""

import json
import os
import sys
import time
from pathlib import Path

import numpy as np


class Patchlaw:
    """This project."""

    def __init__(self, heights, tolerance, periodic):
        sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
        from patchlaw.geometry import Surface
        from patchlaw.micro import HalfSpaceModel

        surface = Surface(heights=heights, lengths=(1.0, 1.0), periodic=periodic)
        _ = surface.highest  # reference of the approach, which the peers do not evaluate
        self.start = time.perf_counter()
        self.model = HalfSpaceModel(
            surface=surface, contact_modulus=1.0, periodic=periodic, tolerance=tolerance
        )
        self.guess = None

    def solve(self, pressure):
        from patchlaw.geometry import Control

        state = self.model.press(Control(force=pressure), start=self.guess)
        self.guess = state.guess
        return state.pressure, state.iterations


class Tamaas:
    """Tamaas (AGPL): a process of its own, nothing imported here otherwise."""

    def __init__(self, heights, tolerance, periodic):
        import tamaas as tm

        tm.initialize(int(os.environ["OMP_NUM_THREADS"]))
        self.start = time.perf_counter()
        self.model = tm.ModelFactory.createModel(
            tm.model_type.basic_2d, [1.0, 1.0], list(heights.shape)
        )
        self.model.E, self.model.nu = 1.0, 0.0
        self.solver = tm.PolonskyKeerRey(self.model, heights, tolerance)
        self.solver.max_iter = 100000
        if not periodic:
            tm.ModelFactory.registerNonPeriodic(self.model, "dcfft")
            self.solver.setIntegralOperator("dcfft")

    def solve(self, pressure):
        error = self.solver.solve(pressure)
        if not error <= self.solver.tolerance:
            raise RuntimeError(f"Tamaas stopped at {error}")
        return np.array(self.model.traction), None


class ContactMechanics:
    """ContactMechanics, its constrained conjugate gradients."""

    def __init__(self, heights, tolerance, periodic):
        from ContactMechanics import FreeFFTElasticHalfSpace, PeriodicFFTElasticHalfSpace
        from ContactMechanics.Systems import NonSmoothContactSystem
        from SurfaceTopography import Topography

        self.start = time.perf_counter()
        self.cells = heights.size
        kind = PeriodicFFTElasticHalfSpace if periodic else FreeFFTElasticHalfSpace
        substrate = kind(heights.shape, 1.0, (1.0, 1.0))
        surface = Topography(heights, physical_sizes=(1.0, 1.0), periodic=periodic)
        self.system = NonSmoothContactSystem(substrate, surface)
        self.tolerance, self.scale = tolerance, np.ptp(heights)
        self.forces = None

    def solve(self, pressure):
        found = self.system.minimize_proxy(
            external_force=pressure,
            initial_forces=self.forces,
            pentol=self.tolerance * self.scale,
            forcetol=self.tolerance * pressure / self.cells,
        )
        if not found.success:
            raise RuntimeError(f"ContactMechanics: {found.message}")
        self.forces = np.array(found.jac)
        return np.abs(self.forces) * self.cells, found.nit


class Aspher:
    """ASPHER, from nested grids; its grids have 64 · 2^k cells along a side."""

    def __init__(self, heights, tolerance, periodic):
        import aspher

        self.start = time.perf_counter()
        self.solver, self.gap = aspher.solve_nested, heights.max() - heights
        self.options = {"tol": tolerance, "backend": "periodic" if periodic else "fft"}
        self.options["coarsest"] = min(64, len(heights))

    def solve(self, pressure):
        found = self.solver(len(self.gap), self.gap, pressure, **self.options)
        if not found.converged:
            raise RuntimeError(f"aspher: {found.status}")
        return np.array(found.pressure).reshape(self.gap.shape), found.iterations


CODES = {
    "patchlaw": Patchlaw,
    "tamaas": Tamaas,
    "contactmechanics": ContactMechanics,
    "aspher": Aspher,
}


def run(code, heights, pressures, tolerance, save=None, periodic=True):
    """Solve along pressures; time from the heights in memory to the last pressures."""
    values = np.load(heights)
    # imports
    CODES[code](np.ascontiguousarray(values[::16, ::16]), 1e-2, periodic).solve(pressures[0])
    Path("/proc/self/clear_refs").write_text("5")  # Linux: restart the peak of the memory
    before = kilobytes("VmRSS")
    solver = CODES[code](values, tolerance, periodic)
    found = [solver.solve(pressure) for pressure in pressures]
    seconds = time.perf_counter() - solver.start
    if save:
        np.save(save, found[-1][0])
    iterations = [part[1] for part in found]
    return {
        "seconds": seconds,
        "megabytes": (kilobytes("VmHWM") - before) / 1024.0,
        "area": float(np.count_nonzero(found[-1][0] > 0.0) / values.size),
        "iterations": None if None in iterations else int(sum(iterations)),
    }


def kilobytes(name):
    """Read a number from the status of this process."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return int(next(line for line in lines if line.startswith(name)).split()[1])


if __name__ == "__main__":
    for line in sys.stdin:
        try:
            answer = run(sys.argv[1], **json.loads(line))
        except Exception as error:
            answer = {"failed": repr(error)}
        print(json.dumps(answer), flush=True)
