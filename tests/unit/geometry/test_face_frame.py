"""Coordinates on a planar face anywhere in space."""

import numpy as np
import pytest

from patchlaw.geometry.face_frame import FaceFrame
from patchlaw.support import InputError

ANGLE = np.pi / 6.0


def test_top_of_a_block_has_its_own_coordinates():
    corners = [[0, 0, 0], [2, 0, 0], [0, 3, 0], [2, 3, 0]]
    frame = FaceFrame.through(corners, [1e-17, -3e-18, 4.0])
    assert frame.axes.tolist() == np.eye(3).tolist()
    assert frame.origin.tolist() == [0.0, 0.0, 0.0]
    assert frame.in_plane(corners).tolist() == [c[:2] for c in corners]
    assert frame.height([[0.3, 0.2, -0.7]]).tolist() == [-0.7]


@pytest.mark.parametrize(
    ("normal", "e1", "e2"),
    [
        ([0, 0, 1], [1, 0, 0], [0, 1, 0]),
        ([0, 0, -2], [1, 0, 0], [0, -1, 0]),
        ([0, 1, 0], [1, 0, 0], [0, 0, -1]),
        ([1, 0, 0], [0, 1, 0], [0, 0, 1]),
        ([-1, 0, 0], [0, 1, 0], [0, 0, -1]),
        # 30° off x sharp, and little less
        ([np.cos(ANGLE), 0, np.sin(ANGLE)], [np.sin(ANGLE), 0, -np.cos(ANGLE)], [0, 1, 0]),
        ([np.cos(0.5), 0, np.sin(0.5)], [0, 1, 0], [-np.sin(0.5), 0, np.cos(0.5)]),
    ],
)
def test_default_axes(normal, e1, e2):
    axes = FaceFrame.across(normal).axes
    np.testing.assert_allclose(axes[:2], [e1, e2], atol=1e-15)  # round-off
    np.testing.assert_allclose(axes[2], normal / np.linalg.norm(normal), atol=1e-15)


def test_turned_face_keeps_lengths_and_comes_back():
    random = np.random.default_rng(3)
    turn, _ = np.linalg.qr(random.normal(size=(3, 3)))
    turn *= np.sign(np.linalg.det(turn))
    flat = np.column_stack([random.random((40, 2)), np.zeros(40)])
    points = flat @ turn.T + [5.0, -7.0, 2.0]
    frame = FaceFrame.through(points, turn[:, 2])
    places = frame.in_plane(points)
    np.testing.assert_allclose(places.min(axis=0), 0.0, atol=1e-14)  # round-off of numbers near 7
    np.testing.assert_allclose(frame.height(points), 0.0, atol=1e-14)
    spans = np.linalg.norm(points[:, None] - points, axis=2)
    np.testing.assert_allclose(np.linalg.norm(places[:, None] - places, axis=2), spans, atol=1e-14)
    np.testing.assert_allclose(frame.in_space(places), points, atol=1e-14)
    above = frame.in_space(places, np.full(40, 0.25))
    np.testing.assert_allclose(frame.height(above), 0.25, atol=1e-14)
    np.testing.assert_allclose(np.cross(frame.axes[0], frame.axes[1]), frame.normal, atol=1e-15)


def test_plane_goes_through_the_highest_point():
    frame = FaceFrame.through([[1, 1, 0.0], [2, 1, 0.0], [1, 2, 0.0], [2, 2, 0.2]], [0, 0, 1])
    assert frame.origin.tolist() == [1.0, 1.0, 0.2]
    assert frame.moved(0.5, 0.25).origin.tolist() == [1.5, 1.25, 0.2]


@pytest.mark.parametrize("normal", [[0, 0, 0], [np.nan, 0, 1], [1, 0]])
def test_normals_are_checked(normal):
    with pytest.raises(InputError, match="the normal of a face is no direction"):
        FaceFrame.across(normal)


def test_frames_are_checked():
    with pytest.raises(InputError, match="without points"):
        FaceFrame.through(np.empty((0, 3)), [0, 0, 1])
    with pytest.raises(InputError, match="three orthonormal, right-handed rows"):
        FaceFrame(origin=np.zeros(3), axes=np.diag([1.0, 1.0, -1.0]))
    with pytest.raises(InputError, match="the origin of a face is no point"):
        FaceFrame(origin=np.array([0.0, np.inf, 0.0]), axes=np.eye(3))
    with pytest.raises(ValueError, match="read-only"):
        FaceFrame.across([0, 0, 1]).axes[0] = 0.0
