"""Materials and the contact modulus of two bodies."""

import math

import numpy as np
import pytest

from patchlaw import InputError
from patchlaw.geometry import Material, MaterialPair
from patchlaw.geometry.materials import mindlin_ratio, von_mises

RESIN = Material(young_modulus=4000.0, poisson_ratio=0.15)
STEEL = Material(young_modulus=200e3, poisson_ratio=0.3)


@pytest.mark.parametrize(
    ("e", "nu", "match"),
    [
        (0.0, 0.3, r"young_modulus = 0\.0: must be greater than 0"),
        (-4.0, 0.3, "young_modulus = -4.0: must be greater than 0"),
        (math.nan, 0.3, "young_modulus = nan: must be a finite number"),
        (math.inf, 0.3, "young_modulus = inf: must be a finite number"),
        (1.0, 0.5, r"poisson_ratio = 0\.5: must be less than 0\.5"),
        (1.0, -1.0, "poisson_ratio = -1.0: must be greater than -1"),
        (1.0, math.nan, "poisson_ratio = nan: must be a finite number"),
    ],
)
def test_impossible_material_is_refused(e, nu, match):
    with pytest.raises(InputError, match=match):
        Material(young_modulus=e, poisson_ratio=nu)


def test_moduli():
    assert RESIN.contact_modulus == pytest.approx(4092.0716112531970)
    assert RESIN.confined_modulus == pytest.approx(4000 * 0.85 / (1.15 * 0.7), rel=1e-14)
    assert Material(young_modulus=2.0, poisson_ratio=0.0).lame == (0.0, 1.0)


def test_both_bodies_count_alike():
    assert MaterialPair(first=STEEL, second=STEEL).contact_modulus == pytest.approx(1e5 / 0.91)
    pair, turned = MaterialPair(first=RESIN, second=STEEL), MaterialPair(first=STEEL, second=RESIN)
    assert pair.contact_modulus == pytest.approx(turned.contact_modulus)
    assert MaterialPair(first=RESIN).contact_modulus == RESIN.contact_modulus


def test_von_mises_of_uniaxial_stress_and_of_shear():
    uniaxial, shear = np.zeros((2, 3, 3))
    uniaxial[2, 2] = -3.0
    shear[0, 1] = shear[1, 0] = 2.0
    np.testing.assert_allclose(
        von_mises(np.stack([uniaxial, shear, np.eye(3)])),
        [3.0, 2.0 * np.sqrt(3.0), 0.0],
        atol=1e-15,
    )


def test_mindlins_ratio_is_that_of_the_shift_at_which_his_sphere_slides():
    """Johnson (1985), eq. 7.42: 3 μ F (2 − ν) / 16 a G; it approaches by 3 F / 4 E* a."""
    for material in (RESIN, STEEL):
        approach = 3.0 / (4.0 * MaterialPair(first=material).contact_modulus)
        shift = 3.0 * (2.0 - material.poisson_ratio) / (16.0 * material.shear_modulus)
        assert mindlin_ratio(material.poisson_ratio) == pytest.approx(shift / approach, rel=1e-12)
