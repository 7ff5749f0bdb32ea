"""Boxes around the cells that a rigid body can touch."""

import numpy as np
import pytest

from patchlaw.micro.complementarity.cell_problem import box_around


@pytest.mark.parametrize(
    ("first", "last", "size"), [(3, 3, 6), (90, 99, 12), (0, 99, 100), (10, 41, 32), (40, 88, 64)]
)
def test_sides_are_few(first, last, size):
    cells = np.zeros((100, 7), bool)
    cells[[first, last], 3] = True
    rows, columns = box = box_around(cells)
    assert (rows.stop - rows.start, columns.stop - columns.start) == (size, 6)
    assert cells[box].sum() == cells.sum()
    assert 0 <= rows.start and rows.stop <= 100
