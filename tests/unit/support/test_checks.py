import numpy as np
import pytest

from patchlaw.support import check_scale, frozen_array


def test_frozen_arrays_are_copies():
    original = np.arange(4)
    copy = frozen_array(original)
    original[0] = 7
    assert copy[0] == 0.0 and not copy.flags.writeable


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
