"""Small sets of asperities."""

import numpy as np
import pytest

from patchlaw.geometry import Asperities


def _summits(x, y, *, z=0.0, major=0.1, minor=None, angle=0.0, highest=None):
    x = np.atleast_1d(np.asarray(x, float))

    def full(value):
        return np.broadcast_to(np.asarray(value, float), x.shape)

    heights = full(z)
    return Asperities(
        x=x,
        y=full(y),
        z=heights,
        radius_major=full(major),
        radius_minor=full(major if minor is None else minor),
        angle=full(angle),
        lengths=(1.0, 1.0),
        highest=float(heights.max(initial=-np.inf) if highest is None else highest),
        mean_height=-0.02,
    )


@pytest.fixture
def summits():
    """Build asperities on a square of 1 mm from scalars or arrays."""
    return _summits


@pytest.fixture
def cluster():
    """Seven elliptic asperities close together, of different height, size and direction."""
    rng = np.random.default_rng(7)
    minor = 0.05 * np.exp(rng.normal(0.0, 0.5, 7))
    return _summits(
        *(0.5 + 0.2 * (rng.random((2, 7)) - 0.5)),
        z=-rng.exponential(2e-3, 7),
        major=minor * (1.0 + rng.exponential(1.0, 7)),
        minor=minor,
        angle=np.pi * rng.random(7),
        highest=0.0,
    )
