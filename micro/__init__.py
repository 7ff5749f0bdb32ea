"""Contact of a rough surface with a rigid plane on the scale of its asperities.

Asperities and a contact modulus make an `AsperityModel`; a surface and a contact modulus make a
`ScaledModel`, whose asperities follow the load, an `IslandModel` or a `HalfSpaceModel`. Solved
along approaches each gives a `Response` of the surface and its patches; `love` tells how patches
of pressure move the half-space.
"""

from geometry.rigid_plane import RigidPlane
from micro.asperities.many_summits import PAIR_SUMS
from micro.asperities.model import MODELS, SOLVERS, AsperityModel, ModelKind, asperity_model
from micro.asperities.scaled_model import BORDERS, CURVATURES, ScaledModel
from micro.asperities.state import AsperityState
from micro.choice.candidates import Candidate, resampled
from micro.choice.selection import Choice, choose
from micro.closed_forms.boussinesq import HalfSpace
from micro.closed_forms.ellipse import (
    area_factor,
    axis_factor,
    axis_ratio,
    eccentricity,
    eccentricity_approximate,
    force_factor,
)
from micro.closed_forms.hertz import HertzContact
from micro.closed_forms.influence import influence_matrix, mutual_influence
from micro.closed_forms.love import love_centre, love_integral, love_mean, love_mutual
from micro.compliance.body_modes import BodyModes
from micro.compliance.body_stresses import BodyStresses
from micro.compliance.finite_slopes import FiniteSlopes, coarse_grid
from micro.compliance.free_sides import FreeSides
from micro.compliance.half_space_modes import half_space_modes, half_space_stress_modes
from micro.compliance.side_modes import side_modes, side_stress_modes
from micro.compliance.side_patches import side_patches
from micro.compliance.side_stresses import SideStresses, side_stresses
from micro.compliance.surface_stress import SurfaceStress
from micro.factory import MODEL_NAMES, START_KINDS, micro_model
from micro.half_space.contact_spots import Contacts, find_contacts
from micro.half_space.model import HalfSpaceModel
from micro.half_space.slope_effect import finite_slope_effect
from micro.half_space.state import HalfSpaceState
from micro.islands.model import IslandModel
from micro.islands.state import IslandState
from micro.model import MicroModel
from micro.response import Pressed, Response

__all__ = [
    "BORDERS",
    "CURVATURES",
    "MODELS",
    "MODEL_NAMES",
    "PAIR_SUMS",
    "SOLVERS",
    "START_KINDS",
    "AsperityModel",
    "AsperityState",
    "BodyModes",
    "BodyStresses",
    "Candidate",
    "Choice",
    "Contacts",
    "FiniteSlopes",
    "FreeSides",
    "HalfSpace",
    "HalfSpaceModel",
    "HalfSpaceState",
    "HertzContact",
    "IslandModel",
    "IslandState",
    "MicroModel",
    "ModelKind",
    "Pressed",
    "Response",
    "RigidPlane",
    "ScaledModel",
    "SideStresses",
    "SurfaceStress",
    "area_factor",
    "asperity_model",
    "axis_factor",
    "axis_ratio",
    "choose",
    "coarse_grid",
    "eccentricity",
    "eccentricity_approximate",
    "find_contacts",
    "finite_slope_effect",
    "force_factor",
    "half_space_modes",
    "half_space_stress_modes",
    "influence_matrix",
    "love_centre",
    "love_integral",
    "love_mean",
    "love_mutual",
    "micro_model",
    "mutual_influence",
    "resampled",
    "side_modes",
    "side_patches",
    "side_stress_modes",
    "side_stresses",
]
