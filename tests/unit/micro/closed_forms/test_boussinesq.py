"""The half-space's own refusals; its fields are verified against closed forms and quadrature."""

import pytest

from geometry.errors import InputError
from micro.closed_forms.boussinesq import HalfSpace


@pytest.mark.parametrize(("modulus", "ratio"), [(0.0, 0.3), (float("inf"), 0.3), (1.0, 0.5)])
def test_elastic_constants_out_of_range(modulus, ratio):
    with pytest.raises(InputError, match="the elastic constants are out of range"):
        HalfSpace(modulus, ratio)
