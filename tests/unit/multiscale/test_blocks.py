"""Which contacts know of the block's free sides, and what loads its smooth rest then needs."""

from __future__ import annotations

import numpy as np
import pytest

from micro import FreeSides
from multiscale import Scene, make_stage
from multiscale.couplings.blocks import contact_model, fine_loads, free_sides
from multiscale.planning.press_work import press_work


def stage(kind="concurrent", model="half-space", patches=4, coupling=None, **block):
    spectrum = {"hurst": 0.95, "waves": [2, 8], "rms_slope": 0.215, "seed": 1}
    material = {"height": 0.8, "young_modulus": 4000.0, "poisson_ratio": 0.15}
    return make_stage(
        Scene.from_dict(
            {
                "surface": {"spectrum": spectrum, "grid": [32, 32], "lengths": [1.0, 1.0]},
                "block": material | block,
                "patches": {"grid": [patches, patches]},
                "micro": {"model": model},
                "coupling": {"kind": kind} | (coupling or {}),
                "load": {"approach": 0.008},
            }
        )
    )


@pytest.mark.parametrize("kind", ["concurrent", "consistent"])
def test_cells_know_the_free_sides_of_a_decomposed_block(kind):
    found = stage(kind)
    # a quarter of the block's height, its shortest side
    expected = FreeSides(lengths=(1.0, 1.0), poisson_ratio=0.15, reach=0.2)
    assert free_sides(found) == expected
    assert contact_model(found).sides == expected
    assert found.model.sides is None
    borders = fine_loads(found).borders_x
    np.testing.assert_allclose(borders[:4], [0.0, 1 / 32, 1 / 16, 1 / 8], rtol=1e-13)


@pytest.mark.parametrize(
    "given",
    [
        {"sides": "roller"},
        {"margin": 0.5, "margin_cells": 2},
        {"model": "islands"},
        {"kind": "isolated"},
        {"kind": "consistent", "coupling": {"compliance": "finite-element"}},
    ],
)
def test_other_contacts_know_of_none(given):
    found = stage(**given)
    assert free_sides(found) is None
    assert contact_model(found) is found.model


def test_loads_are_finer_at_sides_that_contacts_do_not_know():
    borders = fine_loads(stage(model="islands")).borders_x
    np.testing.assert_allclose(borders[:4], [0.0, 1 / 64, 1 / 32, 1 / 16], rtol=1e-13)
    even = fine_loads(stage(sides="roller")).borders_y
    np.testing.assert_allclose(np.diff(even), 1 / 16, rtol=1e-12)


def test_sides_are_more_work():
    known, unknown = stage(), stage(sides="roller")
    assert press_work(known, sagging=True) == 2.0 * press_work(unknown, sagging=True)
