"""One process per code: reads tasks as lines of JSON, answers with times and errors.

Runs under the interpreter of the code that it drives (the peers have an environment of their own).
"""

import json
import sys
import time
from pathlib import Path

import numpy as np


class Patchlaw:
    """This project."""

    def __init__(self, heights, tolerance):
        sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
        from geometry import Surface
        from micro import HalfSpaceModel

        surface = Surface(heights=heights, lengths=(1.0, 1.0), periodic=True)
        _ = surface.highest  # reference of the approach, which the peers do not evaluate
        self.start = time.perf_counter()
        self.model = HalfSpaceModel(
            surface=surface, contact_modulus=1.0, periodic=True, tolerance=tolerance
        )
        self.state = None

    def solve(self, pressure):
        self.state = self.model.solve_force(pressure, start=self.state)
        return self.state.pressure, self.state.iterations


class Tamaas:
    """Tamaas (AGPL): a process of its own, nothing imported here otherwise."""

    def __init__(self, heights, tolerance):
        import tamaas as tm

        tm.initialize(1)
        self.start = time.perf_counter()
        self.model = tm.ModelFactory.createModel(
            tm.model_type.basic_2d, [1.0, 1.0], list(heights.shape)
        )
        self.model.E, self.model.nu = 1.0, 0.0
        self.solver = tm.PolonskyKeerRey(self.model, heights, tolerance)
        self.solver.max_iter = 100000

    def solve(self, pressure):
        error = self.solver.solve(pressure)
        if not error <= self.solver.tolerance:
            raise RuntimeError(f"Tamaas stopped at {error}")
        return np.array(self.model.traction), None


class ContactMechanics:
    """ContactMechanics, its constrained conjugate gradients."""

    def __init__(self, heights, tolerance):
        from ContactMechanics import PeriodicFFTElasticHalfSpace
        from ContactMechanics.Systems import NonSmoothContactSystem
        from SurfaceTopography import Topography

        self.start = time.perf_counter()
        self.cells = heights.size
        substrate = PeriodicFFTElasticHalfSpace(heights.shape, 1.0, (1.0, 1.0))
        surface = Topography(heights, physical_sizes=(1.0, 1.0), periodic=True)
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


CODES = {"patchlaw": Patchlaw, "tamaas": Tamaas, "contactmechanics": ContactMechanics}


def run(code, heights, pressures, tolerance, save=None):
    """Solve along pressures; time from the heights in memory to the last pressures."""
    values = np.load(heights)
    CODES[code](np.ascontiguousarray(values[::4, ::4]), 1e-2).solve(pressures[0])  # imports
    spent = timed_transforms() if code == "patchlaw" else None
    Path("/proc/self/clear_refs").write_text("5")  # Linux: restart the peak of the memory
    before = kilobytes("VmRSS")
    solver = CODES[code](values, tolerance)
    found = [solver.solve(pressure) for pressure in pressures]
    seconds = time.perf_counter() - solver.start
    if save:
        np.save(save, found[-1][0])
    iterations = [part[1] for part in found]
    return {
        "seconds": seconds,
        "megabytes": (kilobytes("VmHWM") - before) / 1024.0,
        "iterations": None if None in iterations else int(sum(iterations)),
        "transforms": None if spent is None else spent[0] / seconds,
    }


def kilobytes(name):
    """Read a number from the status of this process."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return int(next(line for line in lines if line.startswith(name)).split()[1])


def timed_transforms():
    """Let the transforms of this project add up their times; return the list that holds the sum."""
    from types import SimpleNamespace

    from scipy import fft

    import micro.compliance.half_space_grid as convolution

    spent = [0.0]

    def timed(transform):
        def call(*args, **options):
            begin = time.perf_counter()
            result = transform(*args, **options)
            spent[0] += time.perf_counter() - begin
            return result

        return call

    names = ("rfft", "irfft", "fft", "ifft")
    convolution.fft = SimpleNamespace(**{name: timed(getattr(fft, name)) for name in names})
    return spent


if __name__ == "__main__":
    for line in sys.stdin:
        try:
            answer = run(sys.argv[1], **json.loads(line))
        except Exception as error:
            answer = {"failed": repr(error)}
        print(json.dumps(answer), flush=True)
