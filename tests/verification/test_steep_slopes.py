"""Stated errors of finite slopes against finite elements that have the slopes as they are."""

import numpy as np
import pytest
import scipy.sparse as sp
from helpers.block_cases import rough_contact
from scipy.sparse.linalg import splu

from patchlaw.geometry import Control, RefinedShape, Surface, places_in_reach, roughness
from patchlaw.macro import Material
from patchlaw.multiscale import Scene, make_setup, run

_FAR, _DEPTH = 15.0, 0.5  # radius and depth of the cylinder, decay of the warp [mm]


def cosine_bump(height, radius):
    """Return the heights (A/2)(1 + cos(π r/b)) of a bump over distances r from its middle."""
    return lambda r: 0.5 * height * (1.0 + np.cos(np.pi * np.minimum(r, radius) / radius))


def slope_effect(bump, radius, poisson_ratio, approach, cells=24):
    """Return the force on the bump over that on a flat half-space under the same heights.

    Axisymmetric finite elements: quadratic quadrilaterals with nine nodes, graded towards the bump,
    whose top follows its height. Both forces are on one mesh, warped and flat, so that most of its
    own error cancels.
    """
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


MODULUS, CELLS = 4000.0, 96


def pressed(surface, poisson_ratio, approach, kind="analytic"):
    """Return force and stated error by slopes, and the force of small slopes."""
    found = []
    for slopes in (True, False):
        scene = Scene.from_dict({
            "surface": surface,
            "block": {"young_modulus": MODULUS, "poisson_ratio": poisson_ratio, "height": 1.0},
            "micro": {"finite_slopes": slopes},
            "coupling": {"kind": kind},
            "load": {"approach": approach, "steps": 1},
            "output": {"check": "last" if slopes else "none", "figures": False},
        })  # fmt: skip
        found.append(run(scene).steps[-1])
    return found[0].force_N, dict(found[0].errors)["slopes"], found[1].force_N


def bumps():
    """Draw isolated bumps, from flat to as steep as finite slopes go."""
    dice = np.random.default_rng(20261123)
    for gradient in (0.1, 0.2, 0.3, 0.4, 0.55, 0.75):
        radius, ratio = dice.uniform(0.22, 0.45), dice.uniform(0.0, 0.45)
        # the mean square of the slope is (π A/2b)²/2 on the area π b² of 1 mm²
        height = gradient * 2.0 / np.pi * np.sqrt(2.0 / np.pi)
        later = [pytest.mark.long] * (gradient not in (0.1, 0.3, 0.75))
        share = dice.uniform(0.1, 0.3)
        yield pytest.param(radius, height, ratio, share, id=f"{gradient}", marks=later)


@pytest.mark.long
@pytest.mark.parametrize(("radius", "height", "poisson_ratio", "share"), bumps())
def test_the_stated_error_holds_the_slopes_of_a_bump(radius, height, poisson_ratio, share):
    bump, approach = cosine_bump(height, radius), share * height
    x = (np.arange(CELLS) + 0.5) / CELLS - 0.5
    heights = bump(np.hypot(x[:, None], x))
    surface = {"heights": heights, "lengths": [1.0, 1.0]}
    force, stated, small = pressed(surface, poisson_ratio, approach)
    effect = slope_effect(bump, radius, poisson_ratio, approach)
    # the mesh's own error is 0.05 % of the force
    assert abs(force - small * effect) < 1.5 * stated + 5e-4 * force
    assert stated < 2.5 * abs(1.0 - effect) * small
    if roughness(Surface(heights=heights, lengths=(1.0, 1.0))).sdq < 0.15:
        assert stated < 0.5 * abs(1.0 - effect) * small  # and it is worth to count slopes


@pytest.mark.slow
@pytest.mark.parametrize("seed", [52711, 90412, 77103])
@pytest.mark.parametrize("gradient", [0.153, 0.317, 0.489])
def test_the_stated_error_holds_the_slopes_of_a_meshed_surface(seed, gradient):
    """Meshes alike but for their heights, 1 and a hundredth: the mesh's own error cancels."""
    ratio, approach = 0.23, 0.029 * gradient
    spectrum = {"hurst": 0.87, "waves": [2, 6], "rms_slope": gradient, "seed": seed}
    given = {"spectrum": spectrum, "grid": [128, 128], "lengths": [1.0, 1.0]}
    force, stated, small = pressed(given, ratio, approach, "concurrent")
    block = {"young_modulus": MODULUS, "poisson_ratio": ratio}
    rough = make_setup(
        Scene.from_dict({"surface": given, "block": block, "load": {"approach": approach}})
    ).parts.surface
    shape = RefinedShape(
        interface=(1.0, 1.0),
        height=1.0,
        places=places_in_reach(rough, approach, spacing=0.02),
        fine=0.02,
        coarse=0.15,
        growth=0.3,
        element="P2",
    )
    forces = []
    for scale in (1.0, 0.01):
        problem = rough_contact(shape, rough.scaled(scale), Material(**block))
        forces.append(problem.solve(Control(approach=approach * scale)).force / scale)
    effect = forces[0] / forces[1]
    assert effect < 0.99
    assert abs(force - small * effect) < 1.5 * stated + 1e-3 * force  # of the meshes, 0.1 %
    assert stated < 2.0 * abs(1.0 - effect) * small
