"""What the contact problem sees of a scene's block: sides, body, finite slopes."""

from __future__ import annotations

import pytest

from patchlaw.micro import BodyModes, FiniteSlopes, FreeSides
from patchlaw.multiscale import Scene, make_setup
from patchlaw.support import InputError


def setup(
    kind="concurrent",
    model="half-space",
    patches=4,
    coupling=None,
    slopes=None,
    approach=0.008,
    **block,
):
    spectrum = {"hurst": 0.95, "waves": [2, 8], "rms_slope": 0.215, "seed": 1}
    material = {"height": 0.8, "young_modulus": 4000.0, "poisson_ratio": 0.15, "cells": [8, 8, 5]}
    micro = {"model": model} | ({} if slopes is None else {"finite_slopes": slopes})
    return make_setup(Scene.from_dict({
        "surface": {"spectrum": spectrum, "grid": [32, 32], "lengths": [1.0, 1.0]},
        "block": material | block, "patches": {"grid": [patches, patches]}, "micro": micro,
        "coupling": {"kind": kind} | (coupling or {}), "load": {"approach": approach},
    }))  # fmt: skip


@pytest.mark.parametrize(
    ("kind", "coupling"),
    [("concurrent", {}), ("consistent", {}), ("consistent", {"interface": "pointwise"})],
)
def test_cells_know_the_free_sides_of_their_block(kind, coupling):
    found = setup(kind, coupling=coupling)
    # a quarter of the block's height, its shortest side
    expected = FreeSides(lengths=(1.0, 1.0), poisson_ratio=0.15, decay_length=0.2)
    assert found.bodies.terms(side_term=True).side_term == expected
    model = found.model_on_body()
    assert model.sides == expected
    assert isinstance(model.body, BodyModes)
    assert isinstance(model.slopes[0], FiniteSlopes)
    assert (found.micro.sides, found.micro.body, found.micro.slopes) == (None, None, ())


@pytest.mark.long
@pytest.mark.parametrize(
    "given", [{"sides": "roller"}, {"margin": 0.5, "margin_cells": 2}, {"model": "elliptic"}]
)
def test_other_bodies_have_their_sides_in_the_body_term(given):
    found = setup(slopes=False, **given)
    model = found.model_on_body()
    assert isinstance(model.body, BodyModes)
    assert getattr(model, "sides", None) is None


def test_patches_alone_lie_on_a_half_space():
    model = setup("isolated").model_alone()
    assert (model.sides, model.body, model.slopes) == (None, None, ())


@pytest.mark.parametrize("kind", ["analytic", "concurrent", "consistent"])
@pytest.mark.parametrize("slopes", [None, True, False])
def test_slopes_are_finite_unless_the_scene_says_otherwise(kind, slopes):
    found = setup(kind, slopes=slopes)
    model = found.model_on_body()
    assert bool(model.slopes) == (slopes is not False)
    assert (model.body is not None) == (kind != "analytic")


@pytest.mark.parametrize(
    ("key", "block"),
    [("block.height", {"height": 1e-5}), ("block.margin", {"margin": 6e5, "margin_cells": 2})],
)
def test_blocks_too_flat_for_their_modes_are_refused(key, block):
    with pytest.raises(
        InputError, match=r"so flat a block, in \d+ modes a side, needs about"
    ) as caught:
        setup(approach=1e-6, **block).model_on_body()
    assert caught.value.key == key
