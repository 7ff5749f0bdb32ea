"""Natural modes on 1 to 3 ranks: by factors or multigrid, of a plane with a mass, that slides."""

import numpy as np
import pytest
from helpers.on_ranks import RANKS


@pytest.mark.parametrize("ranks", RANKS)
def test_modes_are_the_same_on_any_ranks(on_ranks, ranks):
    for name in ("held", "mass", "slides", "multigrid slides", "square", "square slides"):
        (one, *_), (found, residual, facets) = on_ranks[1][name], on_ranks[ranks][name]
        one, found = np.array(one), np.array(found)
        # modes are accurate to 1e-10; in forces rough errors count by their stiffness
        assert residual < 1e-7, name
        assert facets == (132 if name == "mass" else 54 if name[:2] == "sq" else 66), name
        assert name != "square" or one[0, 0] == one[1, 0]  # modes that are repeated
        # frequencies to 1e-8; decay of pairs over the frequency; shares between 0 and 1
        np.testing.assert_allclose(found[:, 0], one[:, 0], rtol=1e-8, err_msg=name)
        atol = 1e-8 * np.array([2.0 * np.pi * one[0, 0], 1.0, 1.0, 1.0, 1.0])
        assert (abs(found[:, 1:] - one[:, 1:]) <= atol).all(), name


@pytest.mark.parametrize("ranks", RANKS)
def test_the_contact_stiffness_is_written_the_same_by_the_meshs_numbers(on_ranks, ranks):
    (numbers, one), (again, found) = on_ranks[1]["springs"], on_ranks[ranks]["springs"]
    assert sorted(again) == sorted(numbers)
    np.testing.assert_allclose(found, one, rtol=1e-10, atol=1e-10 * np.abs(one).max())


@pytest.mark.parametrize("ranks", RANKS)
def test_scenes_of_worn_patches_vibrate_on_any_ranks(on_ranks, ranks):
    np.testing.assert_allclose(on_ranks[ranks]["scene"], on_ranks[1]["scene"], rtol=1e-8)
