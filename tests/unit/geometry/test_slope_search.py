"""The line search by slopes, on functions whose minimum is known."""

from patchlaw.geometry.rigid_plane import slope_search


def test_slope_search_lengthens_and_shortens():
    assert slope_search(lambda share: share - 2.5, -2.5, 1.0) == 1.0
    assert slope_search(lambda share: share - 20.0, -20.0, 1.0) == 3.0
    assert slope_search(lambda share: 40.0 * share - 1.0, -1.0, 1.0) <= 1.9 / 40.0
    assert slope_search(lambda share: -1.0, -1.0, 1.0) is None
