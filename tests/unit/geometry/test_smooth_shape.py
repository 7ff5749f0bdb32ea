"""The division of a block for its smooth correction."""

import numpy as np
import pytest

from geometry.errors import InputError
from geometry.meshes import BlockShape
from geometry.smooth_shape import smooth_shape


def block(cells, **options):
    return smooth_shape(BlockShape(interface=(1.0, 2.0), height=0.5, cells=cells, **options))


def test_nodes_are_as_many_as_those_of_the_trilinear_cells():
    shape = block((16, 8, 12))
    assert [len(nodes) for nodes in shape.nodes] == [17, 9, 13]
    assert shape.unknowns == 3 * 17 * 9 * 13
    assert shape.cell_count == 8 * 4 * 6
    assert block((1, 5, 6)).cell_count == 2 * 4 * 4  # an even number, rounded up


def test_cells_shrink_towards_all_faces_alike():
    for ticks, ends, ratio in zip(
        block((16, 16, 8)).ticks,
        ((0.0, 1.0), (0.0, 2.0), (-0.5, 0.0)),
        (1.5**3, 1.5**3, 2.0),
        strict=True,
    ):
        sizes = np.diff(ticks)
        assert (ticks[0], ticks[-1]) == ends
        np.testing.assert_allclose(sizes, sizes[::-1], rtol=1e-13)
        assert sizes.max() / sizes.min() == pytest.approx(ratio, rel=1e-13)


def test_cells_shrink_no_further_than_to_an_eighth():
    sizes = np.diff(block((40, 40, 20)).ticks[0])
    assert sizes.max() / sizes.min() == pytest.approx(8.0, rel=1e-12)


def test_margin_keeps_its_own_grading():
    options = {"margin": 0.6, "margin_cells": 6, "margin_grading": 9.0}
    shape = block((4, 4, 4), grading=3.0, element="P1", **options)
    sizes = np.diff(shape.ticks[0])
    assert len(sizes) == 3 + 2 + 3
    np.testing.assert_allclose(sizes[3:5], 0.5, rtol=1e-13)
    np.testing.assert_allclose(sizes[[0, 2]], 0.6 * np.array([9.0, 1.0]) / 13.0, rtol=1e-13)


def test_element_and_grading_in_depth_do_not_matter():
    assert block((4, 4, 4), grading=3.0, element="P1") == block((4, 4, 4))
    assert block((4, 4, 4)).degree == 2


def test_more_unknowns_than_one_factorisation_takes_are_refused():
    with pytest.raises(InputError, match="519675 unknowns are too many for the smooth correction"):
        block((64, 64, 40))
