"""Small sets of asperities."""

from functools import partial

import numpy as np
import pytest
from helpers import interaction_cases


@pytest.fixture
def summits():
    """Build asperities on a square of 1 mm from scalars or arrays."""
    return partial(interaction_cases.summits, highest=None)


@pytest.fixture
def cluster():
    """Seven elliptic asperities close together, of different height, size and direction."""
    rng = np.random.default_rng(7)
    minor = 0.05 * np.exp(rng.normal(0.0, 0.5, 7))
    return interaction_cases.summits(
        *(0.5 + 0.2 * (rng.random((2, 7)) - 0.5)),
        z=-rng.exponential(2e-3, 7),
        major=minor * (1.0 + rng.exponential(1.0, 7)),
        minor=minor,
        angle=np.pi * rng.random(7),
    )
