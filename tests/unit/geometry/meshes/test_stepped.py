"""Blocks on boxes: one body, small cells at its top and at re-entrant edges."""

import numpy as np
import pytest

from geometry import InputError
from geometry.meshes.refined_block import RefinedShape
from geometry.meshes.stepped import SteppedShape

PLACES = np.array([[0.3, 0.4]])
ARM = [[0.0, 0.0, -1.0], [2.0, 0.8, -0.5]]


def shape(boxes=(ARM,), **changes):
    content = {"interface": (1.0, 0.8), "height": 0.5, "places": PLACES, "fine": 0.02}
    return SteppedShape(block=RefinedShape(**(content | {"coarse": 0.3} | changes)), boxes=boxes)


def tetrahedra(found):
    """Return the corners of all tetrahedra [mm], shape (n, 4, 3)."""
    with found.meshed() as model:
        tags, coordinates, _ = model.mesh.getNodes()
        place = dict(zip(tags, coordinates.reshape(-1, 3) * found.unit, strict=True))
        _, nodes = model.mesh.getElementsByType(4)
        assert model.getPhysicalGroups() == [(3, 1)]
    return np.array([place[node] for node in nodes]).reshape(-1, 4, 3)


def lengths(corners):
    """Return middles and lengths of all edges."""
    pairs = [(i, j) for i in range(4) for j in range(i)]
    ends = np.concatenate([corners[:, [i, j]] for i, j in pairs])
    return ends.mean(axis=1), np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1)


def test_an_l_has_its_volume_and_small_cells_where_they_are_needed():
    corners = tetrahedra(shape())
    volume = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])).sum() / 6.0
    assert volume == pytest.approx(1.0 * 0.8 * 0.5 + 2.0 * 0.8 * 0.5, rel=1e-12)
    middle, length = lengths(corners)
    # the axis of the re-entrant edge is that of y
    seam = np.hypot(middle[:, 0] - 1.0, middle[:, 2] + 0.5)
    assert np.median(length[seam < 0.05]) < 0.08  # a fifth of the largest is 0.06
    assert np.median(length[np.linalg.norm(middle - [0.3, 0.4, 0.0], axis=1) < 0.03]) < 0.03
    assert np.median(length[(middle[:, 0] > 1.7) & (middle[:, 2] < -0.8)]) > 0.2


def test_several_boxes_and_any_size():
    plate = [[-0.5, -0.5, -0.7], [1.5, 1.3, -0.5]]
    foot = [[0.2, 0.2, -1.0], [0.8, 0.6, -0.7]]
    corners = tetrahedra(shape([plate, foot]))
    volume = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])).sum() / 6.0
    assert volume == pytest.approx(0.4 + 2.0 * 1.8 * 0.2 + 0.6 * 0.4 * 0.3, rel=1e-9)
    small = 1e-6 * np.array([plate, foot])
    content = {"interface": (1e-6, 8e-7), "height": 5e-7, "places": 1e-6 * PLACES}
    again = tetrahedra(shape(small, **content, fine=2e-8, coarse=3e-7))
    assert len(again) == len(corners)


@pytest.mark.parametrize(
    ("boxes", "problem"),
    [
        ([[[0.0, 0.0, -1.0], [2.0, 0.8, -0.4]]], "reaches above the bottom"),
        ([[[0.0, 0.0, -1.0], [0.0, 0.8, -0.5]]], "no volume"),
        ([[[0.0, 0.0, -np.inf], [1.0, 0.8, -0.5]]], "no volume"),
        ([], "two corners"),
        ([[0.0, 0.0, -1.0]], "two corners"),
    ],
)
def test_wrong_boxes(boxes, problem):
    with pytest.raises(InputError, match=problem):
        shape(boxes)


def test_boxes_apart_are_no_body():
    with (
        pytest.raises(InputError, match="not one body"),
        shape([ARM, [[5, 0, -1], [6, 1, -0.5]]]).meshed(),
    ):
        pass
