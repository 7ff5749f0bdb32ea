"""The contact problem on real blocks: path, force, free plane; and laws made for their macro model.

Pancakes are stiffer than the half-space, columns softer.
"""

import numpy as np
import pytest
from helpers.laws_on_mesh import lay_on_mesh
from helpers.reference_cases import on_block

from patchlaw.geometry import Control, PatchGrid, Spectrum, Surface, patch_means, synthesise
from patchlaw.multiscale import CellContact, Scene, run

SURFACE = synthesise(
    Spectrum(hurst=0.95, waves=(2, 10), rms_slope=0.215, seed=1), grid=(64, 64), lengths=(1.0, 1.0)
)
PATCHES = PatchGrid(grid=(4, 4), lengths=(1.0, 1.0))
BLOCKS = {"pancake": (0.1, "free"), "cube": (1.0, "free"), "column": (10.0, "roller")}
FEW = ["cube", *(pytest.param(one, marks=pytest.mark.long) for one in ("pancake", "column"))]
"""The cube, and among the long tests all blocks."""


def coupling(block):
    height, sides = BLOCKS[block]
    model = on_block(SURFACE, height=height, sides=sides, tolerance=1e-10)
    return CellContact(model, PATCHES, patch_means(SURFACE, PATCHES))


def test_a_small_force_is_balanced_from_nothing():
    """Three summits that do not touch yet are to hold the plane: as on the way down."""
    unloading = coupling("cube")
    for force in 1.6 * 0.5 ** np.arange(6):
        above = unloading.press(Control(force=force, tilt=None))
        if force < 0.5:
            step = coupling("cube").press(Control(force=force, tilt=None))
            assert step.contacts == 3
            assert step.approach_mm == pytest.approx(above.approach_mm, rel=1e-8)


def test_a_plane_that_may_turn_clear_does():
    """Below the approach at which summits all about the middle stop it nothing is pressed."""
    stopped = coupling("cube").press(Control(force=0.2, tilt=None))
    assert stopped.approach_mm > 0.0  # where a level plane would touch
    step = coupling("cube").press(Control(approach=0.2 * stopped.approach_mm, tilt=None))
    assert (step.force_N, step.contacts) == (0.0, 0)


@pytest.mark.parametrize("block", FEW)
def test_without_force_a_tilted_plane_touches_as_on_a_half_space(block):
    """Nothing is deformed, so that no body is felt."""
    control = Control(force=0.0, tilt=(0.005, -0.002))
    step = coupling(block).press(control)
    x = SURFACE.x[:, None] - 0.5, SURFACE.y - 0.5
    below = SURFACE.highest - SURFACE.heights - 0.005 * x[0] + 0.002 * x[1]
    assert (step.force_N, step.contacts) == (0.0, 0)
    assert step.approach_mm == pytest.approx(below.min(), rel=1e-12)


@pytest.mark.long
@pytest.mark.parametrize(
    ("block", "meshed", "tilt", "patches"),
    [
        ("pancake", False, "tilted", 4),
        pytest.param("cube", False, "level", 1, marks=pytest.mark.slow),
        ("cube", False, "tilted", 8),
        ("column", False, "tilted", 2),
        pytest.param("cube", True, "tilted", 1, marks=pytest.mark.slow),
        pytest.param("cube", True, "level", 4, marks=pytest.mark.slow),
    ],
)
def test_consistent_laws_find_the_contact_problem_again(
    root, block, meshed, tilt, patches, monkeypatch
):
    """Whatever the partition, and on a mesh however coarse: closures count in its compliance.

    Tables are made to 1e-3, the default. Of 64² cells each new one in contact is a kink, and on the
    tilted pancake 65 rows, the most that are solved, leave 1.3e-3 between them.
    """
    if meshed:
        lay_on_mesh(monkeypatch, condensed=True)
    height, sides = BLOCKS[block]
    words = [
        "micro.model=half-space",
        "micro.finite_slopes=false",
        "surface.grid=[128, 128]",
        f"block.height={height} mm",
        f"block.sides={sides}",
        "block.cells=[8, 8, 5]",
        f"patches.grid=[{patches}, {patches}]",
        "output.check=none",
        "load.approach=8 um",
        "load.steps=5",
        f"load.tilt={[0.005, 0.0] if tilt == 'tilted' else [0.0, 0.0]}",
    ]
    laws, whole = (
        run(Scene.load(root / "demos/scenes/paper.toml", [*words, *kind])).force_N
        for kind in (["coupling.kind=consistent"], ["coupling.kind=concurrent"])
    )
    loaded = whole > 0.1 * whole[-1]
    assert loaded.sum() >= 3
    np.testing.assert_allclose(laws[loaded], whole[loaded], rtol=1e-3)  # 4e-4


@pytest.mark.long
def test_contacts_near_a_free_side_feel_it_on_their_own_scale():
    """A ball 20 µm from a free side, in a contact of 14 µm: far below what modes resolve."""
    x = (np.arange(96) + 0.5) / 96
    ball = ((x[:, None] - 0.02) ** 2 + (x - 0.4) ** 2) / (2.0 * 0.1)
    surface = Surface(heights=-np.minimum(ball, 0.02), lengths=(1.0, 1.0))
    known, unknown = (
        on_block(surface, known=known).press(Control(approach=2e-3)).force
        for known in (True, False)
    )
    assert known < 0.98 * unknown
