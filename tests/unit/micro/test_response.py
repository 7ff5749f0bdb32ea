"""The response record and its derived quantities."""

import numpy as np
import pytest

from geometry import PatchGrid
from micro import AsperityModel

PATCHES = PatchGrid(grid=(2, 3), lengths=(1.0, 1.0))


@pytest.fixture
def response(cluster):
    model = AsperityModel("circular", cluster, contact_modulus=4000.0)
    return model.respond([0.0, 2e-3, 5e-3], patches=PATCHES, mean_heights=np.full(6, -0.02))


def test_patches_sum_to_the_whole(response):
    assert response.patch_force.sum(axis=1) == pytest.approx(response.force, rel=1e-14)
    assert response.patch_contact_area.sum(axis=1) == pytest.approx(
        response.contact_area, rel=1e-14
    )
    assert response.patch_contacts.sum(axis=1).tolist() == response.contacts.tolist()
    assert response.patch_separation.mean(axis=1) == pytest.approx(response.mean_separation)
    assert response.patch_pressure.mean(axis=1) == pytest.approx(response.mean_pressure)


def test_derived_quantities(response):
    assert response.nominal_area == pytest.approx(1.0)
    assert response.mean_pressure == pytest.approx(response.force)
    kappa = response.kappa(0.2)
    assert np.isnan(kappa[0])
    expected = response.contact_area_fraction[1:] * 0.2 * 4000.0 / response.mean_pressure[1:]
    assert kappa[1:] == pytest.approx(expected)


def test_displacement_opens_the_gap(response):
    rigid = 0.02 - response.approach
    assert response.mean_separation[0] == pytest.approx(rigid[0])
    assert np.all(response.mean_separation[1:] > rigid[1:])
