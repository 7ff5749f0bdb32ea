import numpy as np
import pytest

from patchlaw import InputError
from patchlaw.support import cell_counts, check_scale, frozen_array, positive_lengths


@pytest.mark.parametrize("value", [(1, 2.5), [1, 2.5], np.array([1, 2.5])])
def test_lengths_become_floats(value):
    lengths = positive_lengths(value, "the plate")
    assert lengths == (1.0, 2.5) and all(type(side) is float for side in lengths)


@pytest.mark.parametrize("value", [(3, 4), [3, 4], np.array([3, 4])])
def test_counts_become_ints(value):
    counts = cell_counts(value, "the grid")
    assert counts == (3, 4) and all(type(count) is int for count in counts)


@pytest.mark.parametrize("value", [(3, 4, 5), (), "34", None, (3.0, 4), (3, 1), (-3, 4)])
def test_counts_of_another_kind_are_refused(value):
    with pytest.raises(InputError, match=r"the grid .*2 whole numbers, each at least 2"):
        cell_counts(value, "the grid", smallest=2)


def test_frozen_arrays_are_copies():
    original = np.arange(4)
    copy = frozen_array(original)
    original[0] = 7
    assert copy[0] == 0.0 and not copy.flags.writeable


@pytest.mark.parametrize("size", [1e-290, 1e-110, 1e-16])
def test_heights_below_any_scale_are_refused(size):
    heights = size * np.random.default_rng(0).uniform(size=(4, 4))
    with pytest.raises(InputError, match=r"differ by less than any roughness .*at least 1e-15 mm"):
        check_scale(heights)


@pytest.mark.parametrize(
    "heights",
    [
        np.zeros((4, 4)),
        np.full((4, 4), 1e-200),
        1.0 + 1e-16 * np.arange(16.0).reshape(4, 4),  # but for rounding
        1e-14 * np.arange(16.0).reshape(4, 4),
        np.full((4, 4), np.nan),
    ],
)
def test_level_planes_and_fine_roughness_pass(heights):
    check_scale(heights)
