"""Families of meshes: contacts and their radii, sizes that fall together, what is resolved."""

import numpy as np
import pytest

from patchlaw import InputError
from patchlaw.geometry import Spectrum, Surface, reference_shapes, suggested_fine, synthesise
from patchlaw.geometry.meshes.refined_block import EDGES, ContactMap, contact_radius

ROUGH = synthesise(
    Spectrum(hurst=0.95, waves=(2, 10), rms_slope=0.215, seed=1),
    grid=(128, 128),
    lengths=(1.0, 1.0),
)
RADIUS = 0.8


def sphere(n=129):
    x = (np.arange(n) + 0.5) / n - 0.5
    return Surface(heights=-(x[:, None] ** 2 + x**2) / (2.0 * RADIUS), lengths=(1.0, 1.0))


def family(**changes):
    content = {"surface": ROUGH, "approach": 8e-3, "height": 1.0, "count": 3}
    return reference_shapes(**(content | changes))


def test_plane_apart_has_one_place():
    assert len(family(approach=-1e-3, count=1)[0].places) == 1


def test_sizes_of_tetrahedra_fall_together():
    shapes = family()
    sizes = np.array([shape.fine for shape in shapes])
    np.testing.assert_allclose(sizes[:-1] / sizes[1:], 2.0**0.25, rtol=1e-12)
    assert sizes[-1] == suggested_fine(ROUGH, 8e-3) == contact_radius(ROUGH, 8e-3) / EDGES
    for values in ([s.coarse for s in shapes], [s.growth for s in shapes]):
        squares = sizes**2  # sizes beside contacts fall with the square of those in them
        np.testing.assert_allclose(np.array(values) / squares, values[0] / squares[0], rtol=1e-12)
    assert {shape.element for shape in shapes} == {"P2"}


def test_two_meshes_span_what_three_do():
    two, three = family(count=2), family(count=3)
    assert [shape.fine for shape in two] == pytest.approx([three[0].fine, three[2].fine])
    assert family(count=1)[0].fine == two[1].fine


def test_contacts_found_decide_the_edges():
    """Two discs of pressure: the larger has larger edges, the one that bears less even larger."""
    x, y = (np.arange(128) + 0.5) / 128, (np.arange(128) + 0.5) / 128
    wide = np.hypot(x[:, None] - 0.3, y - 0.5) < 0.2
    narrow = np.hypot(x[:, None] - 0.8, y - 0.5) < 0.1
    contact = ContactMap.of_pressures(ROUGH, 1.0 * wide + 4.0 * narrow)  # of equal force
    left = contact.places[:, 0] < 0.6
    assert contact.effective == pytest.approx(2.0, abs=0.01)
    assert contact.radius[left] == pytest.approx(0.2, rel=0.04)  # a cell is 0.04 of it
    assert contact.radius[~left] == pytest.approx(0.1, rel=0.05)
    assert contact.typical == pytest.approx(0.15, rel=0.04)
    (shape,) = family(contact=contact, count=1)
    assert shape.fine == contact.typical / EDGES
    np.testing.assert_allclose(shape.edges * EDGES, contact.radius, rtol=1e-12)
    less = ContactMap.of_pressures(ROUGH, 1.0 * wide + 0.01 * narrow)
    # a 400th of the force: edges 400^(1/6) = 2.7 times as long for half the radius
    ratio = less.radius[~left].min() / less.radius[left].max()
    assert ratio == pytest.approx(0.5 * 400.0 ** (1.0 / 6.0), rel=0.1)


def test_summits_that_interfere_but_do_not_touch_are_resolved_too():
    x = (np.arange(64) + 0.5) / 64
    wide = -((x[:, None] - 0.5) ** 2 + (x - 0.5) ** 2)
    low = -4.0 * ((x[:, None] - 0.5) ** 2 + x**2) - 3e-3  # at the border of the surface
    both = Surface(heights=np.maximum(wide, low), lengths=(1.0, 1.0))
    touching = wide > -4e-3
    contact = ContactMap.of_pressures(both, 1.0 * touching)
    known = contact.with_islands(both, 8e-3)
    added = known.places[len(contact.places) :]
    assert len(added) and np.all(np.hypot(added[:, 0] - 0.5, added[:, 1]) < 0.05)
    assert added[:, 1].min() == 0.0
    np.testing.assert_array_equal(known.places[: len(contact.places)], contact.places)
    assert known.radius[len(contact.places) :].max() < 1.5 * contact.typical
    assert contact.with_islands(both, 2e-3) is contact


def test_stated_edges_are_kept():
    shapes = family(fine=0.02, count=2, element="P1", height=0.5)
    assert [shape.fine for shape in shapes] == [0.04, 0.02]
    assert [shape.element for shape in shapes] == ["P1", "P1"]
    assert [shape.height for shape in shapes] == [0.5, 0.5]
    assert suggested_fine(ROUGH, 8e-3, edges=6.0) == 0.5 * suggested_fine(ROUGH, 8e-3, edges=3.0)


def test_places_follow_the_tilt():
    (shape,) = family(surface=sphere(), approach=2e-3, tilt=(0.2, 0.0), count=1, fine=0.01)
    radius = np.sqrt(2.0 * RADIUS * (2e-3 + 0.5 * RADIUS * 0.2**2))
    away = np.hypot(shape.places[:, 0] - 0.5 - RADIUS * 0.2, shape.places[:, 1] - 0.5)
    assert away.max() == pytest.approx(radius, abs=0.01)  # a lattice of 0.01


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"count": 0}, "count = "),
        ({"count": 2.0}, "count = "),
        ({"count": True}, "count = "),
        ({"element": "Q1"}, "must be one of 'P1', 'P2'"),
        ({"fine": 0.0}, "fine = 0.0: must be greater than 0"),
        ({"fine": np.nan}, "fine = nan: must be a finite"),
        ({"height": 0.0}, "height = 0.0: must be greater"),
        ({"approach": np.nan}, "approach = nan: must be a finite"),
        ({"tilt": (np.inf, 0.0)}, r"tilt = \(inf, 0.0\): must be 2 numbers"),
    ],
)
def test_impossible_families_are_refused(changes, text):
    with pytest.raises(InputError, match=text):
        family(**changes)


FLAT = Surface(heights=np.zeros((16, 16)), lengths=(1.0, 0.6))


@pytest.mark.parametrize("approach", [2e-3, 8e-3])
def test_radius_is_that_of_hertz(approach):
    # distances from pixels of 1/258 outside: a sixth of a pixel, three times, in 0.04 and 0.08
    assert contact_radius(sphere(), approach) == pytest.approx(np.sqrt(RADIUS * approach), rel=0.04)


def test_radius_under_a_tilted_plane():
    tilt = (0.1, -0.05)
    # −r²/2R + t·r has its highest point R t²/2 above the middle
    depth = 2e-3 + 0.5 * RADIUS * np.dot(tilt, tilt)
    found = contact_radius(sphere(), 2e-3, tilt=tilt)
    assert found == pytest.approx(np.sqrt(RADIUS * depth), rel=0.04)


def test_merging_contacts_do_not_coarsen_the_mesh():
    x, y = (ROUGH.x[:, None], ROUGH.y[None, :])
    crowd = Surface(heights=0.01 * np.cos(8 * np.pi * x) * np.cos(8 * np.pi * y), lengths=(1, 1))
    assert contact_radius(crowd, 0.019) == pytest.approx(contact_radius(crowd, 0.012), rel=1e-3)
    assert contact_radius(crowd, 0.012) < 0.125 / 4  # a quarter of the distance of the summits
    assert contact_radius(crowd, 1e-4) < contact_radius(crowd, 1e-3) < contact_radius(crowd, 0.012)


def test_surfaces_without_summits():
    assert contact_radius(FLAT, 1e-3) == 0.3  # contact of all of it
    assert contact_radius(ROUGH, -1e-3) == ROUGH.spacing[0]


@pytest.mark.parametrize("edges", [0.0, -1.0, np.inf])
def test_impossible_numbers_of_edges_are_refused(edges):
    with pytest.raises(InputError, match=f"edges = {edges}: must be"):
        suggested_fine(ROUGH, 8e-3, edges=edges)
