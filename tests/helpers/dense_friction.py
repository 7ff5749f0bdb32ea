"""Contact with friction of elastic blocks by dense matrices: slow, and hardly able to be wrong.

Equal bricks of eight nodes fill a block that is held at its far face. Their stiffness is condensed
on the nodes of the contact face. There p = K <c>, and the shear stress follows the slip with the
slope K_t up to μ p, at the points of a fine midpoint rule on every facet. Nothing here is taken
from the packages that it judges.
"""

from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.linalg import splu


def brick(sides, young, poisson):
    """Return the stiffness of a brick by 2 × 2 × 2 Gauss points, shape (24, 24)."""
    corner = np.array(list(product((0, 1), repeat=3)))
    lame, shear = young * poisson / (1 + poisson) / (1 - 2 * poisson), young / 2 / (1 + poisson)
    law = np.diag([2 * shear] * 3 + [shear] * 3)
    law[:3, :3] += lame
    found = np.zeros((24, 24))
    for point in product((0.5 - 0.5 / np.sqrt(3), 0.5 + 0.5 / np.sqrt(3)), repeat=3):
        factors = np.where(corner, point, 1.0 - np.array(point))
        signs = np.where(corner, 1.0, -1.0) / sides
        slope = np.stack([signs[:, i] * np.delete(factors, i, 1).prod(1) for i in range(3)])
        strain = np.zeros((6, 8, 3))
        for row, (i, j) in enumerate([(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]):
            strain[row, :, i] += slope[j]
            if i != j:
                strain[row, :, j] += slope[i]
        strain = strain.reshape(6, 24)
        found += np.prod(sides) / 8 * strain.T @ law @ strain
    return found


def condensed(cells, lengths, young, poisson):
    """Return the stiffness on the nodes of the face z = 0 of a block below it.

    Args:
        cells: Bricks along x, y and z.
        lengths: Sides of the block [mm].
        young: Young's modulus [MPa].
        poisson: Poisson's ratio.

    Returns:
        The matrix by node of the face, with y fastest, and component, shape (3 m, 3 m).
    """
    shape = np.array(cells) + 1
    number = np.arange(shape.prod()).reshape(shape)
    nodes = np.stack([
        number[i : i + cells[0], j : j + cells[1], k : k + cells[2]].ravel()
        for i, j, k in product((0, 1), repeat=3)
    ], axis=1)  # fmt: skip
    dofs = (3 * nodes[:, :, None] + np.arange(3)).reshape(len(nodes), 24)
    one = brick(np.array(lengths) / cells, young, poisson)
    rows, columns = np.repeat(dofs, 24, axis=1).ravel(), np.tile(dofs, 24).ravel()
    whole = coo_matrix((np.tile(one.ravel(), len(nodes)), (rows, columns))).tocsc()
    face, inner = (
        (3 * part.ravel()[:, None] + np.arange(3)).ravel()
        for part in (number[:, :, -1], number[:, :, 1:-1])
    )
    beside = whole[inner][:, face]
    solved = splu(whole[inner][:, inner]).solve(beside.toarray())
    return whole[face][:, face].toarray() - beside.T @ solved


def midpoints(cells, lengths, parts):
    """Return a midpoint rule on every facet: points, weight, and values of the nodes there.

    Args:
        cells: Facets along x and y.
        lengths: Sides of the face [mm].
        parts: Points along x and y on the whole face.
    """
    ticks = [(np.arange(p) + 0.5) * side / p for p, side in zip(parts, lengths, strict=True)]
    hats = [
        np.maximum(1 - np.abs(at[:, None] / side * n - np.arange(n + 1)), 0.0)
        for at, side, n in zip(ticks, lengths, cells, strict=True)
    ]
    points = np.stack(np.meshgrid(*ticks, indexing="ij"), axis=-1).reshape(-1, 2)
    return points, np.prod(lengths) / np.prod(parts), csr_matrix(np.kron(*hats))


@dataclass
class Sliders:
    """Two faces, or a face and a plane, in contact at points.

    Args:
        stiffness: Stiffness on the displacements of all nodes, shape (N, N).
        relative: What the displacements contribute at the points to the closure and to what the
            plane slips against the face along x and y: three sparse matrices of shape (n, N).
        weight: Area of a point [mm²].
        gap: Gaps at the points [mm].
        normal: Slope K of the law [MPa/mm].
        tangential: Slope K_t of sticking [MPa/mm].
        friction: Coefficient of friction.
    """

    stiffness: np.ndarray
    relative: tuple
    weight: float
    gap: np.ndarray
    normal: float
    tangential: float
    friction: float

    def __post_init__(self):
        self.moved = np.zeros(len(self.stiffness))
        self.slid = np.zeros((len(self.gap), 2))

    def step(self, approach, shift):
        """Press and shift the plane; return its force (x, y, z) [N] by Newton's method."""
        residual, tangent = self._residual(approach, shift)
        for _ in range(100):
            change, part = np.linalg.solve(tangent, residual), 1.0
            start, size = self.moved, np.linalg.norm(residual)
            while True:  # halved until the forces are nearer to balance
                self.moved = start - part * change
                residual, tangent = self._residual(approach, shift)
                if np.linalg.norm(residual) < size or part < 1e-3:
                    break
                part *= 0.5
            if np.abs(change).max() < 1e-9 * np.abs(self.moved).max():
                break
        else:
            raise AssertionError("Newton's method has not converged")
        strain, values, _ = self._points(approach, shift)
        self.slid = strain[:, 1:] - np.stack(values[1:], axis=1) / self.tangential
        return self.weight * np.array([values[1].sum(), values[2].sum(), values[0].sum()])

    def _residual(self, approach, shift):
        """Return the forces that are not in balance, and their derivative."""
        _, values, slopes = self._points(approach, shift)
        force = self.stiffness @ self.moved
        tangent = self.stiffness.copy()
        for i, here in enumerate(self.relative):
            force += self.weight * (here.T @ values[i])
            for j, there in enumerate(self.relative):
                if slopes[i][j] is not None:
                    scaled = there.multiply(slopes[i][j][:, None])
                    tangent += self.weight * (here.T @ scaled).toarray()
        return force, tangent

    def _points(self, approach, shift):
        """Return closures and slips, pressures and shear stresses, and their derivatives."""
        closure = approach - self.gap + self.relative[0] @ self.moved
        slip = [s + r @ self.moved for s, r in zip(shift, self.relative[1:], strict=True)]
        touches = closure > 0.0
        pressure = self.normal * closure * touches
        trial = self.tangential * (np.stack(slip, axis=1) - self.slid)
        size, bound = np.hypot(*trial.T), self.friction * pressure
        slides = size > bound
        way = trial / np.where(size > 0.0, size, 1.0)[:, None]
        stress = np.where(slides[:, None], bound[:, None] * way, trial)
        falls = self.friction * self.normal * (touches & slides)
        along = np.where(slides, bound / np.where(slides, size, 1.0), 1.0) * self.tangential
        slopes = [[self.normal * touches, None, None]]
        for i in range(2):
            turned = [along * ((i == j) - slides * way[:, i] * way[:, j]) for j in range(2)]
            slopes.append([falls * way[:, i], *turned])
        return np.column_stack([closure, *slip]), [pressure, *stress.T], slopes


def under_plane(cells, lengths, young, poisson, rule):
    """Return stiffness and relative motions of one block under a rigid plane.

    Args:
        cells: Bricks along x, y and z.
        lengths: Sides [mm].
        young: Young's modulus [MPa].
        poisson: Poisson's ratio.
        rule: Values of the nodes at the points, of `midpoints`.
    """
    stiffness = condensed(cells, lengths, young, poisson)
    nodes = rule.shape[1]
    parts = []
    for component, sign in ((2, 1.0), (0, -1.0), (1, -1.0)):
        spread = csr_matrix(
            (np.full(nodes, sign), (np.arange(nodes), 3 * np.arange(nodes) + component)),
            shape=(nodes, 3 * nodes),
        )
        parts.append(csr_matrix(rule @ spread))
    return stiffness, tuple(parts)
