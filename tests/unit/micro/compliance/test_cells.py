"""Boxes around the cells within reach."""

import numpy as np
import pytest

from micro.compliance.cells import Box


@pytest.mark.parametrize(
    ("first", "last", "size"), [(3, 3, 6), (90, 99, 12), (0, 99, 100), (10, 41, 32), (40, 88, 64)]
)
def test_sides_are_few(first, last, size):
    cells = np.zeros((100, 7), bool)
    cells[[first, last], 3] = True
    box = Box.around(cells)
    assert box.shape == (size, 6)
    assert cells[box].sum() == cells.sum()
    assert 0 <= box.rows.start and box.rows.stop <= 100
