import numpy as np
import pytest

from patchlaw import InputError
from patchlaw.support import check_scale, frozen_array


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
