"""Types of arrays, by what they hold."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]
"""Real numbers."""

Flags: TypeAlias = NDArray[np.bool_]
"""Truth values."""

Indices: TypeAlias = NDArray[np.intp]
"""Indices into other arrays."""

Counts: TypeAlias = NDArray[np.int64]
"""Numbers of things."""
