"""A surface of few cells, a made-up smooth correction, and both together as one dense problem."""

import numpy as np
from multiscale.couplings.concurrent import ConcurrentCoupling

from geometry import PatchGrid, Spectrum, patch_means, synthesise
from micro import micro_model

MODULUS = 4000.0
CELLS = 16
SCENE = PatchGrid(grid=(2, 2), lengths=(1.0, 1.0))
LOADS = PatchGrid(grid=(4, 4), lengths=(1.0, 1.0))
SURFACE = synthesise(
    Spectrum(hurst=0.95, waves=(2, 6), rms_slope=0.215, seed=3),
    grid=(CELLS, CELLS),
    lengths=(1.0, 1.0),
)
MEANS = patch_means(SURFACE, SCENE)


class Cosines:
    """Yields by its mean and five cosines; ``scale`` 1 is the half-space's own mean compliance."""

    def __init__(self, scale, loads=LOADS):
        self.loads = loads
        self.compliances = scale * 0.946 / MODULUS * np.array([1.0, 0.3, 0.3, 0.1, 0.05, 0.05])

    @staticmethod
    def modes(x, y):
        """Return the six modes at points, shape (6, ...)."""
        x, y = np.broadcast_arrays(np.pi * np.asarray(x), np.pi * np.asarray(y))
        cos = np.cos
        return np.array([x * 0 + 1, cos(x), cos(y), cos(x) * cos(y), cos(2 * x), cos(2 * y)])

    def sag(self, forces):
        """Return the displacement by forces on the load rectangles."""
        parts = self.compliances * (self.modes(*self.loads.centres.T) @ forces)
        return lambda x, y: np.tensordot(parts, self.modes(x, y), 1)


def coupling(scale, name="half-space", **options):
    """Return a coupling of the surface with the made-up correction."""
    model = micro_model(name, SURFACE, contact_modulus=MODULUS)
    if name == "half-space":
        model = type(model)(surface=SURFACE, contact_modulus=MODULUS, tolerance=1e-11)
    return ConcurrentCoupling(model, SCENE, MEANS, Cosines(scale), **options)


def dense_forces(scale, approach, tilt):
    """Return the forces of all cells from one linear complementarity problem, shape (n, n) [N].

    Love's corner sum and the correction make one matrix; active sets are changed until the
    pressures are positive and the gaps not negative.
    """
    centres = (np.arange(CELLS) + 0.5) / CELLS
    x, y = (a.ravel() for a in np.meshgrid(centres, centres, indexing="ij"))
    matrix = np.zeros((CELLS**2, CELLS**2))
    for i in (1, -1):
        for j in (1, -1):
            u = x[:, None] - x + 0.5 * i / CELLS
            v = y[:, None] - y + 0.5 * j / CELLS
            matrix += i * j * (u * np.arcsinh(v / np.abs(u)) + v * np.arcsinh(u / np.abs(v)))
    matrix *= CELLS**2 / (np.pi * MODULUS)
    block = Cosines(scale)
    owner = block.loads.centres[block.loads.index_of(x, y)].T
    matrix += block.modes(x, y).T @ (block.compliances[:, None] * block.modes(*owner))
    wanted = approach + tilt[0] * (x - 0.5) + tilt[1] * (y - 0.5)
    wanted = wanted - (SURFACE.highest - SURFACE.heights.ravel())
    on, forces = wanted > 0.0, np.zeros_like(x)
    for _ in range(500):
        forces = np.zeros_like(x)
        forces[on] = np.linalg.solve(matrix[np.ix_(on, on)], wanted[on])
        if forces.min() < 0.0:
            on = on & (forces > 0.5 * forces.min())
            continue
        gap = matrix @ forces - wanted
        if gap[~on].min() >= 0.0:
            return forces.reshape(CELLS, CELLS)
        on = on | (gap < np.where(on, -np.inf, 0.5 * gap[~on].min()))
    raise AssertionError("the oracle did not end")
