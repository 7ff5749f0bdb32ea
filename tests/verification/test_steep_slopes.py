"""Stated errors of finite slopes against finite elements that have the slopes as they are."""

import numpy as np
import pytest
from helpers.bump_oracle import cosine_bump, slope_effect
from mpi4py import MPI

from patchlaw.geometry import RefinedShape, Surface, places_in_reach, roughness
from patchlaw.geometry.rigid_plane import Control
from patchlaw.macro import Block, Material, UnilateralContactProblem, rough_block_mesh
from patchlaw.multiscale import Scene, make_setup, run

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
        top = rough.scaled(scale)
        mesh, _ = rough_block_mesh(shape, top, MPI.COMM_SELF)
        body = Block(mesh, Material(**block))
        problem = UnilateralContactProblem(body, top.highest - top.mean_height)
        forces.append(problem.solve(Control(approach=approach * scale)).force / scale)
    effect = forces[0] / forces[1]
    assert effect < 0.99
    assert abs(force - small * effect) < 1.5 * stated + 1e-3 * force  # of the meshes, 0.1 %
    assert stated < 2.0 * abs(1.0 - effect) * small
