"""Contact of a rough surface with a rigid plane on the scale of its asperities.

Asperities and a contact modulus make an `AsperityModel`, a surface and a contact modulus a
`ScaledModel`, whose asperities follow the load, or an `IslandModel`; solved along approaches each
gives a `Response` of the surface and its patches;
`love` tells how patches of pressure move the half-space.
"""

from micro.asperity_models import MODELS, SOLVERS, AsperityModel, ModelKind, asperity_model
from micro.asperity_state import AsperityState
from micro.ellipse import (
    area_factor,
    axis_factor,
    axis_ratio,
    eccentricity,
    eccentricity_approximate,
    force_factor,
)
from micro.hertz import HertzContact, contact_modulus
from micro.island_state import IslandState
from micro.islands import IslandModel
from micro.love import love_centre, love_integral, love_mean, love_mutual
from micro.many_summits import PAIR_SUMS
from micro.response import Response
from micro.scaled_model import BORDERS, CURVATURES, ScaledModel

__all__ = [
    "BORDERS",
    "CURVATURES",
    "MODELS",
    "PAIR_SUMS",
    "SOLVERS",
    "AsperityModel",
    "AsperityState",
    "HertzContact",
    "IslandModel",
    "IslandState",
    "ModelKind",
    "Response",
    "ScaledModel",
    "area_factor",
    "asperity_model",
    "axis_factor",
    "axis_ratio",
    "contact_modulus",
    "eccentricity",
    "eccentricity_approximate",
    "force_factor",
    "love_centre",
    "love_integral",
    "love_mean",
    "love_mutual",
]
