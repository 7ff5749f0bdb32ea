"""Uniform pressure on a patch of a large block against Love's half-space solution."""

from functools import cache

import numpy as np
import pytest
from helpers.block_cases import block_of, interface_of

from patchlaw.micro.closed_forms.love import love_mutual


@cache
def patch_displacements(element, n, *, width, grid, interface, fineness):
    """Return E*/p times the patches' mean displacements under pressure p on the first patch."""
    block = block_of(
        element=element,
        interface=interface,
        cells=(n, n, 5 * fineness),
        height=width,
        margin=width,
        margin_cells=3 * fineness,
        grading=20.0,
        margin_grading=10.0,
    )
    patches = interface_of(block, grid)
    load = patches.load(np.eye(patches.patches.count)[0])
    load.array[:] = block.solve(load).x.array[: block.owned_dofs]
    return patches.patch_displacements(load) * block.material.contact_modulus


def on_a_block(element, n, *, width, grid=(1, 1), interface=(1.0, 1.0), fineness=1):
    """Return the same, one patch on a square by default; solved for once."""
    options = {"width": width, "grid": grid, "interface": interface, "fineness": fineness}
    return patch_displacements(element, n, **options)


def half_space_displacements(patches):
    """Return the same by Love's solution, averaged over every patch."""
    dx, dy = (patches.centres - patches.centres[0]).T
    return love_mutual(dx, dy, *patches.half_sizes) / np.pi


def extrapolated(small, large):
    """Remove the leading error of a finite block, inverse to its width, from L and 2 L."""
    return 2.0 * large - small


@pytest.mark.slow
@pytest.mark.parametrize(
    ("grid", "sides"),
    [
        ((1, 1), (1.0, 1.0)),
        pytest.param((1, 1), (1.0, 0.5), marks=pytest.mark.slow),
        pytest.param((2, 2), (1.0, 1.0), marks=pytest.mark.slow),
    ],
)
def test_large_block_tends_to_love(grid, sides):
    block = block_of(interface=sides, cells=(2, 2, 1))
    exact = half_space_displacements(interface_of(block, grid).patches)
    computed = extrapolated(
        *(on_a_block("Q2", 4, width=width, grid=grid, interface=sides) for width in (2.0, 4.0))
    )
    # two to four quadratic elements across a patch: 1-2 % of the largest, 0.5 % at twice as many
    np.testing.assert_allclose(computed, exact, atol=0.025 * exact[0])


@pytest.mark.long
def test_distance_to_love_halves_when_the_block_doubles():
    exact = half_space_displacements(interface_of(block_of(cells=(1, 1, 1)), (1, 1)).patches)
    small, large = (on_a_block("Q2", 4, width=width) for width in (2.0, 4.0))
    # the leading term is inverse to the width; the mesh adds 1 % of the displacement to both
    assert (exact - small) / (exact - large) == pytest.approx(2.0, abs=0.2)
