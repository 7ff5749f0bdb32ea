"""Contact of a rough surface with a rigid plane on the scale of its asperities.

Every micro model has one entry, ``press``: a plane under a `Control` presses on the surface, and a
`ContactState` tells the contact of the surface and its patches. `HalfSpaceModel` solves the contact
problem on the surface's cells. `AsperityModel` sees its summits alone. `micro_model` makes any of
them by name.

    closed_forms                                      Hertz, Love
    compliance → contact → half_space                 the contact problem on cells
    asperities                                        summits that interact pair by pair
"""

from geometry.contact_state import ContactState, Spots, Start, stacked
from geometry.rigid_plane import RigidPlane
from micro.asperities.contacts import SOLVERS
from micro.asperities.model import MODELS, AsperityModel
from micro.boundary_elements.body_modes import BodyModes, BodyStresses
from micro.boundary_elements.finite_slopes import FiniteSlopes, SurfaceStress, coarse_grid
from micro.boundary_elements.free_sides import FreeSides
from micro.boundary_elements.rectangle_fields import RectangleFields
from micro.boundary_elements.rectangle_modes import (
    half_space_modes,
    half_space_stress_modes,
    side_modes,
    side_stress_modes,
)
from micro.boundary_elements.side_cells import SideStresses, side_stresses
from micro.by_name import MODEL_NAMES, micro_model
from micro.closed_forms.hertz import HertzContact
from micro.closed_forms.love import influence_matrix
from micro.half_space.contact_spots import find_spots
from micro.half_space.model import HalfSpaceModel
from micro.model import MicroModel, Stiffness, press_along

__all__ = [
    "MODELS",
    "MODEL_NAMES",
    "SOLVERS",
    "AsperityModel",
    "BodyModes",
    "BodyStresses",
    "ContactState",
    "FiniteSlopes",
    "FreeSides",
    "HalfSpaceModel",
    "HertzContact",
    "MicroModel",
    "RectangleFields",
    "RigidPlane",
    "SideStresses",
    "Spots",
    "Start",
    "Stiffness",
    "SurfaceStress",
    "coarse_grid",
    "find_spots",
    "half_space_modes",
    "half_space_stress_modes",
    "influence_matrix",
    "micro_model",
    "press_along",
    "side_modes",
    "side_stress_modes",
    "side_stresses",
    "stacked",
]
