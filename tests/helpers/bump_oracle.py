"""A bump on a half-space pressed by a rigid plane: axisymmetric finite elements, warped or flat.

Quadratic quadrilaterals with nine nodes on a cylinder of 15 mm, graded towards the bump; nodes of
the top follow its height. What slopes change is the ratio of two forces on one mesh, warped and
flat under the same heights, in which most of the mesh's own error cancels.
"""

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

_FAR, _DEPTH = 15.0, 0.5  # radius and depth of the cylinder, decay of the warp [mm]


def cosine_bump(height, radius):
    """Return the heights (A/2)(1 + cos(π r/b)) of a bump over distances r from its middle."""
    return lambda r: 0.5 * height * (1.0 + np.cos(np.pi * np.minimum(r, radius) / radius))


def slope_effect(bump, radius, poisson_ratio, approach, cells=24):
    """Return the force on the bump over that on a flat half-space under the same heights."""
    r, z = _ticks(radius, cells)
    forces = []
    for warp in (0.0, 1.0):
        places, compliance = _compliance(r, z, lambda x, w=warp: w * bump(x), poisson_ratio)
        interference = approach - (float(bump(np.zeros(1))[0]) - bump(places))
        near = interference > 0.0
        forces.append(_force(compliance(near), interference[near]))
    return forces[1] / forces[0]


def _ticks(radius, cells):
    step = 1.2 * radius / cells
    r, z = list(np.linspace(0.0, 1.2 * radius, cells + 1)), [0.0]
    wide = high = step
    while r[-1] < _FAR:
        wide *= 1.15
        r.append(r[-1] + wide)
    while z[-1] > -_FAR:
        z.append(z[-1] - high)
        high *= 1.12 if z[-1] < -0.15 * radius else 1.0
    return np.array(r), np.array(z[::-1])


def _compliance(r, z, warp, nu):
    """Return the radii of the top's nodes, and their compliance as a function of which count."""
    radial, vertical = (np.interp(np.arange(2 * len(t) - 1) / 2.0, np.arange(len(t)), t)
                        for t in (r, z))  # fmt: skip
    x, y = np.meshgrid(radial, vertical, indexing="ij")
    y = y + warp(x) * np.exp(y / _DEPTH)
    number = np.arange(x.size).reshape(x.shape)
    first = 2 * np.arange(len(r) - 1)[:, None], 2 * np.arange(len(z) - 1)
    cells = np.stack([number[first[0] + i, first[1] + j] for i in range(3) for j in range(3)], -1)
    cells = cells.reshape(-1, 9)
    unknown = np.stack([2 * cells, 2 * cells + 1], -1).reshape(len(cells), 18)
    rows, columns = np.repeat(unknown, 18, axis=1), np.tile(unknown, (1, 18))
    entries = _stiffness(x.ravel()[cells], y.ravel()[cells], nu)
    matrix = sp.csc_matrix((entries.ravel(), (rows.ravel(), columns.ravel())))
    held = np.zeros(2 * x.size, bool)
    held[2 * number[0]] = True
    for edge in (number[:, 0], number[-1]):
        held[2 * edge] = held[2 * edge + 1] = True
    free = np.flatnonzero(~held)
    position = np.full(len(held), -1)
    position[free] = np.arange(len(free))
    solver = splu(matrix[free][:, free], permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0,
                  options={"SymmetricMode": True})  # fmt: skip

    def among(near):
        top = position[2 * number[near, -1] + 1]
        loads = np.zeros((len(free), len(top)))
        loads[top, np.arange(len(top))] = 1.0
        return solver.solve(loads)[top]

    return x[:, -1], among


def _stiffness(x, y, nu):
    """Return the stiffness of cells for E = 1, shape (cells, 18, 18)."""
    lame, shear = nu / ((1.0 + nu) * (1.0 - 2.0 * nu)), 0.5 / (1.0 + nu)
    hooke = np.diag([2.0 * shear, 2.0 * shear, 2.0 * shear, shear])
    hooke[:3, :3] += lame
    found = np.zeros((len(x), 18, 18))
    nodes, weights = np.polynomial.legendre.leggauss(3)
    shapes = [(np.array([t * (t - 1) / 2, 1 - t * t, t * (t + 1) / 2]),
               np.array([t - 0.5, -2 * t, t + 0.5])) for t in nodes]  # fmt: skip
    for (a, da), wa in zip(shapes, weights, strict=True):
        for (b, db), wb in zip(shapes, weights, strict=True):
            value, ds, dt = (np.outer(p, q).ravel() for p, q in ((a, b), (da, b), (a, db)))
            xs, xt, ys, yt = x @ ds, x @ dt, y @ ds, y @ dt
            area, radius = xs * yt - xt * ys, x @ value
            assert area.min() > 0.0
            dx = (np.outer(yt, ds) - np.outer(ys, dt)) / area[:, None]
            dy = (np.outer(xs, dt) - np.outer(xt, ds)) / area[:, None]
            strain = np.zeros((len(x), 4, 18))
            strain[:, 0, ::2], strain[:, 1, 1::2] = dx, dy
            strain[:, 2, ::2] = value / radius[:, None]
            strain[:, 3, ::2], strain[:, 3, 1::2] = dy, dx
            share = 2.0 * np.pi * radius * area * wa * wb
            found += share[:, None, None] * (strain.swapaxes(1, 2) @ hooke @ strain)
    return found


def _force(compliance, interference):
    """Return the force of a contact that may not pull."""
    touching = np.ones(len(interference), bool)
    for _ in range(100):
        force = np.zeros(len(interference))
        force[touching] = np.linalg.solve(
            compliance[np.ix_(touching, touching)], interference[touching]
        )
        pulled, inside = touching & (force < 0.0), ~touching & (interference > compliance @ force)
        if not pulled.any() and not inside.any():
            return force.sum()
        touching = (touching & ~pulled) | inside
    raise AssertionError("no contact found")
